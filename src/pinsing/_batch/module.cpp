// pinsing._batch._kernel: the kernels as Python functions over NumPy arrays.
//
// Checks shapes (memory safety), picks the kernel, shares the work out. Chunks have a fixed size
// and each item is computed alone, so results do not depend on the number of threads.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "kernel.hpp"
#include "module.hpp"
#include "share_out.hpp"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace {

using pinsing::Chain;
using pinsing::Kernel;
using pinsing::Outcome;

using pinsing::In;
using pinsing::InFlags;
using pinsing::kChunk;
using pinsing::Out;
using pinsing::require;
using pinsing::share_out;

// The kernels that this machine can run, best last.
const std::vector<const Kernel*>& kernels() {
    static const std::vector<const Kernel*> found = [] {
        std::vector<const Kernel*> all;
#if PINSING_HAVE_BASELINE
        all.push_back(&pinsing::kernel_baseline);
#endif
#if PINSING_HAVE_AVX2
        if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
            all.push_back(&pinsing::kernel_avx2);
#endif
#if PINSING_HAVE_AVX512
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
            __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") &&
            __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
            all.push_back(&pinsing::kernel_avx512);
#endif
        return all;
    }();
    return found;
}

}  // namespace

const Kernel& pinsing::kernel_named(const std::string& isa) {
    for (const Kernel* k : kernels())
        if (isa == k->name) return *k;
    throw nb::value_error(("this machine cannot run the instruction set '" + isa + "'").c_str());
}

void pinsing::require(bool condition, const char* what) {
    if (!condition) throw nb::value_error(what);
}

pinsing::Chain pinsing::chain_of(const In& R, const In& t, const InFlags& prismatic) {
    require(prismatic.ndim() == 1, "prismatic must have shape (n,)");
    const std::size_t n = prismatic.shape(0);
    require(n >= 1 && n <= kMaxJoints, "the number of joints is out of range");
    require(R.ndim() == 3 && R.shape(0) == n + 1 && R.shape(1) == 3 && R.shape(2) == 3,
            "R must have shape (n + 1, 3, 3)");
    require(t.ndim() == 2 && t.shape(0) == n + 1 && t.shape(1) == 3,
            "t must have shape (n + 1, 3)");
    return Chain{static_cast<int>(n), R.data(), t.data(), prismatic.data()};
}

