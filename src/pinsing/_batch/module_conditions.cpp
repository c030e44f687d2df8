// Conditions as a Python object, made once and asked often: its arrays are copied and checked here,
// so that a call costs little.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "module.hpp"
#include "proximity.hpp"
#include "share_out.hpp"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace pinsing {
namespace {

using Whole = std::vector<std::int64_t>;
using Real = std::vector<double>;

template <class T, class A>
std::vector<T> copied(const A& array) {
    require(array.ndim() == 1, "the arrays of conditions have one axis");
    return std::vector<T>(array.data(), array.data() + array.shape(0));
}

// Whether starts[i] <= starts[i + 1], from 0 to `count`, `items` of them and one more.
void require_starts(const Whole& starts, std::size_t items, std::size_t count) {
    bool good = starts.size() == items + 1 && starts.front() == 0 &&
                starts.back() == static_cast<std::int64_t>(count);
    for (std::size_t i = 0; good && i < items; i++) good = starts[i] <= starts[i + 1];
    require(good, "the starts of conditions do not fit");
}

void require_within(const Whole& indices, std::int64_t end) {
    for (std::int64_t i : indices) require(i >= 0 && i < end, "an index of conditions is out of range");
}

class ConditionSet {
public:
    ConditionSet(int families, const InWhole& family, const In& turn, const InWhole& value_start,
                 const InWhole& value_joint, const In& value, const InWhole& equation_start,
                 const InWhole& term_start, const In& noise, const In& reach, const In& curvature,
                 const In& steepness, const InFlags& sliding, const In& amplitude, const In& phase,
                 const In& rate_norm, const InWhole& rate_start, const InWhole& rate_joint,
                 const In& rate, const InWhole& power_start, const InWhole& power_joint,
                 const InWhole& power, bool largest)
        : family_(copied<std::int64_t>(family)), turn_(copied<double>(turn)),
          value_start_(copied<std::int64_t>(value_start)),
          value_joint_(copied<std::int64_t>(value_joint)), value_(copied<double>(value)),
          equation_start_(copied<std::int64_t>(equation_start)),
          term_start_(copied<std::int64_t>(term_start)), noise_(copied<double>(noise)),
          reach_(copied<double>(reach)), curvature_(copied<double>(curvature)),
          steepness_(copied<double>(steepness)), amplitude_(copied<double>(amplitude)),
          phase_(copied<double>(phase)), rate_norm_(copied<double>(rate_norm)),
          rate_start_(copied<std::int64_t>(rate_start)),
          rate_joint_(copied<std::int64_t>(rate_joint)), rate_(copied<double>(rate)),
          power_start_(copied<std::int64_t>(power_start)),
          power_joint_(copied<std::int64_t>(power_joint)), power_(copied<std::int64_t>(power)) {
        const std::size_t branches = family_.size(), equations = noise_.size();
        const std::size_t terms = amplitude_.size();
        const std::int64_t n = static_cast<std::int64_t>(turn_.size());
        require(n >= 1 && n <= kMaxConditionJoints, "the number of joints is out of range");
        require(families >= 0 && families <= 100000, "the number of families is out of range");
        require_within(family_, families);
        require_starts(value_start_, branches, value_.size());
        require_starts(equation_start_, branches, equations);
        require_starts(term_start_, equations, terms);
        require_starts(rate_start_, terms, rate_.size());
        require_starts(power_start_, terms, power_.size());
        require(value_joint_.size() == value_.size() && rate_joint_.size() == rate_.size() &&
                    power_joint_.size() == power_.size() && reach_.size() == equations &&
                    curvature_.size() == equations && steepness_.size() == equations &&
                    sliding.ndim() == 1 && sliding.shape(0) == equations &&
                    phase_.size() == terms && rate_norm_.size() == terms,
                "the arrays of conditions differ in length");
        require_within(value_joint_, n);
        require_within(rate_joint_, n);
        require_within(power_joint_, n);
        require_within(power_, 1000);
        sliding_ = std::make_unique<bool[]>(equations + 1);
        std::copy(sliding.data(), sliding.data() + equations, sliding_.get());
        c_ = Conditions{static_cast<int>(n), families, static_cast<int>(branches), family_.data(),
                        turn_.data(), value_start_.data(), value_joint_.data(), value_.data(),
                        equation_start_.data(), term_start_.data(), noise_.data(), reach_.data(),
                        curvature_.data(), steepness_.data(), sliding_.get(), amplitude_.data(),
                        phase_.data(), rate_norm_.data(), rate_start_.data(), rate_joint_.data(),
                        rate_.data(), power_start_.data(), power_joint_.data(), power_.data(),
                        largest};
    }

