// pinsing._batch._kernel: the kernels as Python functions over NumPy arrays.
//
// Checks shapes (memory safety), picks the kernel, shares the work out. Chunks have a fixed size
// and each item is computed alone, so results do not depend on the number of threads.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "kernel.hpp"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace {

using pinsing::Chain;
using pinsing::Kernel;
using pinsing::Outcome;

using In = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using InFlags = nb::ndarray<const bool, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<double, nb::c_contig, nb::device::cpu>;

constexpr std::int64_t kChunk = 2048;
constexpr int kMaxThreads = 4096;

// The kernels that this machine can run, best last.
const std::vector<const Kernel*>& kernels() {
    static const std::vector<const Kernel*> found = [] {
        std::vector<const Kernel*> all{&pinsing::kernel_baseline};
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

const Kernel& kernel_named(const std::string& isa) {
    for (const Kernel* k : kernels())
        if (isa == k->name) return *k;
    throw nb::value_error(("this machine cannot run the instruction set '" + isa + "'").c_str());
}

void require(bool condition, const char* what) {
    if (!condition) throw nb::value_error(what);
}

struct FreeAligned {
    void operator()(double* p) const {
        ::operator delete(p, std::align_val_t(pinsing::kScratchAlign));
    }
};
using Scratch = std::unique_ptr<double, FreeAligned>;

Scratch allocate(std::size_t doubles) {
    return Scratch(static_cast<double*>(
        ::operator new(doubles * sizeof(double), std::align_val_t(pinsing::kScratchAlign))));
}

// Runs item ranges on up to `threads` threads, without the GIL.
// work(first, count, scratch) -> Outcome with indices relative to first.
template <class Work>
Outcome share_out(std::int64_t N, int threads, std::size_t scratch, Work work) {
    const std::int64_t chunks = (N + kChunk - 1) / kChunk;
    const int most = static_cast<int>(std::clamp<std::int64_t>(chunks, 1, kMaxThreads));
    const int workers = std::clamp(threads, 1, most);
    std::vector<Scratch> memory;
    for (int i = 0; i < workers; i++) memory.push_back(allocate(scratch));
    std::vector<std::thread> team;
    team.reserve(static_cast<std::size_t>(workers));

    std::atomic<std::int64_t> next{0};
    std::atomic<bool> stop{false};
    std::mutex lock;
    Outcome total{-1, 0};
    // Chunks are taken in order and each runs to its first bad item, so the least one is found
    // whichever thread is faster.
    auto run = [&](int worker) noexcept {
        while (!stop.load(std::memory_order_relaxed)) {
            const std::int64_t first = next.fetch_add(kChunk);
            if (first >= N) break;
            const Outcome part = work(first, std::min(kChunk, N - first), memory[worker].get());
            if (part.not_finite < 0 && part.unfinished == 0) continue;
            const std::lock_guard<std::mutex> guard(lock);
            total.unfinished += part.unfinished;
            if (part.not_finite >= 0) {
                const std::int64_t item = first + part.not_finite;
                if (total.not_finite < 0 || item < total.not_finite) total.not_finite = item;
                stop = true;
            }
        }
    };

    const nb::gil_scoped_release release;
    for (int i = 1; i < workers; i++) {
        try {
            team.emplace_back(run, i);
        } catch (const std::exception&) {
            break;  // the system gives no more threads: go on with those there are
        }
    }
    run(0);
    for (std::thread& thread : team) thread.join();
    return total;
}

void refuse_not_finite(const Outcome& outcome, const char* name) {
    if (outcome.not_finite < 0) return;
    throw nb::value_error((std::string(name) + "[" + std::to_string(outcome.not_finite) +
                           "] holds a value that is not finite")
                              .c_str());
}

Chain chain_of(const In& R, const In& t, const InFlags& prismatic) {
    require(prismatic.ndim() == 1, "prismatic must have shape (n,)");
    const std::size_t n = prismatic.shape(0);
    require(n >= 1 && n <= pinsing::kMaxJoints, "the number of joints is out of range");
    require(R.ndim() == 3 && R.shape(0) == n + 1 && R.shape(1) == 3 && R.shape(2) == 3,
            "R must have shape (n + 1, 3, 3)");
    require(t.ndim() == 2 && t.shape(0) == n + 1 && t.shape(1) == 3,
            "t must have shape (n + 1, 3)");
    return Chain{static_cast<int>(n), R.data(), t.data(), prismatic.data()};
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

std::int64_t svdvals(const In& A, Out out, const std::string& isa, int threads, int max_sweeps) {
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
                                            max_sweeps, scratch);
                  });
    refuse_not_finite(outcome, "the matrix");
    return outcome.unfinished;
}

std::vector<std::string> isa_names() {
    std::vector<std::string> names;
    for (const Kernel* k : kernels()) names.emplace_back(k->name);
    return names;
}

}  // namespace

NB_MODULE(_kernel, m) {
    m.doc() = "Compiled batch kernels; use pinsing._batch.engine, which checks and falls back.";
    m.attr("MAX_RANK") = pinsing::kMaxRank;
    m.attr("MAX_COLUMNS") = pinsing::kMaxColumns;
    m.attr("MAX_JOINTS") = pinsing::kMaxJoints;
    m.attr("CHUNK") = kChunk;
    m.def("isa_names", &isa_names);
    m.def("jacobians", &jacobians, "R"_a.noconvert(), "t"_a.noconvert(), "prismatic"_a.noconvert(),
          "Q"_a.noconvert(), "out"_a.noconvert(), "isa"_a, "threads"_a);
    m.def("singular_values", &singular_values, "R"_a.noconvert(), "t"_a.noconvert(),
          "prismatic"_a.noconvert(), "rows"_a, "factors"_a, "Q"_a.noconvert(), "out"_a.noconvert(),
          "isa"_a, "threads"_a, "max_sweeps"_a);
    m.def("svdvals", &svdvals, "A"_a.noconvert(), "out"_a.noconvert(), "isa"_a, "threads"_a,
          "max_sweeps"_a);
}
