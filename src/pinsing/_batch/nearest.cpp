// The nearest point of a set of conditions, with a proof: best-first branch and bound.
//
// Boxes of all branches wait in one heap, so that where their number ends the bound is that of the
// nearest one left. The box with the least bound is looked at first: from where its nearest zero may
// be, Newton's method goes to a point of the set, which is the nearest one known if that is nearer;
// then it is halved. Bounds and points differ by the square of a box, so that few boxes are left
// around the nearest point, at joint limits as well.
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <queue>
#include <utility>
#include <vector>

#include "branch.hpp"
#include "proximity.hpp"

namespace pinsing {
namespace {

constexpr double kTolerance = 1e-9;  // by which a joint's value may be outside its limits

class Search {
public:
    Search(const Conditions& c, const SearchOptions& options)
        : c_(c), o_(options) {}

    Nearest run(const double* x, double* point) {
        best_ = {kInfinity, kInfinity, -1, 0};
        point_ = point;
        std::vector<double> target(static_cast<std::size_t>(c_.n));
        std::vector<std::unique_ptr<Part>> parts;
        for (int b = 0; b < c_.branches; b++) {
            const double fixed = put(b, x, target.data());
            if (fixed == kInfinity) continue;
            if (c_.equation_start[b + 1] > c_.equation_start[b]) {
                parts.push_back(std::make_unique<Part>(c_, b, fixed, slack_, target));
                continue;
            }
            best_.lower = std::min(best_.lower, std::max(fixed - slack_, 0.0));
            if (fixed < best_.upper) found(b, fixed, target.data());
        }
        std::sort(parts.begin(), parts.end(),
                  [](const auto& a, const auto& b) { return a->fixed < b->fixed; });
        for (auto& part : parts) begin(*part, x);
        for (auto& part : parts) add_first(*part);
        while (!heap_.empty() && heap_.top().first < goal() && best_.boxes < o_.boxes) {
            const std::size_t place = heap_.top().second;
            heap_.pop();
            const Waiting parent = boxes_[place];
            places_.push_back(place);
            split(*parent.part, parent);
        }
        if (!heap_.empty()) best_.lower = std::min(best_.lower, heap_.top().first);
        for (auto& part : parts)  // what was left out is no nearer than the best point, but for rounding
            best_.lower = std::min(best_.lower, whole(*part, std::max(known(*part), 0.0)));
        boxes_.clear(), places_.clear(), heap_ = {};
        best_.lower = std::min(best_.lower, best_.upper);
        return best_;
    }

private:
    // A branch with equations, its joints and the range in which they are looked at.
    struct Part {
        Part(const Conditions& c, int b, double fixed, double slack, const std::vector<double>& target)
            : b(b), fixed(fixed), least(std::max(fixed - slack, 0.0)), target(target), branch(c, b) {}

        const int b;
        const double fixed, least;  // how far its values are, and are at least
        const std::vector<double> target;
        Branch branch;
        double q[kJoints], lo[kJoints], hi[kJoints];
        double known = kInfinity;  // how far the best point known is, in these joints
        bool cut = false;          // whether points count that lie beyond the range
        std::int64_t turns = 0;
    };
    struct Waiting : Box {
        Part* part;
    };
    using Entry = std::pair<double, std::size_t>;

    const Conditions& c_;
    const SearchOptions& o_;
    double slack_ = 0.0;
    Nearest best_{};
    double* point_ = nullptr;
    // Boxes wait in a heap by their bounds; those that were taken out leave their place.
    std::vector<Waiting> boxes_;
    std::vector<std::size_t> places_;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> heap_;

