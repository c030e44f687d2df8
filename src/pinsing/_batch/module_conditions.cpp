// Conditions as a Python object, made once and asked often: its arrays are copied and checked here,
// so that a call costs little.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "module.hpp"
#include "proximity.hpp"
#include "share_out.hpp"

namespace nb = nanobind;

namespace pinsing {
namespace {

class ConditionSet {
public:
    // `flat`: the arrays of conditions.hpp by their names.
    ConditionSet(int families, const nb::dict& flat, bool largest) {
        const auto size = [&](const char* name) { return nb::len(nb::handle(flat[name])); };
        const std::size_t n = size("turn"), branches = size("family"), values = size("value");
        const std::size_t equations = size("noise"), terms = size("amplitude");
        const std::size_t rates = size("rate"), powers = size("power_joint");
        require(n >= 1 && n <= kMaxConditionJoints, "the number of joints is out of range");
        require(families >= 0 && families <= 100000, "the number of families is out of range");
        const auto reals = [&](const char* name, std::size_t count) {
            return copied<double>(flat[name], count);
        };
        // Numbers from 0 to `end`, which is none of them.
        const auto wholes = [&](const char* name, std::size_t count, std::size_t end) {
            const std::int64_t* found = copied<std::int64_t>(flat[name], count);
            for (std::size_t i = 0; i < count; i++)
                require(found[i] >= 0 && found[i] < static_cast<std::int64_t>(end),
                        "an index of conditions is out of range");
            return found;
        };
        // Where each of so many items starts among `count` others, and where the last one ends.
        const auto starts = [&](const char* name, std::size_t items, std::size_t count) {
            const std::int64_t* found = wholes(name, items + 1, count + 1);
            require(found[0] == 0 && std::is_sorted(found, found + items + 1) &&
                        found[items] == static_cast<std::int64_t>(count),
                    "the starts of conditions do not fit");
            return found;
        };
        c_ = Conditions{static_cast<int>(n), families, static_cast<int>(branches),
                        wholes("family", branches, static_cast<std::size_t>(families)), reals("turn", n),
                        starts("value_start", branches, values), wholes("value_joint", values, n),
                        reals("value", values), starts("equation_start", branches, equations),
                        starts("term_start", equations, terms), reals("noise", equations),
                        reals("reach", equations), reals("curvature", equations),
                        reals("steepness", equations), copied<bool>(flat["sliding"], equations),
                        reals("amplitude", terms), reals("phase", terms), reals("rate_norm", terms),
                        starts("rate_start", terms, rates), wholes("rate_joint", rates, n),
                        reals("rate", rates), starts("power_start", terms, powers),
                        wholes("power_joint", powers, n), largest};
    }

    ConditionSet(const ConditionSet&) = delete;
    ConditionSet& operator=(const ConditionSet&) = delete;

    // Bounds of the clearance (see kernel.hpp); those of each family, and points, if they are wanted.
    nb::tuple clearances(const In& X, bool each, bool points, const std::string& isa, int threads) const {
        require(!points || !c_.largest, "points are of the Euclidean norm");
        const std::size_t n = static_cast<std::size_t>(c_.n), families = static_cast<std::size_t>(c_.families);
        Arrays all("Q", X, {n});
        const nb::object lower = all.make({}), upper = all.make({}), family = all.make({});
        const nb::object every = all.make({families, 2}, each), near = all.make({families, n}, points);
        share(kernel_named(isa).clearances, c_, all, threads);
        return nb::make_tuple(lower, upper, family, every, near);
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
        double* result = out.data();
        for (std::size_t j = 0; j < velocity.size(); j++)
            if (!std::isfinite(velocity.data()[j])) return -2;
        std::vector<double> each(2 * static_cast<std::size_t>(c_.families));
        double nearest = -1.0;
        const Batch one{1,
                        {{"x", const_cast<double*>(x.data()), c_.n}, {}},
                        {{"", result, 1}, {"", result + 1, 1}, {"", &nearest, 1}, {"", each.data(), 2 * c_.families},
                         {"", nullptr, c_.n * c_.families}}};
        if (kernel_named(isa).clearances(c_, one).not_finite >= 0) return -2;
        std::int64_t family = static_cast<std::int64_t>(nearest);
        int nearer = 0;  // families that may be nearer than a point of this one
        for (int f = 0; family >= 0 && f < c_.families; f++)
            nearer += f != family && each[2 * f] < each[2 * family + 1];
        if (nearer > 0) {
            const std::vector<double> below(n, -HUGE_VAL), above(n, HUGE_VAL);
            std::vector<double> point(x.data(), x.data() + n);
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

    // Nearest points of X (N, n): lower, upper, family, boxes (N,), points (N, n).
    nb::tuple nearest(const In& X, const In& lower_limit, const In& upper_limit, bool limited, double far,
                      double gap, std::int64_t boxes, int threads) const {
        const std::size_t n = static_cast<std::size_t>(c_.n), limits = lower_limit.size();
        const std::size_t N = Arrays("Q", X, {n}).count;
        require(upper_limit.size() == limits &&
                    (limits == n || limits == n * static_cast<std::size_t>(c_.families)),
                "limits must have shape (n,) or (families, n)");
        require(std::all_of(X.data(), X.data() + N * n, [](double x) { return std::isfinite(x); }),
                "Q holds a value that is not finite");
        const SearchOptions options{lower_limit.data(), upper_limit.data(), limits == n ? 0 : c_.n,
                                    limited, far, gap, boxes};
        const Made<double> lower({N}), upper({N}), points({N, n});
        const Made<std::int64_t> family({N}), used({N});
        const auto search = [&](std::int64_t i) {
            const double* x = X.data() + i * c_.n;
            double* point = points.data + i * c_.n;
            std::copy(x, x + c_.n, point);
            const Nearest found = nearest_condition(c_, options, x, point);
            lower.data[i] = found.lower;
            upper.data[i] = found.upper;
            family.data[i] = found.family;
            used.data[i] = found.boxes;
        };
        share_each(N, threads, search, 1);
        return nb::make_tuple(lower.array, upper.array, family.array, used.array, points.array);
    }

private:
    std::vector<std::shared_ptr<void>> kept_;
    Conditions c_;

    template <class T>
    const T* copied(nb::handle given, std::size_t count) {
        const auto array = nb::cast<nb::ndarray<const T, nb::c_contig, nb::device::cpu>>(given);
        require(array.size() == count, "the arrays of conditions differ in length");
        const std::shared_ptr<T[]> own(new T[count + 1]);
        std::copy(array.data(), array.data() + count, own.get());
        kept_.push_back(own);
        return own.get();
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
}

}  // namespace pinsing