namespace {

using pinsing::chain_of;
using pinsing::kernel_named;

void refuse_not_finite(const Outcome& outcome, const char* name) {
    if (outcome.not_finite < 0) return;
    throw nb::value_error((std::string(name) + "[" + std::to_string(outcome.not_finite) +
                           "] holds a value that is not finite")
                              .c_str());
}

void jacobians(const In& R, const In& t, const InFlags& prismatic, const In& Q, Out out,
               const std::string& isa, int threads) {
    const Kernel& kernel = kernel_named(isa);
    const Chain chain = chain_of(R, t, prismatic);
    const std::size_t n = static_cast<std::size_t>(chain.n);
    require(Q.ndim() == 2 && Q.shape(1) == n, "Q must have shape (N, n)");
    require(out.ndim() == 3 && out.shape(0) == Q.shape(0) && out.shape(1) == 6 && out.shape(2) == n,
            "out must have shape (N, 6, n)");
    const double* from = Q.data();
    double* to = out.data();
    const Outcome outcome = share_out(
        static_cast<std::int64_t>(Q.shape(0)), threads, kernel.scratch(chain.n),
        [&](std::int64_t first, std::int64_t count, double* scratch) {
            return kernel.jacobians(chain, from + first * chain.n, count, to + first * 6 * chain.n,
                                    scratch);
        });
    refuse_not_finite(outcome, "Q");
}

std::int64_t singular_values(const In& R, const In& t, const InFlags& prismatic,
                             const std::vector<int>& rows, const std::vector<double>& factors,
                             const In& Q, Out out, const std::string& isa, int threads,
                             int max_sweeps) {
    const Kernel& kernel = kernel_named(isa);
    const Chain chain = chain_of(R, t, prismatic);
    const std::size_t n = static_cast<std::size_t>(chain.n);
    require(n <= pinsing::kMaxColumns, "too many joints for the compiled singular values");
    require(!rows.empty() && rows.size() <= 6 && rows.size() == factors.size(),
            "rows and factors must have the same length, 1 to 6");
    pinsing::Task task{};
    task.m = static_cast<int>(rows.size());
    for (std::size_t i = 0; i < rows.size(); i++) {
        require(rows[i] >= 0 && rows[i] < 6, "rows must be in 0..5");
        task.row[i] = rows[i];
        task.factor[i] = factors[i];
    }
    const std::size_t rank = std::min(rows.size(), n);
    require(Q.ndim() == 2 && Q.shape(1) == n, "Q must have shape (N, n)");
    require(out.ndim() == 2 && out.shape(0) == Q.shape(0) && out.shape(1) == rank,
            "out must have shape (N, min(m, n))");
    const double* from = Q.data();
    double* to = out.data();
    const Outcome outcome = share_out(
        static_cast<std::int64_t>(Q.shape(0)), threads, kernel.scratch(chain.n),
        [&](std::int64_t first, std::int64_t count, double* scratch) {
            return kernel.singular_values(chain, task, from + first * chain.n, count,
                                          to + first * static_cast<std::int64_t>(rank), max_sweeps,
                                          scratch);
        });
    refuse_not_finite(outcome, "Q");
    return outcome.unfinished;
}

std::int64_t svdvals(const In& A, Out out, const std::string& isa, int threads, int max_sweeps,
                     bool by_roots) {
    const Kernel& kernel = kernel_named(isa);
    require(A.ndim() == 3, "the matrices must have shape (N, m, n)");
    const std::size_t m = A.shape(1), n = A.shape(2), rank = std::min(m, n);
    require(rank >= 1 && rank <= pinsing::kMaxRank && std::max(m, n) <= pinsing::kMaxColumns,
            "matrices of this size are not covered");
    require(out.ndim() == 2 && out.shape(0) == A.shape(0) && out.shape(1) == rank,
            "out must have shape (N, min(m, n))");
    const double* from = A.data();
    double* to = out.data();
    const Outcome outcome =
        share_out(static_cast<std::int64_t>(A.shape(0)), threads, kernel.scratch(1),
                  [&](std::int64_t first, std::int64_t count, double* scratch) {
                      return kernel.svdvals(from + first * static_cast<std::int64_t>(m * n),
                                            static_cast<int>(m), static_cast<int>(n), count,
                                            to + first * static_cast<std::int64_t>(rank),
                                            max_sweeps, by_roots, scratch);
                  });
    refuse_not_finite(outcome, "the matrix");
    return outcome.unfinished;
}

// The task of these rows, without factors.
pinsing::Task plain_task(const std::vector<int>& rows) {
    require(!rows.empty() && rows.size() <= 6, "rows must be 1 to 6");
    pinsing::Task task{};
    task.m = static_cast<int>(rows.size());
    for (std::size_t i = 0; i < rows.size(); i++) {
        require(rows[i] >= 0 && rows[i] < 6, "rows must be in 0..5");
        task.row[i] = rows[i];
        task.factor[i] = 1.0;
    }
    return task;
}

// `rules`: floor, good, stationary, no_minimum, longest, most_damping, stretch of Walk.
void walks(const In& R, const In& t, const InFlags& prismatic, const std::vector<int>& rows,
           int rank, double size, const In& lower, const In& upper,
           const std::vector<double>& rules, const In& Q, const In& free, Out X, Out ends,
           const std::string& isa, int threads, int max_iterations, int max_sweeps) {
    const Kernel& kernel = kernel_named(isa);
    const Chain chain = chain_of(R, t, prismatic);
    const std::size_t n = static_cast<std::size_t>(chain.n), m = rows.size();
    require(n <= pinsing::kWalkJoints, "too many joints for compiled walks");
    const pinsing::Task task = plain_task(rows);
    require(rank >= 1 && rank <= static_cast<int>(std::min(m, n)), "impossible rank");
    const std::size_t r = static_cast<std::size_t>(rank);
    require((m - r + 1) * (n - r + 1) <= pinsing::kWalkEquations, "too many equations");
    require(lower.ndim() == 1 && lower.shape(0) == n && upper.ndim() == 1 && upper.shape(0) == n,
            "limits must have shape (n,)");
    require(rules.size() == 7, "there are seven rules");
    require(Q.ndim() == 2 && Q.shape(1) == n, "Q must have shape (N, n)");
    const std::size_t N = Q.shape(0);
    require(free.ndim() == 2 && free.shape(0) == N && free.shape(1) == n && X.ndim() == 2 &&
                X.shape(0) == N && X.shape(1) == n,
            "free and X must have the shape of Q");
    require(ends.ndim() == 2 && ends.shape(0) == N && ends.shape(1) == 2,
            "ends must have shape (N, 2)");
    const pinsing::Walk walk{rank, size, lower.data(), upper.data(), max_iterations, rules[0],
                             rules[1], rules[2], rules[3], rules[4], rules[5], rules[6]};
    const double* from = Q.data();
    const double* may = free.data();
    double* to = X.data();
    double* told = ends.data();
    const Outcome outcome = share_out(
        static_cast<std::int64_t>(N), threads, 1,
        [&](std::int64_t first, std::int64_t count, double*) {
            const std::int64_t at = first * chain.n;
            return kernel.walks(chain, task, walk, from + at, may + at, count, to + at,
                                told + 2 * first, max_sweeps);
        });
    refuse_not_finite(outcome, "Q");
}

void second_orders(const In& R, const In& t, const InFlags& prismatic,
                   const std::vector<int>& rows, double zero, double size, const In& Q, Out out,
                   const std::string& isa, int threads) {
    const Kernel& kernel = kernel_named(isa);
    const Chain chain = chain_of(R, t, prismatic);
    const std::size_t n = static_cast<std::size_t>(chain.n);
    const pinsing::Task task = plain_task(rows);
    require(n <= pinsing::kWalkJoints && rows.size() <= n, "too many joints, or rows, for this");
    require(Q.ndim() == 2 && Q.shape(1) == n, "Q must have shape (N, n)");
    require(out.ndim() == 2 && out.shape(0) == Q.shape(0) && out.shape(1) == 6,
            "out must have shape (N, 6)");
    const double* from = Q.data();
    double* to = out.data();
    const Outcome outcome =
        share_out(static_cast<std::int64_t>(Q.shape(0)), threads, 1,
                  [&](std::int64_t first, std::int64_t count, double*) {
                      return kernel.second_orders(chain, task, zero, size, from + first * chain.n,
                                                  count, to + first * 6);
                  });
    refuse_not_finite(outcome, "Q");
}

// `speeds`: those of the tip, m/s and rad/s.
void joint_speeds(const In& rows, const InFlags& linear, const In& limits, const In& far,
                  const InFlags& turns, const InFlags& moving, const std::vector<double>& speeds,
                  int middle, int rounds, bool still, const In& J, const In& R, Out out, const std::string& isa,
                  int threads) {
    const Kernel& kernel = kernel_named(isa);
    const std::size_t n = limits.size(), k = far.size(), m = linear.size(), N = J.shape(0);
    require(1 <= n && n <= k && k <= pinsing::kSpeedColumns && 1 <= m && m <= 6 && m <= k,
            "too many joints, or rows, for this");
    require(rows.size() == 6 * m && turns.size() == k && moving.size() == n && speeds.size() == 2,
            "rows must be (m, 6), turns (k,), moving (n,), and speeds two");
    require(J.ndim() == 3 && J.shape(1) == 6 && J.shape(2) == k, "J must have shape (N, 6, k)");
    require(R.ndim() == 2 && R.shape(0) == N && R.shape(1) == n, "R must have shape (N, n)");
    require(out.ndim() == 2 && out.shape(0) == N && out.shape(1) == n + 3,
            "out must have shape (N, n + 3)");
    const pinsing::SpeedTask task{static_cast<int>(n), static_cast<int>(k), static_cast<int>(m),
                                  rows.data(), linear.data(), limits.data(), far.data(), turns.data(),
                                  moving.data(), speeds[0], speeds[1], middle, rounds, still};
    const double *from = J.data(), *widths = R.data();
    double* to = out.data();
    const Outcome outcome = share_out(
        static_cast<std::int64_t>(N), threads, 1,
        [&](std::int64_t first, std::int64_t count, double*) {
            return kernel.speeds(task, from + first * 6 * task.k, widths + first * task.n, count,
                                 to + first * (task.n + 3));
        });
    refuse_not_finite(outcome, "J or R");
}

// The sums of kernel.hpp's Tube: terms (T, 7), where each begins (S + 1,), about them (S, 9) noise,
// family (-1 of a minor, last), whether it is of a joint value, power, branch, and its joints.
void tubes(const In& terms, const std::vector<int>& start, const In& about, int families,
           double near, const In& boxes, Out out, const std::string& isa, int threads) {
    const Kernel& kernel = kernel_named(isa);
    require(terms.ndim() == 2 && about.ndim() == 2 && boxes.ndim() == 2 && out.ndim() == 2,
            "terms, about, boxes and out must have two axes");
    const std::size_t S = about.shape(0), T = terms.shape(0), N = boxes.shape(0);
    const std::size_t row = 2 * pinsing::kTubeJoints + 2 + families;
    require(terms.shape(1) == pinsing::kTubeTerm && about.shape(1) == 9 && S >= 3 &&
                S <= pinsing::kTubeSums && start.size() == S + 1 && start[0] == 0 && start[S] == static_cast<int>(T),
            "terms must be (T, 7), about (S, 9), with S + 1 starts");
    require(families >= 1 && families < pinsing::kTubeSums && boxes.shape(1) == row &&
                out.shape(0) == 2 * N && out.shape(1) == row,
            "boxes must be (N, 12 + families), out twice as many");
    std::vector<double> table;
    table.reserve(T * pinsing::kTubeColumns);
    pinsing::Tube tube{0, families, static_cast<int>(S), near, {}};
    for (std::size_t i = 0; i < S; i++) {
        require(start[i] < start[i + 1] && start[i + 1] - start[i] <= pinsing::kTubeTerms,
                "a sum has too many terms, or none");
        const double *a = about.data() + 9 * i, *from = terms.data() + pinsing::kTubeTerm * start[i];
        pinsing::TubeSum s{start[i + 1] - start[i], from, table.data() + table.size(), a[0], 0.0, 1.0,
                           {}, a[2] > 0.0, static_cast<int>(a[1]), static_cast<int>(a[3]),
                           static_cast<int>(a[4]), {}};
        for (int j = 0; j < 4; j++) {
            s.joint[j] = static_cast<int>(a[5 + j]);
            require(s.joint[j] >= 0 && s.joint[j] < pinsing::kTubeJoints, "no such joint");
        }
        tube.factors += s.family >= 0;
        require(s.family < families, "no such family");
        for (int t = 0; t < s.terms; t++) {
            const double *term = from + pinsing::kTubeTerm * t, *r = term + 2, A = term[0];
            double sum = 0.0, second[10], third[20], fourth[35], *two = second, *three = third,
                   *four = fourth;
            require(A >= 0.0, "amplitudes must not be negative");
            for (int j = 0; j < 4; j++) {
                s.uses[j] = s.uses[j] || r[j] != 0.0;
                sum += std::fabs(r[j]);
                for (int k = 0; k <= j; k++) {
                    *two++ = -A * r[j] * r[k];
                    for (int l = 0; l <= k; l++) {
                        *three++ = A * r[j] * r[k] * r[l];
                        for (int m = 0; m <= l; m++) *four++ = A * r[j] * r[k] * r[l] * r[m];
                    }
                }
            }
            table.push_back(A);
            table.insert(table.end(), second, two);
            table.insert(table.end(), 5, 0.0);
            for (int j = 0; j < 4; j++) table.push_back(-A * r[j]);
            table.insert(table.end(), third, three);
            for (int j = 0; j < 4; j++) table.push_back(A * std::fabs(r[j]));
            table.insert(table.end(), 4, 0.0);
            table.insert(table.end(), fourth, four);
            table.insert(table.end(), 5, 0.0);
            s.size += A;
            s.reach = std::max(s.reach, 1.0 + sum);
        }
        tube.sums[i] = s;
    }
    const double* from = boxes.data();
    double* to = out.data();
    const Outcome outcome = share_out(
        static_cast<std::int64_t>(N), threads, 1,
        [&](std::int64_t first, std::int64_t count, double*) {
            const std::int64_t at = first * static_cast<std::int64_t>(row);
            return kernel.tubes(tube, from + at, count, to + 2 * at);
        });
    refuse_not_finite(outcome, "boxes");
}

std::vector<std::string> isa_names() {
    std::vector<std::string> names;
    for (const Kernel* k : kernels()) names.emplace_back(k->name);
    return names;
}

// Those that were compiled, best last: an installation for one machine has one.
std::vector<std::string> built_names() {
    std::vector<std::string> names;
#if PINSING_HAVE_BASELINE
    names.emplace_back("baseline");
#endif
#if PINSING_HAVE_AVX2
    names.emplace_back("avx2");
#endif
#if PINSING_HAVE_AVX512
    names.emplace_back("avx512");
#endif
    return names;
}

}  // namespace

