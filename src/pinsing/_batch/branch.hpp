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
constexpr double kRidge = 1e-13;  // of a trace: damps directions in which equations do not change

// The equations of one branch, in the joints that occur in them.
class Branch {
public:
    Branch(const Conditions& c, int branch)
        : first(c.equation_start[branch]),
          at(static_cast<std::size_t>(c.equation_start[branch + 1] - first)), c_(c),
          largest_(c.largest) {
        int number[kJoints];
        std::fill(number, number + kJoints, -1);
        const auto numbered = [&](std::int64_t joint) {
            if (number[joint] < 0) {
                number[joint] = d();
                joints.push_back(static_cast<int>(joint));
            }
            return number[joint];
        };
        for (std::int64_t t = c.term_start[first]; t < c.term_start[c.equation_start[branch + 1]]; t++) {
            for (auto k = c.rate_start[t]; k < c.rate_start[t + 1]; k++)
                rate_joint_.push_back(numbered(c.rate_joint[k]));
            for (auto k = c.power_start[t]; k < c.power_start[t + 1]; k++)
                power_joint_.push_back(numbered(c.power_joint[k]));
        }
    }

    const std::int64_t first;  // of its equations
    std::vector<SumAt> at;     // what was evaluated last
    std::vector<int> joints;

    int d() const { return static_cast<int>(joints.size()); }

    // Equation i at x, within half-widths h unless that is null.
    const SumAt& look(std::size_t i, const double* x, const double* h) {
        const std::int64_t e = first + static_cast<std::int64_t>(i);
        const std::int64_t begin = c_.term_start[first], t = c_.term_start[e];
        look_at_sum(c_, e, rate_joint_.data() + (c_.rate_start[t] - c_.rate_start[begin]),
                    power_joint_.data() + (c_.power_start[t] - c_.power_start[begin]), x, h, d(), at[i]);
        return at[i];
    }

    // Values and gradients at x; the largest value over its equation's size.
    double evaluate(const double* x) {
        double residual = 0.0;
        for (std::size_t i = 0; i < at.size(); i++) {
            const double value = std::fabs(look(i, x, nullptr).value);
            const double unit = std::max(1.0, c_.noise[first + static_cast<std::int64_t>(i)] * 1e13);
            residual = std::max(residual, value / (at[i].size * unit));
        }
        return residual;
    }

    // Minimum-norm step onto the linearised equations where they were evaluated, among `free`
    // joints, and what of `delta` lies along them.
    void steps(const bool* free, const double* delta, double* onto, double* along) {
        const int n = d();
        for (SumAt& one : at)
            for (int j = 0; j < n; j++)
                if (!free[j]) one.g[j] = 0.0;
        if (at.size() == 1) {
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
        double A[kJoints * kJoints] = {}, copy[kJoints * kJoints];
        std::fill(onto, onto + n, 0.0);
        for (const SumAt& one : at) {
            const double scale = 1.0 / one.size;
            for (int i = 0; i < n; i++) {
                onto[i] -= one.g[i] * one.value * scale * scale;
                for (int j = 0; j < n; j++) A[i * n + j] += one.g[i] * one.g[j] * scale * scale;
            }
        }
        double across[kJoints] = {};
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) across[i] += A[i * n + j] * delta[j];
        std::copy(A, A + n * n, copy);
        solve_spd(A, onto, n, kRidge, 0.1 * kRidge);
        solve_spd(copy, across, n, kRidge, 0.1 * kRidge);
        for (int j = 0; j < n; j++) {
            if (!free[j]) onto[j] = 0.0;
            along[j] = free[j] ? delta[j] - across[j] : 0.0;
        }
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
            if (largest_ && at.size() == 1 && !settling)
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

private:
    const Conditions& c_;
    bool largest_;
    std::vector<int> rate_joint_, power_joint_;  // of rates and powers, as numbered in `joints`

    // In the maximum norm: to where the least cube around q meets the linearised equation at x,
    // whose value and gradient are in `at`.
    void cube_step(const double* q, const double* lo, const double* hi, const double* x,
                   double relax, double* step, double* along) const {
        const int n = d();
        const double* g = at[0].g;
        double here = at[0].value, near[kJoints];
        for (int j = 0; j < n; j++) {
            near[j] = std::min(std::max(q[j], lo[j]), hi[j]);
            here += g[j] * (near[j] - x[j]);
        }
        const bool upward = here < 0.0;
        const double r = cube_to_plane(q, lo, hi, g, near, std::fabs(here), n, upward);
        if (r == kInfinity) return;
        for (int j = 0; j < n; j++) {
            const bool moves = std::fabs(g[j]) > 1e-9 * at[0].size, up = (g[j] > 0.0) == upward;
            along[j] = (moves ? cube_side(q[j], near[j], lo[j], hi[j], r, up) : near[j]) - x[j];
            step[j] = relax * along[j];
        }
    }
};

}  // namespace pinsing