    ConditionSet(const ConditionSet&) = delete;
    ConditionSet& operator=(const ConditionSet&) = delete;

    // Bounds of the clearance; `each` (N, families, 2) may be empty, and `points` (N, families, n).
    void clearances(const In& X, Out lower, Out upper, OutWhole family, Out each, Out points,
                    const std::string& isa, int threads) const {
        const Kernel& kernel = kernel_named(isa);
        const std::int64_t N = rows(X);
        require(lower.ndim() == 1 && upper.ndim() == 1 && family.ndim() == 1 &&
                    lower.size() == X.shape(0) && upper.size() == X.shape(0) &&
                    family.size() == X.shape(0),
                "lower, upper and family must have shape (N,)");
        const std::size_t width = 2 * static_cast<std::size_t>(c_.families);
        require(each.size() == 0 || each.size() == X.shape(0) * width,
                "each must have shape (N, families, 2)");
        const std::size_t near = static_cast<std::size_t>(c_.families * c_.n);
        require(points.size() == 0 || (points.size() == X.shape(0) * near && !c_.largest),
                "points must have shape (N, families, n), and the norm be Euclidean");
        double* all = each.size() == 0 ? nullptr : each.data();
        double* every = points.size() == 0 ? nullptr : points.data();
        const double* x = X.data();
        double *low = lower.data(), *high = upper.data();
        std::int64_t* of = family.data();
        auto work = [&](std::int64_t first, std::int64_t count, double* scratch) {
            return kernel.clearances(c_, x + first * c_.n, count, low + first, high + first,
                                     of + first, all == nullptr ? all : all + first * width,
                                     every == nullptr ? every : every + first * near, scratch);
        };
        const Outcome outcome = share_out(N, threads, kernel.condition_scratch(c_), work);
        if (outcome.not_finite >= 0)
            throw nb::value_error(("Q[" + std::to_string(outcome.not_finite) +
                                   "] holds a value that is not finite")
                                      .c_str());
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
        const std::int64_t N = rows(X);
        const std::size_t n = static_cast<std::size_t>(c_.n), count = X.shape(0);
        const std::size_t limits = lower_limit.size();
        require(upper_limit.size() == limits &&
                    (limits == n || limits == n * static_cast<std::size_t>(c_.families)),
                "limits must have shape (n,) or (families, n)");
        require(lower.size() == count && upper.size() == count && family.size() == count &&
                    used.size() == count && points.size() == count * n,
                "an output has the wrong shape");
        for (std::size_t i = 0; i < X.size(); i++)
            require(std::isfinite(X.data()[i]), "Q holds a value that is not finite");
        const SearchOptions options{lower_limit.data(), upper_limit.data(), limits == n ? 0 : c_.n,
                                    limited, far, gap, boxes};
        const nb::gil_scoped_release release;
        std::atomic<std::int64_t> next{0};
        auto run = [&]() {
            for (std::int64_t i = next.fetch_add(1); i < N; i = next.fetch_add(1)) {
                double* point = points.data() + i * c_.n;
                std::copy(X.data() + i * c_.n, X.data() + (i + 1) * c_.n, point);
                const Nearest found = nearest_condition(c_, options, X.data() + i * c_.n, point);
                lower.data()[i] = found.lower;
                upper.data()[i] = found.upper;
                family.data()[i] = found.family;
                used.data()[i] = found.boxes;
            }
        };
        run_on(static_cast<int>(std::min<std::int64_t>(threads, N)), run);
    }