NB_MODULE(_kernel, m) {
    // Arms keep their conditions until the interpreter ends, in whatever order it takes modules apart;
    // the report of that as a leak would follow every test run and every interactive session.
    nb::set_leak_warnings(false);
    m.doc() = "Compiled batch kernels; use pinsing._batch.engine, which checks and falls back.";
    m.attr("MAX_RANK") = pinsing::kMaxRank;
    m.attr("MAX_COLUMNS") = pinsing::kMaxColumns;
    m.attr("MAX_JOINTS") = pinsing::kMaxJoints;
    m.attr("CHUNK") = kChunk;
    m.attr("WALK_JOINTS") = pinsing::kWalkJoints;
    m.attr("SPEED_COLUMNS") = pinsing::kSpeedColumns;
    m.attr("WALK_EQUATIONS") = pinsing::kWalkEquations;
    m.attr("SOURCES") = PINSING_SOURCES;  // of built_from.py
    m.def("isa_names", &isa_names);
    m.def("built_names", &built_names);
    m.def("jacobians", &jacobians, "R"_a.noconvert(), "t"_a.noconvert(), "prismatic"_a.noconvert(),
          "Q"_a.noconvert(), "out"_a.noconvert(), "isa"_a, "threads"_a);
    m.def("singular_values", &singular_values, "R"_a.noconvert(), "t"_a.noconvert(),
          "prismatic"_a.noconvert(), "rows"_a, "factors"_a, "Q"_a.noconvert(), "out"_a.noconvert(),
          "isa"_a, "threads"_a, "max_sweeps"_a);
    m.def("walks", &walks, "R"_a.noconvert(), "t"_a.noconvert(), "prismatic"_a.noconvert(),
          "rows"_a, "rank"_a, "size"_a, "lower"_a.noconvert(), "upper"_a.noconvert(), "rules"_a,
          "Q"_a.noconvert(), "free"_a.noconvert(), "X"_a.noconvert(), "ends"_a.noconvert(),
          "isa"_a, "threads"_a, "max_iterations"_a, "max_sweeps"_a);
    m.def("second_orders", &second_orders, "R"_a.noconvert(), "t"_a.noconvert(),
          "prismatic"_a.noconvert(), "rows"_a, "zero"_a, "size"_a, "Q"_a.noconvert(),
          "out"_a.noconvert(), "isa"_a, "threads"_a);
    m.def("joint_speeds", &joint_speeds, "rows"_a.noconvert(), "linear"_a.noconvert(),
          "limits"_a.noconvert(), "far"_a.noconvert(), "turns"_a.noconvert(),
          "moving"_a.noconvert(), "speeds"_a, "middle"_a, "rounds"_a, "still"_a,
          "J"_a.noconvert(), "R"_a.noconvert(), "out"_a.noconvert(), "isa"_a, "threads"_a);
    m.def("tubes", &tubes, "terms"_a.noconvert(), "start"_a, "about"_a.noconvert(), "families"_a,
          "near"_a, "boxes"_a.noconvert(), "out"_a.noconvert(), "isa"_a, "threads"_a);
    m.def("svdvals", &svdvals, "A"_a.noconvert(), "out"_a.noconvert(), "isa"_a, "threads"_a,
          "max_sweeps"_a, "by_roots"_a = true);
    pinsing::add_conditions(m);
    pinsing::add_residues(m);
    pinsing::add_samples(m);
    pinsing::add_poses(m);
    pinsing::add_motions(m);
}
