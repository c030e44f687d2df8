// The nearest point of a set of conditions, with a proof: best-first branch and bound.
//
// The box with the least bound is looked at first: from where its nearest zero may be, Newton's method
// goes to a point of the set, which is the nearest one known if that is nearer; then it is halved.
// Bounds and points differ by the square of a box, so that few boxes are left around the nearest
// point, at joint limits as well.
#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <utility>
#include <vector>

#include "box_bound.hpp"
#include "proximity.hpp"

namespace pinsing {
namespace {

constexpr double kTolerance = 1e-9;  // by which a joint's value may be outside its limits

class Search {
public:
    Search(const Conditions& c, const SearchOptions& options)
        : c_(c), o_(options) {
        if (o_.limited) note_involved();
    }

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
    std::vector<bool> involved_;  // joints of each branch that occur in equations
    double slack_ = 0.0;

    // x with the joints of a branch at their values, the nearest copies, and those that do not
    // matter within their limits; how far that is.
    double put(int b, const double* x, double* target) {
        double off[kJoints];
        const double* lower = o_.lower + c_.family[b] * o_.stride;
        const double* upper = o_.upper + c_.family[b] * o_.stride;
        std::copy(x, x + c_.n, target);
        if (o_.limited) {
            for (int j = 0; j < c_.n; j++)
                if (!involved_[static_cast<std::size_t>(b * c_.n + j)])
                    target[j] = std::min(std::max(x[j], lower[j]), upper[j]);
        }
        for (std::int64_t i = c_.value_start[b]; i < c_.value_start[b + 1]; i++) {
            const std::int64_t j = c_.value_joint[i];
            const double turn = c_.turn[j], low = lower[j] - kTolerance, high = upper[j] + kTolerance;
            double value = c_.value[i];
            if (turn > 0.0) {
                value += turn * std::round((x[j] - value) / turn);
                if (o_.limited && value > high) value -= turn * std::ceil((value - high) / turn);
                if (o_.limited && value < low) value += turn * std::ceil((low - value) / turn);
            }
            if (o_.limited && !(value <= high && value >= low)) return kInfinity;
            target[j] = value;
        }
        double size = 1.0;
        int count = 0;
        for (int j = 0; j < c_.n; j++) {
            off[j] = target[j] - x[j];
            if (off[j] == 0.0) continue;
            count++;
            size = std::max(size, std::fabs(x[j]) + std::fabs(target[j]));
        }
        slack_ = 1e-15 * size * (count + 1);
        return norm_of(off, c_.n, c_.largest);
    }

    void note_involved() {
        involved_.assign(static_cast<std::size_t>(c_.branches * c_.n), false);
        for (int b = 0; b < c_.branches; b++) {
            auto mark = [&](std::int64_t j) { involved_[static_cast<std::size_t>(b * c_.n + j)] = true; };
            const std::int64_t first = c_.term_start[c_.equation_start[b]];
            const std::int64_t last = c_.term_start[c_.equation_start[b + 1]];
            for (auto k = c_.rate_start[first]; k < c_.rate_start[last]; k++) mark(c_.rate_joint[k]);
            for (auto k = c_.power_start[first]; k < c_.power_start[last]; k++)
                mark(c_.power_joint[k]);
        }
    }

