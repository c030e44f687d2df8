// The nearest point of a set of conditions, with a proof: best-first branch and bound.
//
// A box around c keeps the greatest of two bounds: the distance to the box, and that to the part of
// it where the linearised equation can be zero at all, |f(c) + g (x - c)| <= rest, with the rest
// from Taylor's theorem. The second makes the gap shrink with the square of the box, so that few
// boxes are left around the nearest point. Several equations are bounded one by one and combined,
// with the multiples of the least-norm step.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <queue>
#include <utility>
#include <vector>

#include "branch.hpp"
#include "proximity.hpp"

namespace pinsing {
namespace {

using Clock = std::chrono::steady_clock;

class Search {
public:
    Search(const Conditions& c, const SearchOptions& options)
        : c_(c), o_(options), end_(Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                                      std::chrono::duration<double>(
                                                          std::min(options.seconds, 1e6)))) {}

    Nearest run(const double* x, double* point) {
        struct Candidate {
            double fixed;
            int branch;
        };
        std::vector<Candidate> order;
        std::vector<double> target(static_cast<std::size_t>(c_.n));
        for (int b = 0; b < c_.branches; b++) {
            const double fixed = put(b, x, target.data());
            if (fixed < kInfinity) order.push_back({fixed, b});
        }
        std::sort(order.begin(), order.end(),
                  [](const Candidate& a, const Candidate& b) { return a.fixed < b.fixed; });
        Nearest best{kInfinity, kInfinity, -1, 0};
        for (const Candidate& candidate : order) {
            const int b = candidate.branch;
            if (candidate.fixed >= best.upper) {
                best.lower = std::min(best.lower, std::max(candidate.fixed - slack_, 0.0));
                continue;
            }
            put(b, x, target.data());
            if (c_.equation_start[b + 1] == c_.equation_start[b]) {
                best.upper = candidate.fixed;
                best.family = c_.family[b];
                std::copy(target.begin(), target.end(), point);
                best.lower = std::min(best.lower, std::max(candidate.fixed - slack_, 0.0));
                continue;
            }
            within(b, x, candidate.fixed, target.data(), point, best);
        }
        best.lower = std::min(best.lower, best.upper);
        return best;
    }

private:
    const Conditions& c_;
    const SearchOptions& o_;
    Clock::time_point end_;
    double slack_ = 0.0;

    bool over(std::int64_t boxes) const {
        return boxes >= o_.boxes || (boxes % 64 == 0 && Clock::now() > end_);
    }

    // x with the joints of a branch at their values, the nearest copies; their distance.
    double put(int b, const double* x, double* target) {
        double off[kJoints];
        int count = 0;
        std::copy(x, x + c_.n, target);
        double size = 1.0;
        for (std::int64_t i = c_.value_start[b]; i < c_.value_start[b + 1]; i++) {
            const std::int64_t j = c_.value_joint[i];
            const double turn = c_.turn[j], tolerance = 1e-9;
            double value = c_.value[i];
            if (turn > 0.0) value += turn * std::round((x[j] - value) / turn);
            if (o_.limited) {
                if (turn > 0.0) {
                    while (value > o_.upper[j] + tolerance) value -= turn;
                    while (value < o_.lower[j] - tolerance) value += turn;
                }
                if (value > o_.upper[j] + tolerance || value < o_.lower[j] - tolerance)
                    return kInfinity;
            }
            target[j] = value;
            off[count++] = value - x[j];
            size = std::max(size, std::fabs(x[j]) + std::fabs(value));
        }
        slack_ = 1e-15 * size * (count + 1);
        return norm_of(off, count, c_.largest);
    }

