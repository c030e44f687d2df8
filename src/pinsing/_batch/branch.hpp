// The equations of one branch of a family: descents to their zeros, and how far from a configuration
// those within a box are at least, and where in the box they can be at all.
//
// In a box around c each equation is |f(c) + g (x - c)| <= rest, a slab, with the rest from Taylor's
// theorem. The distance to box and slab is a bound; and the box shrinks to what the slabs, and the
// ball of the best point known, leave of it.
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

struct Box {
    double c[kJoints], h[kJoints];  // centre and half-widths
    double low;                     // no zero in it is nearer
    double near[kJoints];           // where the nearest zero may be
    int widest;                     // the joint that adds most to what is not known
};

// The equations of one branch, in the joints that occur in them.
class Branch {
public:
    Branch(const Conditions& c, int branch)
        : first(c.equation_start[branch]),
          at(static_cast<std::size_t>(c.equation_start[branch + 1] - first)), c_(c) {
        int number[kJoints];
        std::fill(number, number + kJoints, -1);
        const auto numbered = [&](std::int64_t joint) {
            if (number[joint] < 0) {
                number[joint] = d();
                joints.push_back(static_cast<int>(joint));
            }
            return number[joint];
        };
        const std::int64_t term = c.term_start[first], last = c.term_start[c.equation_start[branch + 1]];
        for (auto k = c.rate_start[term]; k < c.rate_start[last]; k++)
            rate_joint_.push_back(numbered(c.rate_joint[k]));
        for (auto k = c.power_start[term]; k < c.power_start[last]; k++)
            power_joint_.push_back(numbered(c.power_joint[k]));
        own_ = {rate_joint_.data(), power_joint_.data(), c.rate_start[term], c.power_start[term]};
    }

    const std::int64_t first;  // of its equations
    std::vector<SumOnBox> at;  // what was evaluated last
    std::vector<int> joints;

    int d() const { return static_cast<int>(joints.size()); }

    // Equation i at x, within half-widths h unless that is null.
    const SumOnBox& look(std::size_t i, const double* x, const double* h) {
        look_at_sum(c_, first + static_cast<std::int64_t>(i), own_, x, h, d(), at[i]);
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
        for (SumOnBox& one : at)
            for (int j = 0; j < n; j++)
                if (!free[j]) one.g[j] = 0.0;
        if (at.size() == 1) {
            const double *g = at[0].g, square = dot(g, g, n), product = dot(g, delta, n);
            const bool flat = std::sqrt(square) <= 1e-10 * at[0].size;
            for (int j = 0; j < n; j++) {
                onto[j] = flat ? 0.0 : -at[0].value * g[j] / square;
                along[j] = free[j] ? delta[j] - (flat ? 0.0 : product * g[j] / square) : 0.0;
            }
            return;
        }
        double A[kJoints * kJoints] = {}, copy[kJoints * kJoints], across[kJoints];
        std::fill(onto, onto + n, 0.0);
        for (const SumOnBox& one : at) {
            const double scale = 1.0 / one.size;
            for (int i = 0; i < n; i++) {
                onto[i] -= one.g[i] * one.value * scale * scale;
                for (int j = 0; j < n; j++) A[i * n + j] += one.g[i] * one.g[j] * scale * scale;
            }
        }
        for (int i = 0; i < n; i++) across[i] = dot(A + i * n, delta, n);
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
        double delta[kJoints] = {}, step[kJoints], along[kJoints], before = kInfinity;
        for (int iteration = 0; iteration < 40; iteration++) {
            if (apart(q, x) >= most) return kInfinity;
            const double residual = evaluate(x);
            if (residual < 1e-15 || (residual <= kOn && residual > 0.5 * before)) break;
            if (residual > 0.7 * before) return kInfinity;
            before = residual;
            held_step(x, lo, hi, delta, 0.0, step, along);
            for (int j = 0; j < n; j++) x[j] = std::min(std::max(x[j] + step[j], lo[j]), hi[j]);
        }
        const double length = evaluate(x) <= kOn ? apart(q, x) : kInfinity;
        return length < most ? length : kInfinity;
    }

