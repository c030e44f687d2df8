// The equations of one branch of a family: bounds on boxes, and descents to their zeros.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "boxes.hpp"
#include "conditions.hpp"

namespace pinsing {

constexpr double kOn = 1e-12;  // residual, relative to an equation's size, of a point on it

// The equations of one branch, in the joints that occur in them.
class Branch {
public:
    Branch(const Conditions& c, int branch) : largest_(c.largest) {
        int number[kJoints];
        std::fill(number, number + kJoints, -1);
        const std::int64_t first = c.equation_start[branch], last = c.equation_start[branch + 1];
        auto named = [&](std::int64_t joint) {
            if (number[joint] < 0) {
                number[joint] = static_cast<int>(joints.size());
                joints.push_back(static_cast<int>(joint));
            }
            return number[joint];
        };
        for (std::int64_t e = first; e < last; e++) {
            Sum sum;
            sum.noise = c.noise[e];
            sum.reach = c.reach[e];
            sum.curvature = c.curvature[e];
            sum.sliding = c.sliding[e];
            sum.unit = std::max(1.0, sum.noise * 1e13);
            for (std::int64_t t = c.term_start[e]; t < c.term_start[e + 1]; t++) {
                sum.terms.push_back({c.amplitude[t], c.phase[t],
                                     static_cast<int>(c.rate_start[t + 1] - c.rate_start[t]),
                                     static_cast<int>(c.power_start[t + 1] - c.power_start[t])});
                for (std::int64_t k = c.rate_start[t]; k < c.rate_start[t + 1]; k++) {
                    sum.rate_joint.push_back(named(c.rate_joint[k]));
                    sum.rate.push_back(c.rate[k]);
                }
                for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++) {
                    sum.power_joint.push_back(named(c.power_joint[k]));
                    sum.power.push_back(static_cast<int>(c.power[k]));
                }
            }
            sums.push_back(std::move(sum));
        }
        at_.resize(sums.size());
    }

    std::vector<int> joints;
    std::vector<Sum> sums;

    int d() const { return static_cast<int>(joints.size()); }

    // Minimum-norm step onto the linearised equations at x, among `free` joints, and what of
    // `delta` lies along them.
    void steps(const double* x, const bool* free, const double* delta, double* onto, double* along,
               double& residual) {
        const int n = d();
        residual = 0.0;
        for (std::size_t i = 0; i < sums.size(); i++) {
            sums[i].at(x, nullptr, n, at_[i]);
            residual = std::max(residual, std::fabs(at_[i].value) / (at_[i].size * sums[i].unit));
            for (int j = 0; j < n; j++)
                if (!free[j]) at_[i].g[j] = 0.0;
        }
        if (sums.size() == 1) {
            const double* g = at_[0].g;
            double square = 0.0, product = 0.0;
            for (int j = 0; j < n; j++) square += g[j] * g[j], product += g[j] * delta[j];
            const bool flat = std::sqrt(square) <= 1e-10 * at_[0].size;
            for (int j = 0; j < n; j++) {
                onto[j] = flat ? 0.0 : -at_[0].value * g[j] / square;
                along[j] = free[j] ? delta[j] - (flat ? 0.0 : product * g[j] / square) : 0.0;
            }
            return;
        }
        double A[kJoints * kJoints] = {}, V[kJoints * kJoints], values[kJoints], right[kJoints] = {};
        for (const Sum::At& one : at_) {
            const double scale = 1.0 / one.size;
            for (int i = 0; i < n; i++) {
                right[i] -= one.g[i] * one.value * scale * scale;
                for (int j = 0; j < n; j++) A[i * n + j] += one.g[i] * one.g[j] * scale * scale;
            }
        }
        eigen(A, V, values, n);
        const double top = *std::max_element(values, values + n);
        std::fill(onto, onto + n, 0.0);
        std::fill(along, along + n, 0.0);
        for (int m = 0; m < n; m++) {
            double product = 0.0, move = 0.0;
            for (int j = 0; j < n; j++)
                product += V[j * n + m] * right[j], move += V[j * n + m] * delta[j];
            const bool across = values[m] > 1e-13 * top;
            for (int j = 0; j < n; j++)
                (across ? onto : along)[j] += V[j * n + m] * (across ? product / values[m] : move);
        }
        for (int j = 0; j < n; j++)
            if (!free[j]) onto[j] = along[j] = 0.0;
    }

