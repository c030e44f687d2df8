// How far from a configuration the zeros of a branch within a box are at least, and where in the
// box they can be at all.
//
// In a box around c each equation is |f(c) + g (x - c)| <= rest, a slab, with the rest from Taylor's
// theorem. The distance to box and slab is a bound; and the box shrinks to what the slabs, and the
// ball of the best point known, leave of it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "branch.hpp"

namespace pinsing {

struct Box {
    double c[kJoints], h[kJoints];  // centre and half-widths
    double low;                     // no zero in it is nearer
    double near[kJoints];           // where the nearest zero may be
    int widest;                     // the joint that adds most to what is not known
};

class BoxBound {
public:
    explicit BoxBound(Branch& branch, bool largest) : b_(branch), largest_(largest) {}

    // Fills in low, near and widest, and shrinks the box; false where it holds no zero that is
    // nearer to q than `most`.
    bool look(const double* q, double known, double most, Box& box) {
        const int n = b_.d();
        double lo[kJoints], hi[kJoints], near[kJoints], off[kJoints];
        for (int j = 0; j < n; j++) {
            lo[j] = box.c[j] - box.h[j];
            hi[j] = box.c[j] + box.h[j];
            near[j] = std::min(std::max(q[j], lo[j]), hi[j]);
            off[j] = near[j] - q[j];
        }
        box.low = std::max(known, norm_of(off, n, largest_) * (1.0 - 4e-15));
        std::copy(near, near + n, box.near);
        double bend[kJoints] = {};
        for (std::size_t i = 0; i < b_.at.size(); i++) {
            const SumAt& one = b_.look(i, box.c, box.h);
            if (!of_slab(q, box, lo, hi, near, one.value, one.g, one.rest)) return false;
            double steep = 1e-300;
            for (int j = 0; j < n; j++) steep += std::fabs(one.g[j]) * box.h[j] + one.bend[j];
            for (int j = 0; j < n; j++) bend[j] = std::max(bend[j], one.bend[j] / steep);
        }
        if (b_.at.size() > 1 && !of_combination(q, box, lo, hi, near)) return false;
        box.widest = 0;
        double top = -1.0;
        for (int j = 0; j < n; j++) {
            const double score = box.h[j] * (bend[j] + 1e-3);
            if (score > top) top = score, box.widest = j;
        }
        return box.low < most && shrink(q, most, lo, hi, box);
    }

private:
    Branch& b_;
    bool largest_;

    bool of_slab(const double* q, Box& box, const double* lo, const double* hi, const double* near,
                 double value, const double* g, double rest) const {
        const int n = b_.d();
        double reach = rest, a0 = value, here = value;
        for (int j = 0; j < n; j++) {
            reach += std::fabs(g[j]) * box.h[j];
            a0 -= g[j] * box.c[j];
            here += g[j] * (near[j] - box.c[j]);
        }
        if (std::fabs(value) > reach * (1.0 + 1e-14)) return false;
        if (std::fabs(here) <= rest) return true;
        const double target = here > 0.0 ? rest : -rest;
        double point[kJoints], bound;
        if (largest_) {
            const bool upward = here < 0.0;
            const double r = cube_to_plane(q, lo, hi, g, near, std::fabs(here - target), n, upward);
            if (r == kInfinity) return false;
            for (int j = 0; j < n; j++)
                point[j] = cube_side(q[j], near[j], lo[j], hi[j], r, (g[j] > 0.0) == upward);
            bound = std::max(r * (1.0 - 1e-12) - 1e-13, 0.0);
        } else {
            bound = to_plane(q, lo, hi, g, a0, target, n, point);
            if (bound == kInfinity) return false;
        }
        if (bound > box.low) {
            box.low = bound;
            std::copy(point, point + n, box.near);
        }
        return true;
    }

    // The slab of a sum of multiples of the equations, those of the least-norm step from `near`.
    bool of_combination(const double* q, Box& box, const double* lo, const double* hi,
                        const double* near) const {
        const int n = b_.d();
        const int k = std::min<int>(static_cast<int>(b_.at.size()), kMaxCombined);
        const std::vector<SumAt>& at = b_.at;
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
        const int n = b_.d();
        for (const SumAt& one : b_.at) {
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
            double off[kJoints], total = 0.0;
            for (int j = 0; j < n; j++) {
                off[j] = std::min(std::max(q[j], lo[j]), hi[j]) - q[j];
                total += off[j] * off[j];
            }
            for (int j = 0; j < n; j++) {
                double room = most;
                if (!largest_) {
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