    // From x to a point of the set within the box that is nearest to q, by Newton's method on the equations
    // and a pull towards q along them, then to the set only. Returns the distance, infinite without
    // success. The pull ends at steps below `least`, whose square the distance is off.
    double descend(const double* q, const double* lo, const double* hi, double least, double* x) {
        const int n = d();
        double delta[kJoints], step[kJoints], along[kJoints], before[kJoints] = {}, relax = 1.0;
        for (int iteration = 0; iteration < 40; iteration++) {
            for (int j = 0; j < n; j++) delta[j] = q[j] - x[j];
            evaluate(x);
            held_step(x, lo, hi, delta, relax, step, along);
            if (c_.largest && at.size() == 1) cube_step(q, lo, hi, x, relax, step, along);
            double turned = 0.0, size = 0.0;
            for (int j = 0; j < n; j++) turned += along[j] * before[j], before[j] = along[j];
            relax = turned < 0.0 ? 0.5 * relax : std::min(1.0, 1.1 * relax);
            for (int j = 0; j < n; j++) size = std::max(size, std::fabs(step[j]));
            const double shorter = size > 0.6 ? 0.6 / size : 1.0;
            for (int j = 0; j < n; j++)
                x[j] = std::min(std::max(x[j] + shorter * step[j], lo[j]), hi[j]);
            if (size < least) break;
        }
        return land(q, lo, hi, kInfinity, x);
    }

    // Fills in low, near and widest, and shrinks the box; false where it holds no zero that is
    // nearer to q than `most`.
    bool bound(const double* q, double known, double most, Box& box) {
        const int n = d();
        double lo[kJoints], hi[kJoints], near[kJoints], bend[kJoints] = {};
        for (int j = 0; j < n; j++) {
            lo[j] = box.c[j] - box.h[j];
            hi[j] = box.c[j] + box.h[j];
            box.near[j] = near[j] = std::min(std::max(q[j], lo[j]), hi[j]);
        }
        box.low = std::max(known, apart(q, near) * (1.0 - 4e-15));
        for (std::size_t i = 0; i < at.size(); i++) {
            const SumOnBox& one = look(i, box.c, box.h);
            if (!of_slab(q, box, lo, hi, near, one.value, one.g, one.rest)) return false;
            double steep = 1e-300;
            for (int j = 0; j < n; j++) steep += std::fabs(one.g[j]) * box.h[j] + one.bend[j];
            for (int j = 0; j < n; j++) bend[j] = std::max(bend[j], one.bend[j] / steep);
        }
        if (at.size() > 1 && !of_combination(q, box, lo, hi, near)) return false;
        box.widest = 0;
        double top = -1.0;
        for (int j = 0; j < n; j++) {
            const double score = box.h[j] * (bend[j] + 1e-3);
            if (score > top) top = score, box.widest = j;
        }
        return box.low < most && shrink(q, most, lo, hi, box);
    }

private:
    const Conditions& c_;
    std::vector<int> rate_joint_, power_joint_;  // of rates and powers, as numbered in `joints`
    Joints<int> own_;

    double apart(const double* q, const double* x) const {
        double off[kJoints];
        for (int j = 0; j < d(); j++) off[j] = x[j] - q[j];
        return norm_of(off, d(), c_.largest);
    }

    // In the maximum norm: to where the least cube around q meets the linearised equation at x,
    // whose value and gradient are in `at`.
    void cube_step(const double* q, const double* lo, const double* hi, const double* x,
                   double relax, double* step, double* along) const {
        const int n = d();
        const double *g = at[0].g, a0 = at[0].value - dot(g, x, n);
        double point[kJoints];
        if (to_plane(q, lo, hi, g, a0, 0.0, n, true, point) == kInfinity) return;
        for (int j = 0; j < n; j++) {
            const bool moves = std::fabs(g[j]) > 1e-9 * at[0].size;
            along[j] = (moves ? point[j] : std::min(std::max(q[j], lo[j]), hi[j])) - x[j];
            step[j] = relax * along[j];
        }
    }