    // From x to a point of the set within the box that is nearest to q, by Newton's method on the
    // equations and a pull towards q along them (or without it, to the set only). Returns the
    // distance, infinite without success.
    double descend(const double* q, const double* lo, const double* hi, bool pull, double* x) {
        const int n = d();
        double delta[kJoints], onto[kJoints], along[kJoints], before[kJoints] = {}, relax = 1.0;
        bool free[kJoints];
        double residual = kInfinity;
        for (int iteration = pull ? 0 : 40; iteration < 60; iteration++) {
            const bool settling = iteration >= 40;
            for (int j = 0; j < n; j++) delta[j] = settling ? 0.0 : q[j] - x[j], free[j] = true;
            // A joint at its limit that would leave is held, and the step taken anew.
            double step[kJoints], size = 0.0;
            for (int round = 0; round <= n; round++) {
                steps(x, free, delta, onto, along, residual);
                bool changed = false;
                for (int j = 0; j < n; j++) {
                    step[j] = onto[j] + relax * along[j];
                    if (!free[j]) continue;
                    if ((x[j] <= lo[j] && step[j] < 0.0) || (x[j] >= hi[j] && step[j] > 0.0)) {
                        free[j] = false;
                        changed = true;
                    }
                }
                if (!changed) break;
            }
            if (largest_ && sums.size() == 1 && !settling)
                cube_step(q, lo, hi, x, relax, step, along);
            double turned = 0.0;
            for (int j = 0; j < n; j++) turned += along[j] * before[j], before[j] = along[j];
            relax = turned < 0.0 ? 0.5 * relax : std::min(1.0, 1.1 * relax);
            for (int j = 0; j < n; j++) size = std::max(size, std::fabs(step[j]));
            if (settling && residual < 1e-15) break;
            const double shorter = size > 0.6 ? 0.6 / size : 1.0;
            for (int j = 0; j < n; j++)
                x[j] = std::min(std::max(x[j] + shorter * step[j], lo[j]), hi[j]);
            if (size < 1e-13) {
                if (settling) break;
                iteration = 39;
            }
        }
        double off[kJoints];
        bool all[kJoints];
        std::fill(all, all + n, true);
        for (int j = 0; j < n; j++) delta[j] = 0.0, off[j] = x[j] - q[j];
        steps(x, all, delta, onto, along, residual);
        if (!(residual <= kOn)) return kInfinity;
        return norm_of(off, n, largest_);
    }

    // Lower bound of the distance from q to the set within the box; infinite if there is none.
    double bound(const double* q, const double* c, const double* h, double known) {
        const int n = d();
        double lo[kJoints], hi[kJoints], near[kJoints], off[kJoints];
        for (int j = 0; j < n; j++) {
            lo[j] = c[j] - h[j];
            hi[j] = c[j] + h[j];
            near[j] = std::min(std::max(q[j], lo[j]), hi[j]);
            off[j] = near[j] - q[j];
        }
        double best = std::max(known, norm_of(off, n, largest_) * (1.0 - 4e-15));
        for (std::size_t i = 0; i < sums.size(); i++) {
            sums[i].at(c, h, n, at_[i]);
            best = std::max(best, of_slab(q, c, h, lo, hi, near, at_[i].value, at_[i].g,
                                          at_[i].rest));
            if (best == kInfinity) return best;
        }
        if (sums.size() > 1) best = std::max(best, of_combination(q, c, h, lo, hi, near));
        return best;
    }

    const Sum::At& first_at(const double* x) {
        sums[0].at(x, nullptr, d(), at_[0]);
        return at_[0];
    }

private:
    bool largest_;
    std::vector<Sum::At> at_;

