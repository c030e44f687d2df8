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
        at.resize(sums.size());
    }

    std::vector<int> joints;
    std::vector<Sum> sums;

    int d() const { return static_cast<int>(joints.size()); }

    // Values and gradients at x; the largest value over its equation's size.
    double evaluate(const double* x) {
        double residual = 0.0;
        for (std::size_t i = 0; i < sums.size(); i++) {
            sums[i].at(x, nullptr, d(), at[i]);
            residual = std::max(residual, std::fabs(at[i].value) / (at[i].size * sums[i].unit));
        }
        return residual;
    }

    // Minimum-norm step onto the linearised equations where they were evaluated, among `free`
    // joints, and what of `delta` lies along them.
    void steps(const bool* free, const double* delta, double* onto, double* along) {
        const int n = d();
        for (Sum::At& one : at)
            for (int j = 0; j < n; j++)
                if (!free[j]) one.g[j] = 0.0;
        if (sums.size() == 1) {
            const double* g = at[0].g;
            double square = 0.0, product = 0.0;
            for (int j = 0; j < n; j++) square += g[j] * g[j], product += g[j] * delta[j];
            const bool flat = std::sqrt(square) <= 1e-10 * at[0].size;
            for (int j = 0; j < n; j++) {
                onto[j] = flat ? 0.0 : -at[0].value * g[j] / square;
                along[j] = free[j] ? delta[j] - (flat ? 0.0 : product * g[j] / square) : 0.0;
            }
            return;
        }
        double A[kJoints * kJoints] = {}, V[kJoints * kJoints], values[kJoints], right[kJoints] = {};
        for (const Sum::At& one : at) {
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

    // The step from x, where the equations were evaluated, among joints that do not leave their
    // limits by it: onto the set, and by `relax` of what of `delta` lies along it.
    void held_step(const double* x, const double* lo, const double* hi, const double* delta,
                   double relax, double* step, double* along) {
        const int n = d();
        double onto[kJoints];
        bool free[kJoints];
        std::fill(free, free + n, true);
        for (int round = 0; round <= n; round++) {
            steps(free, delta, onto, along);
            bool changed = false;
            for (int j = 0; j < n; j++) {
                step[j] = onto[j] + relax * along[j];
                if (!free[j]) continue;
                if ((x[j] <= lo[j] && step[j] < 0.0) || (x[j] >= hi[j] && step[j] > 0.0)) {
                    free[j] = false;
                    changed = true;
                }
            }
            if (!changed) return;
        }
    }

    // Straight onto the set from x, by Newton's method: the distance of what is found from q, or
    // infinity as soon as it is seen that it will not be below `most`.
    double land(const double* q, const double* lo, const double* hi, double most, double* x) {
        const int n = d();
        double delta[kJoints] = {}, step[kJoints], along[kJoints], off[kJoints];
        double before = kInfinity;
        for (int iteration = 0; iteration < 40; iteration++) {
            for (int j = 0; j < n; j++) off[j] = x[j] - q[j];
            if (norm_of(off, n, largest_) >= most) return kInfinity;
            const double residual = evaluate(x);
            if (residual < 1e-15 || (residual <= kOn && residual > 0.5 * before)) break;
            if (residual > 0.7 * before) return kInfinity;
            before = residual;
            held_step(x, lo, hi, delta, 0.0, step, along);
            for (int j = 0; j < n; j++) x[j] = std::min(std::max(x[j] + step[j], lo[j]), hi[j]);
        }
        if (!(evaluate(x) <= kOn)) return kInfinity;
        for (int j = 0; j < n; j++) off[j] = x[j] - q[j];
        const double length = norm_of(off, n, largest_);
        return length < most ? length : kInfinity;
    }

    // From x to a point of the set within the box that is nearest to q, by Newton's method on the
    // equations and a pull towards q along them (or without it, to the set only). Returns the
    // distance, infinite without success. The pull ends at steps below `least`, whose square the
    // distance is off.
    double descend(const double* q, const double* lo, const double* hi, bool pull, double least,
                   double* x) {
        const int n = d();
        double delta[kJoints], step[kJoints], along[kJoints], before[kJoints] = {}, relax = 1.0;
        for (int iteration = pull ? 0 : 40; iteration < 60; iteration++) {
            const bool settling = iteration >= 40;
            for (int j = 0; j < n; j++) delta[j] = settling ? 0.0 : q[j] - x[j];
            const double residual = evaluate(x);
            held_step(x, lo, hi, delta, relax, step, along);
            if (largest_ && sums.size() == 1 && !settling)
                cube_step(q, lo, hi, x, relax, step, along);
            double turned = 0.0, size = 0.0;
            for (int j = 0; j < n; j++) turned += along[j] * before[j], before[j] = along[j];
            relax = turned < 0.0 ? 0.5 * relax : std::min(1.0, 1.1 * relax);
            for (int j = 0; j < n; j++) size = std::max(size, std::fabs(step[j]));
            if (settling && residual < 1e-15) break;
            const double shorter = size > 0.6 ? 0.6 / size : 1.0;
            for (int j = 0; j < n; j++)
                x[j] = std::min(std::max(x[j] + shorter * step[j], lo[j]), hi[j]);
            if (size < (settling ? 1e-13 : least)) {
                if (settling) break;
                iteration = 39;
            }
        }
        if (!(evaluate(x) <= kOn)) return kInfinity;
        double off[kJoints];
        for (int j = 0; j < n; j++) off[j] = x[j] - q[j];
        return norm_of(off, n, largest_);
    }

    std::vector<Sum::At> at;  // what was evaluated last

private:
    bool largest_;

    // In the maximum norm: to where the least cube around q meets the linearised equation at x,
    // whose value and gradient are in `at`.
    void cube_step(const double* q, const double* lo, const double* hi, const double* x,
                   double relax, double* step, double* along) const {
        const int n = d();
        const double* g = at[0].g;
        double here = at[0].value, from = 0.0, near[kJoints];
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
            if (std::fabs(g[j]) > 1e-9 * at[0].size)
                y = rises ? std::min(hi[j], std::max(q[j] + r, near[j]))
                          : std::max(lo[j], std::min(q[j] - r, near[j]));
            along[j] = y - x[j];
            step[j] = relax * along[j];
        }
    }
};

}  // namespace pinsing