    bool of_slab(const double* q, Box& box, const double* lo, const double* hi, const double* near,
                 double value, const double* g, double rest) const {
        const int n = d();
        double reach = rest, a0 = value, here = value;
        for (int j = 0; j < n; j++) {
            reach += std::fabs(g[j]) * box.h[j];
            a0 -= g[j] * box.c[j];
            here += g[j] * (near[j] - box.c[j]);
        }
        if (std::fabs(value) > reach * (1.0 + 1e-14)) return false;
        if (std::fabs(here) <= rest) return true;
        const double target = here > 0.0 ? rest : -rest;
        double point[kJoints];
        const double bound = to_plane(q, lo, hi, g, a0, target, n, c_.largest, point);
        if (bound == kInfinity) return false;
        if (bound > box.low) {
            box.low = bound;
            std::copy(point, point + n, box.near);
        }
        return true;
    }

    // The slab of a sum of multiples of the equations, those of the least-norm step from `near`.
    bool of_combination(const double* q, Box& box, const double* lo, const double* hi,
                        const double* near) const {
        const int n = d();
        const int k = std::min<int>(static_cast<int>(at.size()), kMaxCombined);
        double y[kMaxCombined];
        for (int i = 0; i < k; i++) {
            y[i] = at[i].value;
            for (int j = 0; j < n; j++) y[i] += at[i].g[j] * (near[j] - box.c[j]);
        }
        least_norm([&](int i) { return at[i].g; }, k, n, y, 1e-13, 1e-15);
        double value = 0.0, rest = 0.0, size = 0.0, g[kJoints] = {};
        for (int i = 0; i < k; i++) {
            value += y[i] * at[i].value;
            rest += std::fabs(y[i]) * (at[i].rest + 1e-15 * at[i].size);
            size += std::fabs(y[i]) * at[i].size;
            for (int j = 0; j < n; j++) g[j] += y[i] * at[i].g[j];
        }
        if (!(size < 1e300)) return true;
        return of_slab(q, box, lo, hi, near, value, g, rest);
    }

    // Shrinks the box to what the slab of each equation and the ball of radius `most` around q
    // leave; false where that is nothing.
    bool shrink(const double* q, double most, double* lo, double* hi, Box& box) const {
        const int n = d();
        for (const SumOnBox& one : at) {
            double reach = 0.0;
            for (int j = 0; j < n; j++) reach += std::fabs(one.g[j]) * box.h[j];
            const double slack = one.rest + 4e-16 * (n + 4) * (std::fabs(one.value) + reach);
            for (int j = 0; j < n; j++) {
                const double g = std::fabs(one.g[j]), own = g * box.h[j];
                // g (x_j - c_j) lies within others + slack of -value.
                const double others = (reach - own) * (1.0 + 1e-14) + slack;
                if (!(std::fabs(one.value) + others < own * (1.0 - 1e-14) ||
                      others - std::fabs(one.value) < own * (1.0 - 1e-14)))
                    continue;
                const double middle = -one.value / one.g[j], half = others / g;
                if (!(std::fabs(middle) < 1e200) || !(half < 1e200)) continue;
                const double edge = 1e-15 * (std::fabs(box.c[j]) + std::fabs(middle) + half);
                lo[j] = std::max(lo[j], box.c[j] + middle - half - edge);
                hi[j] = std::min(hi[j], box.c[j] + middle + half + edge);
                if (lo[j] > hi[j]) return false;
            }
        }
        if (most < kInfinity) {
            double off[kJoints];
            for (int j = 0; j < n; j++) off[j] = std::min(std::max(q[j], lo[j]), hi[j]) - q[j];
            const double total = dot(off, off, n);
            for (int j = 0; j < n; j++) {
                double room = most;
                if (!c_.largest) {
                    const double square = most * most - (total - off[j] * off[j]);
                    room = std::sqrt(std::max(square + 4e-15 * most * most, 0.0));
                }
                room = room * (1.0 + 4e-15) + 1e-15 * std::fabs(q[j]);
                lo[j] = std::max(lo[j], q[j] - room);
                hi[j] = std::min(hi[j], q[j] + room);
                if (lo[j] > hi[j]) return false;
            }
        }
        for (int j = 0; j < n; j++) {
            const double edge = 2.3e-16 * (std::fabs(lo[j]) + std::fabs(hi[j]));
            box.c[j] = 0.5 * (lo[j] + hi[j]);
            box.h[j] = 0.5 * (hi[j] - lo[j]) * (1.0 + 1e-15) + edge;
        }
        return true;
    }
};

}  // namespace pinsing