    // x with the joints of a branch at their values, the nearest copies, and those that do not
    // matter within their limits; how far that is.
    double put(int b, const double* x, double* target) {
        double off[kJoints];
        bool involved[kJoints] = {};
        const double* lower = o_.lower + c_.family[b] * o_.stride;
        const double* upper = o_.upper + c_.family[b] * o_.stride;
        std::copy(x, x + c_.n, target);
        if (o_.limited) {
            const auto first = c_.term_start[c_.equation_start[b]];
            const auto last = c_.term_start[c_.equation_start[b + 1]];
            for (auto k = c_.rate_start[first]; k < c_.rate_start[last]; k++)
                involved[c_.rate_joint[k]] = true;
            for (auto k = c_.power_start[first]; k < c_.power_start[last]; k++)
                involved[c_.power_joint[k]] = true;
            for (int j = 0; j < c_.n; j++)
                if (!involved[j]) target[j] = std::min(std::max(x[j], lower[j]), upper[j]);
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

    // A bound from which on nothing more is to be known.
    double goal() const { return best_.upper - 0.5 * o_.gap; }

    void found(int b, double length, const double* point) {
        best_.upper = length;
        best_.family = c_.family[b];
        std::copy(point, point + c_.n, point_);
    }

    // A bound of all of the distance out of one in the joints of a part.
    double whole(const Part& part, double low) const {
        return std::max(joined(part.least, low, c_.largest) * (1.0 - 4e-15), 0.0);
    }

    // The joints of a part, from where to where they are looked at, and a first point.
    void begin(Part& part, const double* x) {
        if (part.fixed >= best_.upper) return;
        const double* lower = o_.lower + c_.family[part.b] * o_.stride;
        const double* upper = o_.upper + c_.family[part.b] * o_.stride;
        double start[kJoints];
        for (int j = 0; j < part.branch.d(); j++) {
            const int joint = part.branch.joints[j];
            double &q = part.q[j], &lo = part.lo[j], &hi = part.hi[j];
            q = x[joint];
            const double turn = c_.turn[joint];
            const double reach = turn > 0.0 ? 0.5 * turn : o_.far;
            const bool below = o_.limited && lower[joint] > -kInfinity;
            const bool above = o_.limited && upper[joint] < kInfinity;
            lo = below ? lower[joint] : q - reach;
            hi = above ? upper[joint] : q + reach;
            if (below && !above) hi = std::max(q, lo) + (turn > 0.0 ? turn : reach);
            if (above && !below) lo = std::min(q, hi) - (turn > 0.0 ? turn : reach);
            part.cut = part.cut || (turn == 0.0 && !(below && above));
            start[j] = std::min(std::max(q, lo), hi);
        }
        attempt(part, start);
    }

    // How far the best point known may be, in the joints of a part.
    double known(Part& part) {
        part.known = std::min(part.known, part_of(best_.upper, part.fixed, c_.largest));
        return part.known;
    }

    bool keep(Part& part, const double* at, double length) {
        const double proven = length + missing(part.branch, at, length);
        if (!(proven < known(part))) return false;
        part.known = proven;
        std::vector<double> point = part.target;
        for (int j = 0; j < part.branch.d(); j++)
            point[static_cast<std::size_t>(part.branch.joints[j])] = at[j];
        found(part.b, joined(part.fixed, proven, c_.largest) * (1.0 + 1e-15), point.data());
        return true;
    }

    void attempt(Part& part, const double* from) {
        const double least = std::max(1e-13, 0.1 * o_.gap * o_.gap);
        double x[kJoints];
        for (int way = c_.largest ? 0 : 1; way < 2; way++) {  // no pull rests where cubes touch
            std::copy(from, from + part.branch.d(), x);
            const double length = way == 0 ? part.branch.land(part.q, part.lo, part.hi, known(part), x)
                                           : part.branch.descend(part.q, part.lo, part.hi, least, x);
            if (length < known(part)) keep(part, x, length);
        }
    }

    void add(Part& part, const Box& box) {
        const double low = whole(part, box.low);
        if (low >= goal()) {
            best_.lower = std::min(best_.lower, low);
        } else if (places_.empty()) {
            heap_.emplace(low, boxes_.size());
            boxes_.push_back({box, &part});
        } else {
            heap_.emplace(low, places_.back());
            boxes_[places_.back()] = {box, &part};
            places_.pop_back();
        }
    }

    void add_first(Part& part) {
        const double most = known(part);
        if (most < 0.0) return;  // its values are farther than the best point
        Box box;
        for (int j = 0; j < part.branch.d(); j++) {
            double from = part.lo[j], to = part.hi[j];
            if (most < kInfinity) {  // what lies farther away is of no use
                from = std::max(from, part.q[j] - most);
                to = std::min(to, part.q[j] + most);
            }
            if (from > to) return;
            box.c[j] = 0.5 * (from + to);
            box.h[j] = 0.5 * (to - from) * (1.0 + 1e-15) + 2.3e-16 * (std::fabs(from) + std::fabs(to));
        }
        if (part.cut && most > o_.far)  // points count that are not looked at
            best_.lower = std::min(best_.lower, whole(part, o_.far));
        if (part.branch.bound(part.q, 0.0, most, box)) add(part, box);
    }

    void split(Part& part, const Box& parent) {
        const int d = part.branch.d();
        if (!(c_.largest && known(part) <= part.fixed)) {
            double start[kJoints];
            std::copy(parent.near, parent.near + d, start);
            const double length = part.branch.land(part.q, part.lo, part.hi, known(part), start);
            if (length < kInfinity && keep(part, start, length)) attempt(part, start);
            // Where Newton's method fails, as at double zeros, a longer way may do.
            else if (part.turns++ % 64 == 63) attempt(part, parent.c);
        }
        const double low = whole(part, parent.low);
        if (low >= goal() || parent.h[parent.widest] < 1e-13) {
            best_.lower = std::min(best_.lower, low);  // by rounding, nothing more can be told
            return;
        }
        for (int side = 0; side < 2; side++) {
            Box box = parent;
            const int w = parent.widest;
            box.h[w] *= 0.5;
            box.c[w] += side == 0 ? -box.h[w] : box.h[w];
            box.h[w] *= 1.0 + 4e-16;
            best_.boxes++;
            if (part.branch.bound(part.q, parent.low, known(part), box)) add(part, box);
        }
    }

    // How much farther than a point that is on the set to rounding a zero surely is at most.
    double missing(Branch& branch, const double* x, double length) const {
        const std::int64_t e = branch.first;
        if (branch.at.size() != 1 || c_.sliding[e] || length <= 0.0) return 0.0;
        branch.evaluate(x);
        const SumOnBox& at = branch.at[0];
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
