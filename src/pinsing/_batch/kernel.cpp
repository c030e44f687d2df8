// One kernel. Compiled once for each instruction set, with its machine flags and PINSING_ISA, its name.
#include <math.h>
#include <string.h>

#include <new>
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
#include "least_norm.hpp"
#include "jacobian.hpp"
#include "tip_jacobian.hpp"
#include "svd.hpp"
#include "roots.hpp"
#include "svd_choice.hpp"
#include "sums.hpp"
#include "bounds.hpp"
#include "walk.hpp"
#include "speeds.hpp"
#include "tube.hpp"

// Room for so many blocks.
struct Memory {
    V* at;
    explicit Memory(int count) : at(static_cast<V*>(::operator new(count * sizeof(V), kAlign))) {}
    ~Memory() { ::operator delete(at, kAlign); }
    Memory(const Memory&) = delete;
    static constexpr std::align_val_t kAlign{64};
};

// Calls block(in, out, scratch, width) for kLanes items at a time, the last ones perhaps fewer, with as
// much scratch as is asked for, in blocks.
template <class Block>
inline Outcome for_each_block(const Batch& all, int scratch, Block block) {
    int size = scratch;
    for (const Rows& rows : all.in) size += rows.count;
    for (const Rows& rows : all.out) size += rows.count;
    Memory memory(size);
    V *in[2], *out[5], *rest = memory.at;
    for (int k = 0; k < 2; rest += all.in[k++].count) in[k] = rest;
    for (int k = 0; k < 5; rest += all.out[k++].count) out[k] = rest;
    Outcome outcome{-1, false};
    for (std::int64_t first = 0; first < all.N; first += kLanes) {
        const int width = all.N - first < kLanes ? static_cast<int>(all.N - first) : kLanes;
        for (int k = 0; k < 2 && all.in[k].count > 0; k++) {
            const int count = all.in[k].count;
            load_rows(all.in[k].at + first * count, count, width, in[k]);
            const int wrong = first_not_finite(in[k], count, width);
            if (wrong >= 0) return {first + wrong, outcome.unfinished};
        }
        block(in, out, rest, width);
        for (int k = 0; k < 5 && all.out[k].count > 0; k++) {
            const int count = all.out[k].count;
            if (all.out[k].at != nullptr) store_rows(out[k], count, width, all.out[k].at + first * count);
        }
        if (__builtin_expect(any(~(out[0][0] <= __builtin_inf())), 0)) outcome.unfinished = true;
    }
    return outcome;
}

Outcome jacobians(const Chain& chain, const Batch& all) {
    return for_each_block(all, 0, [&](V** in, V** out, V*, int) { jacobian_block(chain, in[0], out[0]); });
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

Outcome singular_values(const ValueTask& wanted, const Batch& all) {
    const auto& [chain, task] = wanted;
    const int n = chain.n;
    const Svd svd = svd_of(task.m, n);
    double t[3 * (kMaxColumns + 1)];
    if (scaled_chain(chain, task, t)) {
        const Chain scaled{n, chain.R, t, chain.prismatic};
        return for_each_block(all, 6 * n, [&](V** in, V** out, V* J, int) {
            tip_jacobian_block(scaled, in[0], J);
            svd(J, out[0], true);
        });
    }
    return for_each_block(all, 12 * n, [&](V** in, V** out, V* J, int) {
        jacobian_block(chain, in[0], J);
        task_matrix(task, n, J, J + 6 * n);
        svd(J + 6 * n, out[0]);
    });
}

Outcome svdvals(const MatrixTask& wanted, const Batch& all) {
    const auto& [m, n] = wanted;
    const Svd svd = svd_of(m, n);
    return for_each_block(all, m * n, [&](V** in, V** out, V* wide, int) {
        for (int i = 0; i < m && m > n; i++)
            for (int j = 0; j < n; j++) wide[j * m + i] = in[0][i * n + j];
        svd(m > n ? wide : in[0], out[0]);
    });
}

Outcome walks(const WalkTask& task, const Batch& all) {
    const int n = task.chain.n;
    return for_each_block(all, n, [&](V** in, V** out, V*, int) {
        for (int j = 0; j < n; j++) out[0][j] = in[0][j];
        walk_block(task, out[0], in[1], out[1][0], out[1][1]);
    });
}

// One half of a block.
PINSING_INLINE One& half_of(V& x, int side) { return side == 0 ? x.a : x.b; }

Outcome speeds(const SpeedTask& task, const Batch& all) {
    One told[3 + kSpeedColumns];
    BoxOfSpeeds box(task);
    return for_each_block(all, 0, [&](V** in, V** out, V*, int width) {
        for (int side = 0; side < (width > kHalf ? 2 : 1); side++) {
            for (int i = 0; i < 6 * task.k; i++) box.J.at[i] = half_of(in[0][i], side);
            clear(box.r, task.k);
            for (int i = 0; i < task.n; i++)
                if (task.moving[i]) box.r[i] = half_of(in[1][i], side);
            box.run(told);
            for (int i = 0; i < 3 + task.n; i++) half_of(out[0][i], side) = told[i];
        }
    });
}

Outcome tubes(const Tube& p, const Batch& all) {
    constexpr int n = kTubeJoints;
    const int F = p.families, count = 2 * n + 2 + F;
    return for_each_block(all, 0, [&](V** in, V** out, V*, int) {
        for (int side = 0; side < 4; side++) {
            const auto box = [&](int k) { return half_of(in[0][k], side % 2); };
            const auto half = [&](int k) -> One& { return half_of(out[0][side / 2 * count + k], side % 2); };
            One x[n], h[n], far[kTubeSums];
            for (int j = 0; j < n; j++) {
                const One wide = box(n + j), gap = vabs(box(count - 1) - spread(j));
                const One less = select(gap < 0.5, 0.5 * wide, spread(0.0));
                x[j] = side < 2 ? box(j) - less : box(j) + less;
                h[j] = (wide - less) * kMore;
            }
            (p.count > 3 + p.factors ? rank_box : tube_box)(p, x, h, far, half(count - 1));
            for (int j = 0; j < n; j++) {
                half(j) = x[j];
                half(n + j) = h[j];
            }
            for (int k = 0; k <= F; k++) half(2 * n + k) = vmin(far[k], box(2 * n + k));
        }
    });
}

Outcome clearances(const Conditions& c, const Batch& all) {
    return for_each_block(all, branch_blocks(c.n), [&](V** in, V** out, V* rest, int) {
        V &low = out[0][0], &high = out[1][0], &of = out[2][0];
        V* bound = out[3];
        bounds_of_families(c, in[0], bound, rest);
        if (all.out[4].at != nullptr) reach_families(c, in[0], bound, out[4], rest);
        low = high = broadcast(__builtin_inf());
        of = broadcast(-1.0);
        for (int f = 0; f < c.families; f++) {
            of = select(bound[2 * f] < low, broadcast(static_cast<double>(f)), of);
            low = vmin(low, bound[2 * f]);
            high = vmin(high, bound[2 * f + 1]);
        }
    });
}

}  // namespace
}  // namespace PINSING_ISA

extern const Kernel PINSING_KERNEL(PINSING_ISA){
    PINSING_NAME(PINSING_ISA),      &PINSING_ISA::jacobians, &PINSING_ISA::singular_values,
    &PINSING_ISA::svdvals,          &PINSING_ISA::walks,     &PINSING_ISA::speeds,
    &PINSING_ISA::tubes,            &PINSING_ISA::clearances,
};

}  // namespace pinsing