    // Zeros of every equation along pieces (m, degree + 1, n), ascending powers of 0..1. Returns
    // (segment, equation, s, half-width, kind) rows, in order, and the values at both ends
    // (m, equations, 2).
    nb::object zeros(const In& pieces, Out ends, int threads) const {
        require(pieces.ndim() == 3 && pieces.shape(1) >= 1 && pieces.shape(1) <= 64 &&
                    pieces.shape(2) == static_cast<std::size_t>(c_.n),
                "pieces must have shape (m, degree + 1, n)");
        const std::int64_t m = static_cast<std::int64_t>(pieces.shape(0));
        const int degree = static_cast<int>(pieces.shape(1)) - 1;
        const std::int64_t equations = static_cast<std::int64_t>(noise_.size());
        require(ends.size() == static_cast<std::size_t>(2 * m * equations),
                "ends must have shape (m, equations, 2)");
        for (std::size_t i = 0; i < pieces.size(); i++)
            require(std::isfinite(pieces.data()[i]), "a piece holds a value that is not finite");
        constexpr std::int64_t kPieces = 512;
        const std::int64_t chunks = (m + kPieces - 1) / kPieces;
        std::vector<std::vector<Event>> found(static_cast<std::size_t>(chunks));
        {
            const nb::gil_scoped_release release;
            std::atomic<std::int64_t> next{0};
            const double* all = pieces.data();
            double* end = ends.data();
            auto run = [&]() {
                for (std::int64_t i = next.fetch_add(1); i < chunks; i = next.fetch_add(1))
                    for (std::int64_t k = i * kPieces; k < std::min(m, (i + 1) * kPieces); k++)
                        for (std::int64_t e = 0; e < equations; e++)
                            zeros_of_piece(c_, e, all + k * (degree + 1) * c_.n, degree, k,
                                           found[static_cast<std::size_t>(i)],
                                           end[2 * (k * equations + e)],
                                           end[2 * (k * equations + e) + 1]);
            };
            run_on(static_cast<int>(std::min<std::int64_t>(threads, std::max<std::int64_t>(chunks, 1))), run);
        }
        std::vector<double> flat;
        for (const std::vector<Event>& part : found)
            for (const Event& event : part)
                flat.insert(flat.end(),
                            {static_cast<double>(event.segment), static_cast<double>(event.equation),
                             event.s, event.width, static_cast<double>(event.kind)});
        return nb::cast(flat);
    }

private:
    Whole family_;
    Real turn_;
    Whole value_start_, value_joint_;
    Real value_;
    Whole equation_start_, term_start_;
    Real noise_, reach_, curvature_, steepness_, amplitude_, phase_, rate_norm_;
    Whole rate_start_, rate_joint_;
    Real rate_;
    Whole power_start_, power_joint_, power_;
    std::unique_ptr<bool[]> sliding_;
    Conditions c_;

    std::int64_t rows(const In& X) const {
        require(X.ndim() == 2 && X.shape(1) == static_cast<std::size_t>(c_.n),
                "Q must have shape (N, n)");
        return static_cast<std::int64_t>(X.shape(0));
    }

    template <class Run>
    static void run_on(int workers, Run& run) {
        std::vector<std::thread> team;
        for (int i = 1; i < workers; i++) {
            try {
                team.emplace_back([&run] { run(); });
            } catch (const std::exception&) {
                break;  // the system gives no more threads: go on with those there are
            }
        }
        run();
        for (std::thread& thread : team) thread.join();
    }
};

}  // namespace

void add_conditions(nb::module_& m) {
    m.attr("MAX_CONDITION_JOINTS") = kMaxConditionJoints;
    nb::class_<ConditionSet>(m, "ConditionSet")
        .def(nb::init<int, const InWhole&, const In&, const InWhole&, const InWhole&, const In&,
                      const InWhole&, const InWhole&, const In&, const In&, const In&, const In&,
                      const InFlags&, const In&, const In&, const In&, const InWhole&,
                      const InWhole&, const In&, const InWhole&, const InWhole&, const InWhole&,
                      bool>())
        .def("clearances", &ConditionSet::clearances, "X"_a.noconvert(), "lower"_a.noconvert(),
             "upper"_a.noconvert(), "family"_a.noconvert(), "each"_a.noconvert(),
             "points"_a.noconvert(), "isa"_a, "threads"_a)
        .def("nearest", &ConditionSet::nearest, "X"_a.noconvert(), "lower_limit"_a.noconvert(),
             "upper_limit"_a.noconvert(), "limited"_a, "far"_a, "gap"_a, "boxes"_a,
             "lower"_a.noconvert(), "upper"_a.noconvert(), "family"_a.noconvert(),
             "used"_a.noconvert(), "points"_a.noconvert(), "threads"_a)
        .def("watch", &ConditionSet::watch, "x"_a.noconvert(), "velocity"_a.noconvert(),
             "horizon"_a, "gap"_a, "boxes"_a, "out"_a.noconvert(), "isa"_a)
        .def("zeros", &ConditionSet::zeros, "pieces"_a.noconvert(), "ends"_a.noconvert(),
             "threads"_a);
}

}  // namespace pinsing
