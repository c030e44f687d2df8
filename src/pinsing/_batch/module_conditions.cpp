// Conditions as a Python object, made once and asked often: its arrays are copied and checked here,
// so that a call costs little.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "module.hpp"
#include "proximity.hpp"
#include "share_out.hpp"

namespace nb = nanobind;

namespace pinsing {
namespace {

using Whole = std::vector<std::int64_t>;
using Real = std::vector<double>;

class ConditionSet {
public:
    // `flat`: the arrays of conditions.hpp by their names.
    ConditionSet(int families, const nb::dict& flat, bool largest) {
        const Whole &family = wholes(flat["family"], families), &power = wholes(flat["power"], 1000);
        const Real &turn = reals(flat["turn"]), &value = reals(flat["value"]), &noise = reals(flat["noise"]),
                   &amplitude = reals(flat["amplitude"]), &rate = reals(flat["rate"]);
        const std::size_t branches = family.size(), equations = noise.size(), terms = amplitude.size();
        const int n = static_cast<int>(turn.size());
        require(n >= 1 && n <= kMaxConditionJoints, "the number of joints is out of range");
        require(families >= 0 && families <= 100000, "the number of families is out of range");
        c_ = Conditions{n, families, static_cast<int>(branches), family.data(), turn.data(),
                        starts(flat["value_start"], branches, value.size()),
                        joints(flat["value_joint"], value.size(), n), value.data(),
                        starts(flat["equation_start"], branches, equations),
                        starts(flat["term_start"], equations, terms), noise.data(),
                        reals(flat["reach"], equations), reals(flat["curvature"], equations),
                        reals(flat["steepness"], equations), flags(flat["sliding"], equations),
                        amplitude.data(), reals(flat["phase"], terms), reals(flat["rate_norm"], terms),
                        starts(flat["rate_start"], terms, rate.size()),
                        joints(flat["rate_joint"], rate.size(), n), rate.data(),
                        starts(flat["power_start"], terms, power.size()),
                        joints(flat["power_joint"], power.size(), n), power.data(), largest};
    }

    ConditionSet(const ConditionSet&) = delete;
    ConditionSet& operator=(const ConditionSet&) = delete;

    // Bounds of the clearance; `each` (N, families, 2) may be empty, and `points` (N, families, n).
    void clearances(const In& X, Out lower, Out upper, OutWhole family, Out each, Out points,
                    const std::string& isa, int threads) const {
        const Kernel& kernel = kernel_named(isa);
        const std::size_t n = static_cast<std::size_t>(c_.n), N = rows_of(X, n);
        const std::size_t families = static_cast<std::size_t>(c_.families);
        require_shape(lower, "lower", {N});
        require_shape(upper, "upper", {N});
        require_shape(family, "family", {N});
        if (each.size() > 0) require_shape(each, "each", {N, families, 2});
        if (points.size() > 0) require_shape(points, "points", {N, families, n});
        require(points.size() == 0 || !c_.largest, "points are of the Euclidean norm");
        const auto part = [](Out& all, std::int64_t at) { return all.size() > 0 ? all.data() + at : nullptr; };
        share_finite("Q", N, threads, kernel.condition_scratch(c_),
                     [&](std::int64_t first, std::int64_t count, double* scratch) {
                         return kernel.clearances(c_, X.data() + first * c_.n, count,
                                                  lower.data() + first, upper.data() + first,
                                                  family.data() + first,
                                                  part(each, first * 2 * c_.families),
                                                  part(points, first * c_.families * c_.n), scratch);
                     });
    }