    void within(int b, const double* x, double fixed, const double* target, double* point,
                Nearest& best) {
        Branch branch(c_, b);
        BoxBound bound(branch, c_.largest);
        const int d = branch.d();
        const bool largest = c_.largest;
        double q[kJoints], lo[kJoints], hi[kJoints], start[kJoints];
        const bool cut = ranges(b, branch, x, q, lo, hi);
        double part = part_of(best.upper, fixed, largest);  // best so far, in these joints
        // A bound from which on nothing more is to be known.
        auto goal = [&]() {
            if (best.upper == kInfinity) return kInfinity;
            const double whole = best.upper - 0.5 * o_.gap;
            return whole <= fixed ? -1.0 : part_of(whole, fixed, largest);
        };
        auto keep = [&](const double* found, double length) {
            const double proven = length + missing(branch, found, length);
            if (!(proven < part)) return false;
            part = proven;
            best.upper = joined(fixed, part, largest) * (1.0 + 1e-15);
            best.family = c_.family[b];
            std::copy(target, target + c_.n, point);
            for (int j = 0; j < d; j++) point[branch.joints[j]] = found[j];
            return true;
        };
        const double least = std::max(1e-13, 0.1 * o_.gap * o_.gap);
        auto attempt = [&](const double* from) {
            double copy[kJoints];
            for (int way = largest ? 0 : 1; way < 2; way++) {  // no pull rests where cubes touch
                std::copy(from, from + d, copy);
                const double length = branch.descend(q, lo, hi, way == 1, least, copy);
                if (length < part) keep(copy, length);
            }
        };
        for (int j = 0; j < d; j++) start[j] = std::min(std::max(q[j], lo[j]), hi[j]);
        attempt(start);

        // Boxes wait in a heap by their bounds; those that were taken out leave their place.
        std::vector<Box> boxes;
        std::vector<std::size_t> places;
        using Entry = std::pair<double, std::size_t>;
        std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> heap;
        double proven = kInfinity;  // least bound of a box that was put aside
        auto add = [&](const Box& box) {
            if (box.low >= goal()) {
                proven = std::min(proven, box.low);
                return;
            }
            if (places.empty()) {
                heap.emplace(box.low, boxes.size());
                boxes.push_back(box);
            } else {
                heap.emplace(box.low, places.back());
                boxes[places.back()] = box;
                places.pop_back();
            }
        };
        Box box;
        double beyond = kInfinity;
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
            box.c[j] = 0.5 * (from + to);
            box.h[j] = 0.5 * (to - from) * (1.0 + 1e-15) + 2.3e-16 * (std::fabs(from) + std::fabs(to));
        }
        if (!empty && bound.look(q, 0.0, part, box)) add(box);
        for (std::int64_t turn = 0; !heap.empty(); turn++) {
            const Entry top = heap.top();
            if (top.first >= goal() || best.boxes >= o_.boxes) break;
            heap.pop();
            const Box parent = boxes[top.second];
            places.push_back(top.second);
            if (!(largest && part <= fixed)) {
                std::copy(parent.near, parent.near + d, start);
                const double length = branch.land(q, lo, hi, part, start);
                if (length < kInfinity && keep(start, length)) attempt(start);
                // Where Newton's method fails, as at double zeros, a longer way may do.
                else if (turn % 64 == 63) attempt(parent.c);
            }
            if (parent.low >= goal() || parent.h[parent.widest] < 1e-13) {
                proven = std::min(proven, parent.low);  // by rounding, nothing more can be told
                continue;
            }
            for (int side = 0; side < 2; side++) {
                box = parent;
                const int w = parent.widest;
                box.h[w] *= 0.5;
                box.c[w] += side == 0 ? -box.h[w] : box.h[w];
                box.h[w] *= 1.0 + 4e-16;
                best.boxes++;
                if (bound.look(q, parent.low, part, box)) add(box);
            }
        }
        if (!heap.empty()) proven = std::min(proven, heap.top().first);
        proven = std::min({proven, part, beyond});
        if (proven == kInfinity) return;  // no zero within the limits
        const double low = joined(std::max(fixed - slack_, 0.0), proven, largest);
        best.lower = std::min(best.lower, std::max(low * (1.0 - 4e-15), 0.0));
    }

    // The joints of a branch, and from where to where they are looked at; whether that is less
    // than where its points count.
    bool ranges(int b, const Branch& branch, const double* x, double* q, double* lo,
                double* hi) const {
        const double* lower = o_.lower + c_.family[b] * o_.stride;
        const double* upper = o_.upper + c_.family[b] * o_.stride;
        bool cut = false;
        for (int j = 0; j < branch.d(); j++) {
            const int joint = branch.joints[j];
            q[j] = x[joint];
            const double turn = c_.turn[joint];
            const double reach = turn > 0.0 ? 0.5 * turn : o_.far;
            const bool below = o_.limited && lower[joint] > -kInfinity;
            const bool above = o_.limited && upper[joint] < kInfinity;
            lo[j] = below ? lower[joint] : q[j] - reach;
            hi[j] = above ? upper[joint] : q[j] + reach;
            if (below && !above) hi[j] = std::max(q[j], lo[j]) + (turn > 0.0 ? turn : reach);
            if (above && !below) lo[j] = std::min(q[j], hi[j]) - (turn > 0.0 ? turn : reach);
            cut = cut || (turn == 0.0 && !(below && above));
        }
        return cut;
    }

    // How much farther than a point that is on the set to rounding a zero surely is at most.
    double missing(Branch& branch, const double* x, double length) const {
        const std::int64_t e = branch.first;
        if (branch.at.size() != 1 || c_.sliding[e] || length <= 0.0) return 0.0;
        branch.evaluate(x);
        const SumAt& at = branch.at[0];
        const double m = norm_of(at.g, branch.d(), false) - at.error * (1.0 + c_.reach[e]);
        const double off = std::fabs(at.value) + at.error;
        const bool sure = m > 0.0 && m * m > 8.0 * c_.curvature[e] * off;
        return sure ? 2.0 * off / m : 0.0;
    }
};

}  // namespace

Nearest nearest_condition(const Conditions& c, const SearchOptions& options, const double* x,
                          double* point) {
    return Search(c, options).run(x, point);
}

}  // namespace pinsing
