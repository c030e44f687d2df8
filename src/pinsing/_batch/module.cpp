// pinsing._batch._kernel: the kernels as Python functions over NumPy arrays.
//
// Checks shapes (memory safety), picks the kernel, shares the work out. Chunks have a fixed size
// and each item is computed alone, so results do not depend on the number of threads.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "module.hpp"
#include "share_out.hpp"

namespace nb = nanobind;

namespace pinsing {
namespace {

// The kernels that were compiled, best last (an installation for one machine has one), and whether this
// machine can run them.
struct Built {
    const Kernel* kernel;
    bool runs;
};

const std::vector<Built>& built() {
    static const std::vector<Built> all{
#if PINSING_HAVE_BASELINE
        {&kernel_baseline, true},
#endif
#if PINSING_HAVE_AVX2
        {&kernel_avx2, __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")},
#endif
#if PINSING_HAVE_AVX512
        {&kernel_avx512,
         __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") &&
             __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")},
#endif
    };
    return all;
}

}  // namespace

const Kernel& kernel_named(const std::string& isa) {
    for (const auto& [kernel, runs] : built())
        if (runs && isa == kernel->name) return *kernel;
    throw nb::value_error(("this machine cannot run the instruction set '" + isa + "'").c_str());
}

void require(bool condition, const char* what) {
    if (!condition) throw nb::value_error(what);
}

Chain chain_of(const In& R, const In& t, const InFlags& prismatic) {
    const std::size_t n = prismatic.size();
    require(n >= 1 && n <= kMaxJoints, "the number of joints is out of range");
    require_shape(R, "R", {n + 1, 3, 3});
    require_shape(t, "t", {n + 1, 3});
    return Chain{static_cast<int>(n), R.data(), t.data(), prismatic.data()};
}

namespace {

nb::object jacobians(const In& R, const In& t, const InFlags& prismatic, const In& Q,
                     const std::string& isa, int threads) {
    const Chain chain = chain_of(R, t, prismatic);
    Arrays all("Q", Q, {prismatic.size()});
    const nb::object J = all.make({6, prismatic.size()});
    share(kernel_named(isa).jacobians, chain, all, threads);
    return J;
}

// The task of these rows times their factors.
Task task_of(const std::vector<int>& rows, const std::vector<double>& factors) {
    require(!rows.empty() && rows.size() <= 6 && rows.size() == factors.size(),
            "rows and factors must have the same length, 1 to 6");
    Task task{};
    task.m = static_cast<int>(rows.size());
    for (std::size_t i = 0; i < rows.size(); i++) {
        require(rows[i] >= 0 && rows[i] < 6, "rows must be in 0..5");
        task.row[i] = rows[i];
        task.factor[i] = factors[i];
    }
    return task;
}

nb::object singular_values(const In& R, const In& t, const InFlags& prismatic, const std::vector<int>& rows,
                           const std::vector<double>& factors, const In& Q, const std::string& isa,
                           int threads) {
    const ValueTask task{chain_of(R, t, prismatic), task_of(rows, factors)};
    require(task.chain.n <= kMaxColumns, "too many joints for the compiled singular values");
    Arrays all("Q", Q, {prismatic.size()});
    const nb::object S = all.make({std::min(rows.size(), prismatic.size())});
    require(!share(kernel_named(isa).singular_values, task, all, threads), "a Jacobian overflows");
    return S;
}

nb::object svdvals(const In& A, const std::string& isa, int threads) {
    require(A.ndim() == 3, "the matrices must have shape (N, m, n)");
    const std::size_t m = A.shape(1), n = A.shape(2), rank = std::min(m, n);
    require(rank >= 1 && rank <= kMaxRank && std::max(m, n) <= kMaxColumns,
            "matrices of this size are not covered");
    const MatrixTask task{static_cast<int>(m), static_cast<int>(n)};
    Arrays all("the matrix", A, {m, n});
    const nb::object S = all.make({rank});
    share(kernel_named(isa).svdvals, task, all, threads);
    return S;
}

// `rules`: floor, good, stationary, no_minimum, longest, most_damping, stretch of WalkTask.
nb::tuple walks(const In& R, const In& t, const InFlags& prismatic, const std::vector<int>& rows, int rank,
                double size, const In& lower, const In& upper, const std::vector<double>& rules,
                const In& Q, const In& free, const std::string& isa, int threads, int max_iterations) {
    const std::size_t n = prismatic.size();
    require(rules.size() == 7, "there are seven rules");
    require_shape(lower, "lower", {n});
    require_shape(upper, "upper", {n});
    const std::vector<double> plain(rows.size(), 1.0);
    const WalkTask task{{chain_of(R, t, prismatic), task_of(rows, plain)}, rank, size, lower.data(),
                        upper.data(), max_iterations, rules[0], rules[1], rules[2], rules[3],
                        rules[4], rules[5], rules[6]};
    const int m = task.task.m;
    require(n <= kWalkJoints, "too many joints for compiled walks");
    require(rank >= 1 && rank <= std::min(m, task.chain.n), "impossible rank");
    require((m - rank + 1) * (task.chain.n - rank + 1) <= kWalkEquations, "too many equations");
    Arrays all("Q", Q, {n});
    all.add("free", free, {n});
    const nb::object X = all.make({n}), ends = all.make({2});
    share(kernel_named(isa).walks, task, all, threads);
    return nb::make_tuple(X, ends);
}

// `linear`: how many rows are translations. `speeds`: those of the tip, m/s and rad/s.
nb::object joint_speeds(const In& rows, int linear, const In& limits, const In& far,
                        const InFlags& turns, const InFlags& moving, const std::vector<double>& speeds,
                        int middle, int rounds, const In& J, const In& R, const std::string& isa,
                        int threads) {
    const std::size_t n = limits.size(), k = far.size(), m = rows.size() / 6;
    require(1 <= n && n <= k && k <= kSpeedColumns && 1 <= m && m <= 6 && m <= k,
            "too many joints, or rows, for this");
    require(rows.size() == 6 * m && turns.size() == k && moving.size() == n && speeds.size() == 2,
            "rows must be (m, 6), turns (k,), moving (n,), and speeds two");
    const SpeedTask task{static_cast<int>(n), static_cast<int>(k), static_cast<int>(m), rows.data(),
                         linear, limits.data(), far.data(), turns.data(), moving.data(), speeds[0],
                         speeds[1], middle, rounds};
    require(0 <= linear && linear <= task.m, "there are not so many rows");
    require(0 <= middle && middle < task.k, "no such joint");
    Arrays all("J or R", J, {6, k});
    all.add("R", R, {n});
    const nb::object out = all.make({3 + n});
    share(kernel_named(isa).speeds, task, all, threads);
    return out;
}

// The sums of kernel.hpp's Tube: terms (T, 7), where each begins (S + 1,), about them (S, 9) noise,
// family (-1 of a minor, last), whether it is of a joint value, power, branch, and its joints.
nb::object tubes(const In& terms, const std::vector<int>& start, const In& about, int families,
                 double near, const In& boxes, const std::string& isa, int threads) {
    require(terms.ndim() == 2 && about.ndim() == 2, "terms and about must have two axes");
    const std::size_t S = about.shape(0), T = terms.shape(0);
    require(terms.shape(1) == kTubeTerm && about.shape(1) == 9 && S >= 3 &&
                S <= kTubeSums && start.size() == S + 1 && start[0] == 0 &&
                start[S] == static_cast<int>(T),
            "terms must be (T, 7), about (S, 9), with S + 1 starts");
    require(families >= 1 && families < kTubeSums, "too many families, or none");
    std::vector<double> table;
    table.reserve(T * kTubeColumns);
    Tube tube{0, families, static_cast<int>(S), near, {}};
    for (std::size_t i = 0; i < S; i++) {
        require(start[i] < start[i + 1] && start[i + 1] - start[i] <= kTubeTerms,
                "a sum has too many terms, or none");
        const double *a = about.data() + 9 * i, *from = terms.data() + kTubeTerm * start[i];
        TubeSum s{start[i + 1] - start[i], from, table.data() + table.size(), a[0], 0.0, 1.0,
                           {}, a[2] > 0.0, static_cast<int>(a[1]), static_cast<int>(a[3]),
                           static_cast<int>(a[4]), {}};
        for (int j = 0; j < 4; j++) {
            s.joint[j] = static_cast<int>(a[5 + j]);
            require(s.joint[j] >= 0 && s.joint[j] < kTubeJoints, "no such joint");
        }
        tube.factors += s.family >= 0;
        require(s.family < families, "no such family");
        for (int t = 0; t < s.terms; t++) {
            const double *term = from + kTubeTerm * t, *r = term + 2, A = term[0];
            double sum = 0.0, row[kTubeColumns] = {};
            require(A >= 0.0, "amplitudes must not be negative");
            for (int j = 0; j < 4; j++) {
                s.uses[j] = s.uses[j] || r[j] != 0.0;
                sum += std::fabs(r[j]);
                row[kTubeSteep + j] = A * std::fabs(r[j]);
            }
            const auto by = [&](int j) { return j < 4 ? r[j] : 1.0; };
            constexpr double signs[] = {1.0, -1.0, -1.0, 1.0, 1.0};
            for (int j = 0; j < 5; j++)
                for (int k = j; k < 5; k++)
                    for (int l = k; l < 5; l++)
                        for (int m = l; m < 5; m++)
                            row[kTubeColumn.of[j][k][l][m]] =
                                signs[TubeColumn::order(j, k, l, m)] * A * by(m) * by(l) * by(k) * by(j);
            table.insert(table.end(), std::begin(row), std::end(row));
            s.size += A;
            s.reach = std::max(s.reach, 1.0 + sum);
        }
        tube.sums[i] = s;
    }
    const std::size_t row = 2 * kTubeJoints + 2 + families;
    Arrays all("boxes", boxes, {row});
    const nb::object halves = all.make({2, row});
    share(kernel_named(isa).tubes, tube, all, threads);
    return halves;
}

std::vector<std::string> names(bool all) {
    std::vector<std::string> out;
    for (const auto& [kernel, runs] : built())
        if (all || runs) out.emplace_back(kernel->name);
    return out;
}

std::vector<std::string> isa_names() { return names(false); }
std::vector<std::string> built_names() { return names(true); }

}  // namespace
}  // namespace pinsing

NB_MODULE(_kernel, m) {
    using namespace pinsing;
    // Arms keep their conditions until the interpreter ends, in whatever order it takes modules apart;
    // the report of that as a leak would follow every test run and every interactive session.
    nb::set_leak_warnings(false);
    m.doc() = "Compiled batch kernels; use pinsing._batch.engine, which checks and falls back.";
    m.attr("MAX_RANK") = kMaxRank;
    m.attr("MAX_COLUMNS") = kMaxColumns;
    m.attr("MAX_JOINTS") = kMaxJoints;
    m.attr("CHUNK") = kChunk;
    m.attr("WALK_JOINTS") = kWalkJoints;
    m.attr("SPEED_COLUMNS") = kSpeedColumns;
    m.attr("WALK_EQUATIONS") = kWalkEquations;
    m.attr("SOURCES") = PINSING_SOURCES;  // of built_from.py
    define(m, "isa_names", &isa_names);
    define(m, "built_names", &built_names);
    define(m, "jacobians", &jacobians);
    define(m, "singular_values", &singular_values);
    define(m, "walks", &walks);
    define(m, "joint_speeds", &joint_speeds);
    define(m, "tubes", &tubes);
    define(m, "svdvals", &svdvals);
    add_conditions(m);
    add_samples(m);
    add_poses(m);
    add_motions(m);
}