    // One configuration x (n,): lower, upper, time to contact and rate into out (4,); returns the
    // nearest family, -2 where a value is not finite. Where bounds do not tell which it is, it is
    // that of the nearest point found in so many boxes. Time and rate are those of a motion along
    // velocity (n,), and left alone if it has no values.
    int watch(const In& x, const In& velocity, double horizon, double gap, std::int64_t boxes,
              Out out, const std::string& isa) const {
        const std::size_t n = static_cast<std::size_t>(c_.n);
        require(x.size() == n && (velocity.size() == n || velocity.size() == 0) && out.size() == 4,
                "x must have shape (n,), velocity (n,) or (0,), out (4,)");
        const Kernel& kernel = kernel_named(isa);
        const Scratch scratch = allocate(kernel.condition_scratch(c_));
        double* result = out.data();
        std::int64_t family = -1;
        for (std::size_t j = 0; j < velocity.size(); j++)
            if (!std::isfinite(velocity.data()[j])) return -2;
        Real each(2 * static_cast<std::size_t>(c_.families));
        const Outcome outcome = kernel.clearances(c_, x.data(), 1, result, result + 1, &family,
                                                  each.data(), nullptr, scratch.get());
        if (outcome.not_finite >= 0) return -2;
        int nearer = 0;  // families that may be nearer than a point of this one
        for (int f = 0; family >= 0 && f < c_.families; f++)
            nearer += f != family && each[2 * f] < each[2 * family + 1];
        if (nearer > 0) {
            const Real below(n, -HUGE_VAL), above(n, HUGE_VAL);
            Real point(x.data(), x.data() + n);
            double far = 100.0;
            for (double value : point) far = std::max(far, 100.0 + std::fabs(value));
            const SearchOptions options{below.data(), above.data(), 0, false, far, gap, boxes};
            const Nearest found = nearest_condition(c_, options, x.data(), point.data());
            result[1] = std::min(result[1], found.upper);
            if (found.family >= 0) family = found.family;
        }
        if (velocity.size() == n) {
            const Contact contact = contact_along(c_, family, x.data(), velocity.data(), horizon);
            result[2] = contact.time;
            result[3] = contact.rate;
        }
        return static_cast<int>(family);
    }

    // Nearest points: X (N, n) -> lower, upper, family, boxes (N,), points (N, n).
    void nearest(const In& X, const In& lower_limit, const In& upper_limit, bool limited, double far,
                 double gap, std::int64_t boxes, Out lower, Out upper, OutWhole family,
                 OutWhole used, Out points, int threads) const {
        const std::size_t n = static_cast<std::size_t>(c_.n), N = rows_of(X, n);
        const std::size_t limits = lower_limit.size();
        require(upper_limit.size() == limits &&
                    (limits == n || limits == n * static_cast<std::size_t>(c_.families)),
                "limits must have shape (n,) or (families, n)");
        require_shape(lower, "lower", {N});
        require_shape(upper, "upper", {N});
        require_shape(family, "family", {N});
        require_shape(used, "used", {N});
        require_shape(points, "points", {N, n});
        for (std::size_t i = 0; i < X.size(); i++)
            require(std::isfinite(X.data()[i]), "Q holds a value that is not finite");
        const SearchOptions options{lower_limit.data(), upper_limit.data(), limits == n ? 0 : c_.n,
                                    limited, far, gap, boxes};
        const auto search = [&](std::int64_t i) {
            const double* x = X.data() + i * c_.n;
            double* point = points.data() + i * c_.n;
            std::copy(x, x + c_.n, point);
            const Nearest found = nearest_condition(c_, options, x, point);
            lower.data()[i] = found.lower;
            upper.data()[i] = found.upper;
            family.data()[i] = found.family;
            used.data()[i] = found.boxes;
        };
        share_each(N, threads, search, 1);
    }