    // In the maximum norm: to where the least cube around q meets the linearised equation at x,
    // whose value and gradient are in at_.
    void cube_step(const double* q, const double* lo, const double* hi, const double* x,
                   double relax, double* step, double* along) const {
        const int n = d();
        const double* g = at_[0].g;
        double here = at_[0].value, from = 0.0, near[kJoints];
        for (int j = 0; j < n; j++) {
            near[j] = std::min(std::max(q[j], lo[j]), hi[j]);
            here += g[j] * (near[j] - x[j]);
            from = std::max(from, std::fabs(near[j] - q[j]));
        }
        const bool upward = here < 0.0;
        const double r = cube_to_plane(q, lo, hi, g, std::fabs(here), n, upward, from);
        if (r == kInfinity) return;
        for (int j = 0; j < n; j++) {
            const bool rises = (g[j] > 0.0) == upward;
            double y = near[j];
            if (std::fabs(g[j]) > 1e-9 * at_[0].size)
                y = rises ? std::min(hi[j], std::max(q[j] + r, near[j]))
                          : std::max(lo[j], std::min(q[j] - r, near[j]));
            along[j] = y - x[j];
            step[j] = relax * along[j];
        }
    }

    double of_slab(const double* q, const double* c, const double* h, const double* lo,
                   const double* hi, const double* near, double value, const double* g,
                   double rest) const {
        const int n = d();
        double reach = rest, a0 = value, here = value;
        for (int j = 0; j < n; j++) {
            reach += std::fabs(g[j]) * h[j];
            a0 -= g[j] * c[j];
            here += g[j] * (near[j] - c[j]);
        }
        if (std::fabs(value) > reach * (1.0 + 1e-14)) return kInfinity;
        if (std::fabs(here) <= rest) return 0.0;
        const double target = here > 0.0 ? rest : -rest;
        if (largest_) {
            double from = 0.0;
            for (int j = 0; j < n; j++) from = std::max(from, std::fabs(near[j] - q[j]));
            const double r = cube_to_plane(q, lo, hi, g, std::fabs(here - target), n, here < 0.0,
                                           from);
            return r == kInfinity ? r : std::max(r * (1.0 - 1e-12) - 1e-13, 0.0);
        }
        return to_plane(q, lo, hi, g, a0, target, n);
    }

    double of_combination(const double* q, const double* c, const double* h, const double* lo,
                          const double* hi, const double* near) const {
        const int n = d();
        const int k = std::min<int>(static_cast<int>(sums.size()), kMaxCombined);
        double A[kMaxCombined * kMaxCombined], y[kMaxCombined], trace = 1e-300;
        for (int i = 0; i < k; i++) {
            y[i] = at_[i].value;
            for (int j = 0; j < n; j++) y[i] += at_[i].g[j] * (near[j] - c[j]);
            for (int m = 0; m < k; m++) {
                double sum = 0.0;
                for (int j = 0; j < n; j++) sum += at_[i].g[j] * at_[m].g[j];
                A[i * k + m] = sum;
            }
            trace += A[i * k + i];
        }
        for (int i = 0; i < k; i++) A[i * k + i] += 1e-13 * trace;
        for (int i = 0; i < k; i++) {  // Cholesky; any multiples will do for a bound
            for (int j = 0; j <= i; j++) {
                double sum = A[i * k + j];
                for (int m = 0; m < j; m++) sum -= A[i * k + m] * A[j * k + m];
                A[i * k + j] = i == j ? std::sqrt(std::max(sum, 1e-15 * trace)) : sum / A[j * k + j];
            }
        }
        for (int i = 0; i < k; i++) {
            for (int m = 0; m < i; m++) y[i] -= A[i * k + m] * y[m];
            y[i] /= A[i * k + i];
        }
        for (int i = k - 1; i >= 0; i--) {
            for (int m = i + 1; m < k; m++) y[i] -= A[m * k + i] * y[m];
            y[i] /= A[i * k + i];
        }
        double value = 0.0, rest = 0.0, size = 0.0, g[kJoints] = {};
        for (int i = 0; i < k; i++) {
            value += y[i] * at_[i].value;
            rest += std::fabs(y[i]) * (at_[i].rest + 1e-15 * at_[i].size);
            size += std::fabs(y[i]) * at_[i].size;
            for (int j = 0; j < n; j++) g[j] += y[i] * at_[i].g[j];
        }
        if (!(size < 1e300)) return 0.0;
        return of_slab(q, c, h, lo, hi, near, value, g, rest);
    }
};

}  // namespace pinsing
