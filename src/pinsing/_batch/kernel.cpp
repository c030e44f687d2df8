// One kernel. Compiled once for each instruction set, with its machine flags and PINSING_ISA, its name.
#include <math.h>
#include <string.h>
#if defined(__SSE2__)
#include <immintrin.h>
#endif
#if defined(__GNUC__) && !defined(__clang__)
// GCC bug 105593: its own AVX-512 header starts from an undefined vector.
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

#include "kernel.hpp"

#define PINSING_TEXT(word) #word
#define PINSING_NAME(word) PINSING_TEXT(word)
#define PINSING_JOIN(begin, end) begin##end
#define PINSING_KERNEL(isa) PINSING_JOIN(kernel_, isa)
#if defined(__clang__)
#define PINSING_UNROLL _Pragma("clang loop unroll(full)")
#else
#define PINSING_UNROLL _Pragma("GCC unroll 8")
#endif

namespace pinsing {
namespace PINSING_ISA {
namespace {

// In this order: each builds on the ones before.
#include "simd.hpp"
#include "reciprocals.hpp"
#include "sincos.hpp"
#include "jacobian.hpp"
#include "tip_jacobian.hpp"
#include "svd.hpp"
#include "roots.hpp"
#include "svd_choice.hpp"
#include "least_norm.hpp"
#include "bounds.hpp"
#include "walk.hpp"
#include "speeds.hpp"
#include "tube.hpp"

// Scratch, in blocks: q[n], J[6 n] and a copy of it; or a matrix and its transpose.
std::size_t scratch(int n) {
    const int chain = 13 * n, matrices = 2 * kMaxRank * kMaxColumns;
    return static_cast<std::size_t>(chain > matrices ? chain : matrices) * kLanes;
}

// Calls block(first, width) for the items 0..N-1 in blocks of kLanes, the last perhaps narrower.
template <class Block>
inline Outcome for_each_block(std::int64_t N, Block block) {
    Outcome outcome{-1, 0};
    for (std::int64_t first = 0; first < N; first += kLanes) {
        const int width = N - first < kLanes ? static_cast<int>(N - first) : kLanes;
        if (!block(first, width, outcome)) break;
    }
    return outcome;
}

// Loads `count` numbers of each item; false, with the item noted, where one is not finite.
inline bool load_finite(const double* in, int count, std::int64_t first, int width, V* x,
                        Outcome& outcome) {
    load_rows(in + first * count, count, width, x);
    const int wrong = first_not_finite(x, count, width);
    if (wrong >= 0) outcome.not_finite = first + wrong;
    return wrong < 0;
}

inline void store_values(V* S, int rank, std::int64_t first, int width, double* out,
                         Outcome& outcome) {
    store_rows(S, rank, width, out + first * rank);
    if (__builtin_expect(any(~(S[0] <= __builtin_inf())), 0))
        for (int i = 0; i < width; i++) outcome.unfinished += lanes(S)[i] != lanes(S)[i];
}

Outcome jacobians(const Chain& chain, const double* Q, std::int64_t N, double* out,
                  double* memory) {
    const int n = chain.n;
    V* q = reinterpret_cast<V*>(memory);
    V* J = q + n;
    return for_each_block(N, [&](std::int64_t first, int width, Outcome& outcome) {
        if (!load_finite(Q, n, first, width, q, outcome)) return false;
        jacobian_block(chain, q, J);
        store_rows(J, 6 * n, width, out + first * 6 * n);
        return true;
    });
}

// Whether the task is the six rows in order, translations times one factor, of an arm that only
// turns: then the chain may be scaled in place of the rows. t (n + 1, 3) is that of the scaled one,
// whose matrices need no scaling: rotation rows are unit vectors, and no entry is beyond kLong. (So the
// sixteenth powers of roots.hpp do not overflow for seven joints, and rarely for many more.)
constexpr double kLong = 200.0;

inline bool scaled_chain(const Chain& chain, const Task& task, double* t) {
    const int n = chain.n;
    if (task.m != 6 || n < 6 || n > kMaxColumns) return false;
    const double factor = task.factor[0];
    for (int i = 0; i < 6; i++)
        if (task.row[i] != i || task.factor[i] != (i < 3 ? factor : 1.0)) return false;
    double reach = 0.0;
    for (int k = 0; k < 3 * (n + 1); k++) {
        t[k] = chain.t[k] * factor;
        if (k >= 3) reach += t[k] < 0 ? -t[k] : t[k];
    }
    for (int i = 0; i < n; i++)
        if (chain.prismatic[i]) return false;
    return reach < kLong;
}

Outcome singular_values(const Chain& chain, const Task& task, const double* Q, std::int64_t N,
                        double* out, int max_sweeps, double* memory) {
    const int n = chain.n, m = task.m;
    V* q = reinterpret_cast<V*>(memory);
    V* J = q + n;
    V* A = J + 6 * n;
    V S[kMaxRank];
    double t[3 * (kMaxColumns + 1)];
    if (scaled_chain(chain, task, t)) {
        const Chain scaled{n, chain.R, t, chain.prismatic};
        const Svd svd = off_axis(scaled) ? svd_of(m, n, true) : svd_beside_unit(n);
        return for_each_block(N, [&](std::int64_t first, int width, Outcome& outcome) {
            if (!load_finite(Q, n, first, width, q, outcome)) return false;
            tip_jacobian_block(scaled, q, J);
            svd(J, S, max_sweeps, true);
            store_values(S, svd.rank, first, width, out, outcome);
            return true;
        });
    }
    const Svd svd = svd_of(m, n, true);
    return for_each_block(N, [&](std::int64_t first, int width, Outcome& outcome) {
        if (!load_finite(Q, n, first, width, q, outcome)) return false;
        jacobian_block(chain, q, J);
        task_matrix(task, n, J, A);
        svd(A, S, max_sweeps);
        store_values(S, svd.rank, first, width, out, outcome);
        return true;
    });
}

Outcome svdvals(const double* in, int m, int n, std::int64_t N, double* out, int max_sweeps,
                bool by_roots, double* memory) {
    const Svd svd = svd_of(m, n, by_roots);
    V* A = reinterpret_cast<V*>(memory);
    V* T = A + m * n;
    V S[kMaxRank];
    return for_each_block(N, [&](std::int64_t first, int width, Outcome& outcome) {
        if (!load_finite(in, m * n, first, width, A, outcome)) return false;
        V* wide = A;
        if (m > n) {
            for (int i = 0; i < m; i++)
                for (int j = 0; j < n; j++) T[j * m + i] = A[i * n + j];
            wide = T;
        }
        svd(wide, S, max_sweeps);
        store_values(S, svd.rank, first, width, out, outcome);
        return true;
    });
}

Outcome walks(const Chain& chain, const Task& task, const Walk& walk, const double* Q,
              const double* free, std::int64_t N, double* X, double* ends, int max_sweeps) {
    const int n = chain.n;
    const WalkTask all{chain, task, walk, max_sweeps};
    V q[kWalkJoints], movable[kWalkJoints], at_end[2];
    return for_each_block(N, [&](std::int64_t first, int width, Outcome& outcome) {
        if (!load_finite(Q, n, first, width, q, outcome)) return false;
        load_rows(free + first * n, n, width, movable);
        walk_block(all, q, movable, at_end[0], at_end[1]);
        store_rows(q, n, width, X + first * n);
        store_rows(at_end, 2, width, ends + 2 * first);
        return true;
    });
}

Outcome speeds(const SpeedTask& task, const double* J, const double* R, std::int64_t N, double* out) {
    V j[6 * kSpeedColumns], r[kSpeedColumns], told[3 + kSpeedColumns];
    One half[3 + kSpeedColumns];
    BoxOfSpeeds box(task);
    const int count = 6 * task.k;
    return for_each_block(N, [&](std::int64_t first, int width, Outcome& outcome) {
        if (!load_finite(J, count, first, width, j, outcome)) return false;
        if (!load_finite(R, task.n, first, width, r, outcome)) return false;
        for (int side = 0; side < (width > kHalf ? 2 : 1); side++) {
            const auto part = [side](V& x) -> One& { return side == 0 ? x.a : x.b; };
            for (int i = 0; i < count; i++) box.J[i] = part(j[i]);
            clear(box.r, task.k);
            for (int i = 0; i < task.n; i++)
                if (task.moving[i]) box.r[i] = part(r[i]);
            box.run(half);
            for (int i = 0; i < 3 + task.n; i++) part(told[i]) = half[i];
        }
        store_rows(told, 3 + task.n, width, out + first * (3 + task.n));
        return true;
    });
}

Outcome tubes(const Tube& p, const double* boxes, std::int64_t N, double* out) {
    constexpr int n = kTubeJoints;
    const int F = p.families, count = 2 * n + 2 + F;
    V box[2 * n + 2 + kTubeSums], halves[2 * (2 * n + 2 + kTubeSums)];
    return for_each_block(N, [&](std::int64_t first, int width, Outcome& outcome) {
        if (!load_finite(boxes, count, first, width, box, outcome)) return false;
        for (int side = 0; side < 4; side++) {
            const auto part = [side](V& v) -> One& { return side % 2 == 0 ? v.a : v.b; };
            V* half = halves + side / 2 * count;
            One x[n], h[n], far[kTubeSums];
            for (int j = 0; j < n; j++) {
                const One wide = part(box[n + j]), gap = vabs(part(box[count - 1]) - spread(j));
                const One less = select(gap < 0.5, 0.5 * wide, spread(0.0));
                x[j] = side < 2 ? part(box[j]) - less : part(box[j]) + less;
                h[j] = (wide - less) * kMore;
            }
            (p.count > 3 + p.factors ? rank_box : tube_box)(p, x, h, far, part(half[count - 1]));
            for (int j = 0; j < n; j++) {
                part(half[j]) = x[j];
                part(half[n + j]) = h[j];
            }
            for (int k = 0; k <= F; k++) part(half[2 * n + k]) = vmin(far[k], part(box[2 * n + k]));
        }
        store_rows(halves, 2 * count, width, out + first * 2 * count);
        return true;
    });
}

std::size_t condition_scratch(const Conditions& c) {
    return (branch_blocks(c.n) + static_cast<std::size_t>(c.n + (2 + c.n) * c.families)) * kLanes;
}

Outcome clearances(const Conditions& c, const double* X, std::int64_t N, double* lower,
                   double* upper, std::int64_t* family, double* each, double* points,
                   double* memory) {
    V* x = reinterpret_cast<V*>(memory);
    V* bound = x + c.n;
    V* near = bound + 2 * c.families;
    V* rest = near + c.n * c.families;
    return for_each_block(N, [&](std::int64_t first, int width, Outcome& outcome) {
        if (!load_finite(X, c.n, first, width, x, outcome)) return false;
        bounds_of_families(c, x, bound, rest);
        if (points != nullptr) {
            reach_families(c, x, bound, near, rest);
            store_rows(near, c.n * c.families, width, points + first * c.n * c.families);
        }
        if (each != nullptr)
            store_rows(bound, 2 * c.families, width, each + first * 2 * c.families);
        V low = broadcast(__builtin_inf()), high = low, of = broadcast(-1.0);
        for (int f = 0; f < c.families; f++) {
            of = select(bound[2 * f] < low, broadcast(static_cast<double>(f)), of);
            low = vmin(low, bound[2 * f]);
            high = vmin(high, bound[2 * f + 1]);
        }
        for (int i = 0; i < width; i++) {
            lower[first + i] = lanes(&low)[i];
            upper[first + i] = lanes(&high)[i];
            family[first + i] = static_cast<std::int64_t>(lanes(&of)[i]);
        }
        return true;
    });
}

}  // namespace
}  // namespace PINSING_ISA

extern const Kernel PINSING_KERNEL(PINSING_ISA){
    PINSING_NAME(PINSING_ISA),
    PINSING_ISA::kLanes,
    &PINSING_ISA::scratch,
    &PINSING_ISA::jacobians,
    &PINSING_ISA::singular_values,
    &PINSING_ISA::svdvals,
    &PINSING_ISA::walks,
    &PINSING_ISA::speeds,
    &PINSING_ISA::tubes,
    &PINSING_ISA::condition_scratch,
    &PINSING_ISA::clearances,
};

}  // namespace pinsing
