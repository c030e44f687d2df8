// Sums of cosines on boxes, and the geometry of boxes, planes and cubes.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "conditions.hpp"
#include "numbers.hpp"

namespace pinsing {

constexpr int kJoints = kMaxConditionJoints;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

#include "least_norm.hpp"
#include "sums.hpp"

inline double norm_of(const double* x, int d, bool largest) {
    if (!largest) return std::sqrt(dot(x, x, d));
    double most = 0.0;
    for (int j = 0; j < d; j++) most = std::max(most, std::fabs(x[j]));
    return most;
}

inline double joined(double x, double y, bool largest) {
    return largest ? std::max(x, y) : std::hypot(x, y);
}

// What of a distance is left for the equations, beside that of the values.
inline double part_of(double whole, double fixed, bool largest) {
    if (whole == kInfinity) return kInfinity;
    if (largest) return fixed < whole ? whole : -1.0;
    return fixed < whole ? std::sqrt((whole - fixed) * (whole + fixed)) : -1.0;
}

// An equation with its gradient, and on a box what its linear approximation may be off.
struct SumOnBox : SumAt<double> {
    double size, rest;  // size: of its terms, lengths below one taken as one
    double g[kJoints];
    double bend[kJoints];  // how much each joint adds to the rest
};

// Equation e at x (d,), in a box of half-widths h unless that is null.
template <class Number>
void look_at_sum(const Conditions& c, std::int64_t e, Joints<Number> joints, const double* x, const double* h,
                 int d, SumOnBox& out) {
    double rest = 0.0, size = 0.0;
    std::fill(out.g, out.g + d, 0.0);
    std::fill(out.bend, out.bend + (h != nullptr ? d : 0), 0.0);
    const auto of_term = [&](std::int64_t t, double sine, double cosine) __attribute__((always_inline)) {
        double magnitude = std::fabs(c.amplitude[t]), largest = magnitude;
        double swing = 0.0, first = 0.0, squares = 0.0;
        const auto widened = [&](std::int64_t k) {
            const std::int64_t j = joints.of_power(k);
            return std::max(std::fabs(x[j]) + (h != nullptr ? h[j] : 0.0), 1e-150);
        };
        for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++)
            magnitude *= std::max(widened(k), 1.0);
        size += magnitude;
        if (h == nullptr) return;
        const auto share = [&](std::int64_t k) { return h[joints.of_power(k)] / widened(k); };
        for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++) {
            largest *= widened(k);
            first += share(k);
            squares += share(k) * share(k);
        }
        for (std::int64_t k = c.rate_start[t]; k < c.rate_start[t + 1]; k++)
            swing += std::fabs(c.rate[k]) * h[joints.of_rate(k)];
        // Second derivatives of p cos: p'' cos - 2 p' sin - p cos; the angle is within
        // `swing` of its value at the middle, so |cos| and |sin| are within `swing` too.
        const double even = std::min(std::fabs(cosine) + swing, 1.0);
        const double odd = std::min(std::fabs(sine) + swing, 1.0);
        rest += 0.5 * largest *
                (even * (swing * swing + std::max(first * first - squares, 0.0)) + odd * 2.0 * swing * first);
        for (std::int64_t k = c.rate_start[t]; k < c.rate_start[t + 1]; k++)
            out.bend[joints.of_rate(k)] += largest * std::fabs(c.rate[k]) * h[joints.of_rate(k)] *
                                           (even * swing + odd * first);
        for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++)
            out.bend[joints.of_power(k)] += largest * share(k) * (odd * swing + even * first);
    };
    static_cast<SumAt<double>&>(out) = sum_at(c, e, joints, x, out.g, of_term);
    out.size = size;
    out.error = size * out.relative;
    out.rest = rest * (1.0 + 1e-12) + 2.0 * out.error;
}

// A bound of the distance from q to {x in the box: a0 + g x = target}, infinite where that is empty.
//
// The points of the box that reach the most by s are q + s w, cut to it, with w = g, toward the target, or
// in the maximum norm the signs of g. Where they reach the target is the root of a sum that changes with s,
// in pieces: Newton's method between bounds. How exact it is does not matter to the truth: for any s, weak
// duality gives
//     distance^2 >= min over y in the box of |y - q|^2 + 2 s (what y misses of the target),
// whose minimiser is that point, and no cube of half-side s that misses something reaches the target. The
// last of the points goes to `point`.
inline double to_plane(const double* q, const double* lo, const double* hi, const double* g, double a0,
                       double target, int d, bool largest, double* point) {
    double least = a0, most = a0, size = std::fabs(a0) + std::fabs(target), steep = 0.0, outside = 0.0;
    for (int j = 0; j < d; j++) {
        least += std::min(g[j] * lo[j], g[j] * hi[j]);
        most += std::max(g[j] * lo[j], g[j] * hi[j]);
        size += std::fabs(g[j]) * std::max(std::fabs(lo[j]), std::fabs(hi[j]));
        steep = std::max(steep, std::fabs(g[j]));
        if (largest) outside = std::max({outside, lo[j] - q[j], q[j] - hi[j]});
    }
    const double tolerance = 4e-16 * (d + 2) * size, aim = largest ? 0.5 * tolerance : 0.0;
    if (target < least - tolerance || target > most + tolerance) return kInfinity;
    double best = 0.0, low = 0.0, high = kInfinity, side = 0.0, at = 0.0;
    for (int iteration = 0; iteration <= 60; iteration++) {
        double sum = a0, total = 0.0, slope = 0.0;
        for (int j = 0; j < d; j++) {
            const double way = !largest ? g[j] : g[j] > 0.0 ? 1.0 : -1.0;
            const double z = q[j] - side * at * way, y = std::min(std::max(z, lo[j]), hi[j]);
            point[j] = y;
            sum += g[j] * y;
            total += (y - q[j]) * (y - q[j]);
            if (z > lo[j] && z < hi[j]) slope += g[j] * way;
        }
        if (iteration == 0) side = sum > target ? 1.0 : -1.0;
        const double excess = side * (sum - target);
        const double square = total * (1.0 - 1e-15) + 2.0 * at * (excess - tolerance);
        if (largest && excess > 0.5 * aim) best = std::max(best, at * (1.0 - 1e-12) - 1e-13);
        if (!largest && square > 0.0) best = std::max(best, std::sqrt(square) * (1.0 - 1e-15));
        if (std::fabs(excess) <= tolerance) break;
        (excess > 0.0 ? low : high) = at;
        double next = slope > 0.0 ? at + (excess - aim) / slope : kInfinity;
        if (at < outside) next = outside;  // smaller cubes do not reach the box
        if (!(next > low && next < high))
            next = high < kInfinity ? 0.5 * (low + high) : 2.0 * at + 0.5 / steep;
        if (next == at || !(next < 1e200)) break;
        at = next;
    }
    return best;
}

}  // namespace pinsing