    // Zeros of every equation along pieces (m, degree + 1, n), ascending powers of 0..1. Returns
    // (segment, equation, s, half-width, kind) rows, in order, and the values at both ends
    // (m, equations, 2).
    nb::object zeros(const In& pieces, Out ends, int threads) const {
        require(pieces.ndim() == 3 && pieces.shape(1) >= 1 && pieces.shape(1) <= 64 &&
                    pieces.shape(2) == static_cast<std::size_t>(c_.n),
                "pieces must have shape (m, degree + 1, n)");
        const int degree = static_cast<int>(pieces.shape(1)) - 1;
        const std::int64_t m = static_cast<std::int64_t>(pieces.shape(0)), E = c_.equation_start[c_.branches];
        require(ends.size() == static_cast<std::size_t>(2 * m * E), "ends must have shape (m, equations, 2)");
        for (std::size_t i = 0; i < pieces.size(); i++)
            require(std::isfinite(pieces.data()[i]), "a piece holds a value that is not finite");
        constexpr std::int64_t kPieces = 512;
        std::vector<std::vector<Event>> found(static_cast<std::size_t>((m + kPieces - 1) / kPieces));
        const auto search = [&](std::int64_t k) {
            for (std::int64_t e = 0; e < E; e++) {
                double* end = ends.data() + 2 * (k * E + e);
                zeros_of_piece(c_, e, pieces.data() + k * (degree + 1) * c_.n, degree, k,
                               found[static_cast<std::size_t>(k / kPieces)], end[0], end[1]);
            }
        };
        share_each(static_cast<std::size_t>(m), threads, search, kPieces);
        std::vector<double> flat;
        for (const std::vector<Event>& part : found)
            for (const Event& event : part)
                flat.insert(flat.end(),
                            {static_cast<double>(event.segment), static_cast<double>(event.equation),
                             event.s, event.width, static_cast<double>(event.kind)});
        return nb::cast(flat);
    }

private:
    std::deque<Whole> wholes_;
    std::deque<Real> reals_;
    std::unique_ptr<bool[]> flags_;
    Conditions c_;

    const Real& reals(nb::handle given) {
        const In array = nb::cast<In>(given);
        return reals_.emplace_back(array.data(), array.data() + array.size());
    }

    const double* reals(nb::handle given, std::size_t count) {
        const Real& found = reals(given);
        require(found.size() == count, "the arrays of conditions differ in length");
        return found.data();
    }

    const bool* flags(nb::handle given, std::size_t count) {
        const InFlags array = nb::cast<InFlags>(given);
        require(array.size() == count, "the arrays of conditions differ in length");
        flags_ = std::make_unique<bool[]>(count + 1);
        std::copy(array.data(), array.data() + count, flags_.get());
        return flags_.get();
    }

    // Numbers from 0 to `end`, which is none of them.
    const Whole& wholes(nb::handle given, std::int64_t end) {
        const InWhole array = nb::cast<InWhole>(given);
        const Whole& found = wholes_.emplace_back(array.data(), array.data() + array.size());
        for (std::int64_t i : found) require(i >= 0 && i < end, "an index of conditions is out of range");
        return found;
    }

    const std::int64_t* joints(nb::handle given, std::size_t count, int n) {
        const Whole& found = wholes(given, n);
        require(found.size() == count, "the arrays of conditions differ in length");
        return found.data();
    }

    // Where each of so many items starts among `count` others, and where the last one ends.
    const std::int64_t* starts(nb::handle given, std::size_t items, std::size_t count) {
        const Whole& found = wholes(given, static_cast<std::int64_t>(count) + 1);
        require(found.size() == items + 1 && found.front() == 0 && std::is_sorted(found.begin(), found.end()) &&
                    found.back() == static_cast<std::int64_t>(count),
                "the starts of conditions do not fit");
        return found.data();
    }
};

}  // namespace

void add_conditions(nb::module_& m) {
    m.attr("MAX_CONDITION_JOINTS") = kMaxConditionJoints;
    nb::class_<ConditionSet> conditions(m, "ConditionSet");
    conditions.def(nb::init<int, const nb::dict&, bool>());
    define(conditions, "clearances", &ConditionSet::clearances);
    define(conditions, "nearest", &ConditionSet::nearest);
    define(conditions, "watch", &ConditionSet::watch);
    define(conditions, "zeros", &ConditionSet::zeros);
}

}  // namespace pinsing