    void within(int b, const double* x, double fixed, const double* target, double* point,
                Nearest& best) {
        Branch branch(c_, b);
        const int d = branch.d();
        const bool largest = c_.largest;
        double q[kJoints], lo[kJoints], hi[kJoints], start[kJoints];
        bool cut = false;  // by `far`, which no limit bounds
        for (int j = 0; j < d; j++) {
            const int joint = branch.joints[j];
            q[j] = x[joint];
            const double turn = c_.turn[joint];
            const double reach = turn > 0.0 ? 0.5 * turn : o_.far;
            const bool below = o_.limited && o_.lower[joint] > -kInfinity;
            const bool above = o_.limited && o_.upper[joint] < kInfinity;
            lo[j] = below ? o_.lower[joint] : q[j] - reach;
            hi[j] = above ? o_.upper[joint] : q[j] + reach;
            if (below && !above) hi[j] = std::max(q[j], lo[j]) + (turn > 0.0 ? turn : reach);
            if (above && !below) lo[j] = std::min(q[j], hi[j]) - (turn > 0.0 ? turn : reach);
            cut = cut || (turn == 0.0 && !(below && above));
        }
        double part = part_of(best.upper, fixed, largest);  // best so far, in these joints
        auto once = [&](double* from, bool pull) {
            const double length = branch.descend(q, lo, hi, pull, from);
            if (!(length < part)) return;
            double proven = length;
            if (branch.sums.size() == 1) {
                // A zero surely is as near as this, though the point is on it to rounding only.
                const Sum::At& at = branch.first_at(from);
                const double m = norm_of(at.g, d, false) - at.error * (1.0 + branch.sums[0].reach);
                const double off = std::fabs(at.value) + at.error;
                if (m > 0.0 && m * m > 8.0 * branch.sums[0].curvature * off &&
                    !branch.sums[0].sliding)
                    proven += 2.0 * off / m;
            }
            if (!(proven < part)) return;
            part = proven;
            best.upper = joined(fixed, part, largest) * (1.0 + 1e-15);
            best.family = c_.family[b];
            std::copy(target, target + c_.n, point);
            for (int j = 0; j < d; j++) point[branch.joints[j]] = from[j];
        };
        auto attempt = [&](double* from) {
            if (largest) {  // its nearest point may lie where no pull rests
                double copy[kJoints];
                std::copy(from, from + d, copy);
                once(copy, false);
            }
            once(from, true);
        };
        for (int j = 0; j < d; j++) start[j] = std::min(std::max(q[j], lo[j]), hi[j]);
        attempt(start);

        // Boxes: centre and half-widths one after the other; the heap knows them by number.
        std::vector<double> boxes;
        using Entry = std::pair<double, std::int64_t>;
        std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> heap;
        auto add = [&](const double* c, const double* h, double low) {
            const std::int64_t number = static_cast<std::int64_t>(boxes.size()) / (2 * d);
            boxes.insert(boxes.end(), c, c + d);
            boxes.insert(boxes.end(), h, h + d);
            heap.emplace(low, number);
        };
        double c[kJoints], h[kJoints], beyond = kInfinity;
        bool empty = false;
        for (int j = 0; j < d; j++) {
            double from = lo[j], to = hi[j];
            if (part < kInfinity) {  // what lies farther away is of no use
                from = std::max(from, q[j] - part);
                to = std::min(to, q[j] + part);
            } else if (cut) {
                beyond = o_.far;
            }
            empty = empty || from > to;
            c[j] = 0.5 * (from + to);
            h[j] = 0.5 * (to - from) * (1.0 + 1e-15);
        }
        double proven = kInfinity;  // least bound of a box that was put aside
        std::int64_t seen = 0;
        if (!empty) add(c, h, branch.bound(q, c, h, 0.0));
        while (!heap.empty()) {
            const Entry top = heap.top();
            if (top.first >= part - 0.5 * o_.gap) break;
            if (over(best.boxes)) break;
            heap.pop();
            double parent[2 * kJoints];
            std::memcpy(parent, &boxes[static_cast<std::size_t>(top.second * 2 * d)],
                        sizeof(double) * static_cast<std::size_t>(2 * d));
            int widest = 0;
            for (int j = 1; j < d; j++)
                if (parent[d + j] > parent[d + widest]) widest = j;
            if (parent[d + widest] < 1e-13) {  // rounding: nothing more can be told
                proven = std::min(proven, top.first);
                continue;
            }
            for (int side = 0; side < 2; side++) {
                std::copy(parent, parent + d, c);
                std::copy(parent + d, parent + 2 * d, h);
                h[widest] *= 0.5;
                c[widest] += side == 0 ? -h[widest] : h[widest];
                h[widest] *= 1.0 + 4e-16;
                best.boxes++;
                seen++;
                const double low = branch.bound(q, c, h, top.first);
                if (low == kInfinity) continue;
                if (low < part - 0.5 * o_.gap &&
                    (part == kInfinity || (h[widest] < 0.4 && (seen % 7 == 0 || largest || low < 0.5 * part)))) {
                    std::copy(c, c + d, start);
                    attempt(start);
                }
                if (low >= part - 0.5 * o_.gap) {
                    proven = std::min(proven, low);
                } else {
                    add(c, h, low);
                }
            }
        }
        if (!heap.empty()) proven = std::min(proven, heap.top().first);
        proven = std::min({proven, part, beyond});
        if (proven == kInfinity) return;  // no zero within the limits
        const double low = joined(std::max(fixed - slack_, 0.0), proven, largest);
        best.lower = std::min(best.lower, std::max(low * (1.0 - 4e-15), 0.0));
    }
};

}  // namespace

Nearest nearest_condition(const Conditions& c, const SearchOptions& options, const double* x,
                          double* point) {
    return Search(c, options).run(x, point);
}

}  // namespace pinsing
