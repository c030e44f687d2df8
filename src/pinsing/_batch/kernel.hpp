// The interface between the Python module and the kernels, one kernel per instruction set.
//
// Plain data and plain functions only: each kernel is compiled with its own machine flags, so
// nothing inline may be shared between them and the module (the linker would keep one copy, perhaps
// one that this machine cannot run).
#pragma once

#include <cstdint>

#include "conditions.hpp"

namespace pinsing {

constexpr int kMaxRank = 6;       // the smaller side of a matrix whose singular values are taken
constexpr int kMaxColumns = 32;   // its larger side
constexpr int kMaxJoints = 1024;  // bounds the scratch memory; no arm comes near
constexpr int kWalkJoints = 16;     // of walks to rank drops
constexpr int kWalkEquations = 24;  // (m - rank + 1) (n - rank + 1)
constexpr int kSpeedColumns = 12;   // of Jacobians whose joint speeds are bounded
constexpr int kTubeTerms = 320;     // of the sums of a tube, each in four joints
constexpr int kTubeSums = 64;
constexpr int kTubeJoints = 5;
constexpr int kTubeTerm = 2 + kTubeJoints;  // an amplitude, a phase, rates
constexpr int kTubeOdd = 16, kTubeSteep = 40, kTubeFourth = 48, kTubeColumns = 88;

// Columns of a sum's table: its derivatives by up to four of its joints, 4 is none. Those of even order,
// which are of cosines, those of odd order, of sines, sizes of slopes (4,), those of fourth order.
struct TubeColumn {
    int of[5][5][5][5]{};
    constexpr TubeColumn() {
        int next[] = {0, kTubeOdd, 1, kTubeOdd + 4, kTubeFourth};
        for (int j = 0; j < 5; j++)
            for (int k = 0; k < 5; k++)
                for (int l = 0; l < 5; l++)
                    for (int m = 0; m < 5; m++)
                        of[j][k][l][m] = k < j   ? of[k][j][l][m]
                                         : l < k ? of[j][l][k][m]
                                         : m < l ? of[j][k][m][l]
                                                 : next[order(j, k, l, m)]++;
    }
    static constexpr int order(int j, int k, int l, int m) { return (j < 4) + (k < 4) + (l < 4) + (m < 4); }
};
constexpr TubeColumn kTubeColumn;

// T(q) = C_0 M_0(q_0) C_1 ... M_{n-1}(q_{n-1}) C_n with C_i = [R_i t_i; 0 1], M_i = Rz or Tz.
struct Chain {
    int n;
    const double* R;  // (n + 1, 3, 3)
    const double* t;  // (n + 1, 3)
    const bool* prismatic;  // (n,)
};

// Rows of the 6 x n Jacobian whose singular values are wanted, each times its factor.
struct Task {
    int m;
    int row[6];
    double factor[6];
};

// Singular values of a task, and of matrices m x n.
struct ValueTask {
    Chain chain;
    Task task;
};
struct MatrixTask {
    int m, n;
};

// How walks to rank drops go: see pinsing/kinematics/refine.py for each of the numbers. The chain is
// in the arm's own length: rows need no factors.
struct WalkTask : ValueTask {
    int rank;             // the generic one
    double size;          // what sigma_1 counts as at least
    const double* lower;  // (n,) joint limits, perhaps infinite
    const double* upper;
    int max_iterations;
    double floor, good, stationary, no_minimum, longest, most_damping, stretch;
};

// Tip motions and the joint speeds they may take: see pinsing/proximity/zones.py.
struct SpeedTask {
    int n, k, m;           // joints; columns of Jacobians, those of turns without a limit last; rows
    const double* rows;    // (m, 6), of translations first
    int linear;            // rows of translations
    const double* limits;  // (n,)
    const double* far;     // (k,)
    const bool* turns;     // (k,)
    const bool* moving;    // (n,)
    double tip_speed, turn_speed;
    int middle, rounds;  // 0 rounds: of one joint to spare the best right inverse
};

// A sum of cosines: see tube.hpp.
struct TubeSum {
    int terms;
    const double *term, *table;  // (terms, kTubeTerm), (terms, kTubeColumns)
    double noise, size, reach;
    bool uses[4], is_value;
    int family, power, branch, joint[4];  // and which of the joints of boxes its own are
};

// The determinant of a robot, what it is beside h prod f^m, h, and the factors f: families/tube.py.
// For an arm of seven joints the conditions of each branch in turn, and minors, each of two sums.
struct Tube {
    int factors, families, count;
    double near;
    TubeSum sums[kTubeSums];
};

// Arrays of a batch: for each of N items a row of `count` numbers. Those that go in have to be finite;
// what comes out is not wanted where `at` is null.
struct Rows {
    const char* name;
    double* at;
    int count;
};
struct Batch {
    std::int64_t N;
    Rows in[2], out[5];  // a count of zero: no more
};

struct Outcome {
    std::int64_t not_finite;  // index of the first input item that is not finite, or -1
    bool unfinished;          // whether the first number of any item is NaN: it did not converge
};

struct Kernel {
    const char* name;
    // Q (n,) -> J (6, n)
    Outcome (*jacobians)(const Chain&, const Batch&);
    // Q (n,) -> S (min(m, n),), descending; min(m, n) <= kMaxRank, max(m, n) <= kMaxColumns
    Outcome (*singular_values)(const ValueTask&, const Batch&);
    // A (m, n) -> S (min(m, n),), descending; same bounds
    Outcome (*svdvals)(const MatrixTask&, const Batch&);
    // Q, free (n,) -> X (n,), where walks end, and ends (2,): derivatives taken (-1 where a singular
    // value did not converge), 1 where the walk came to rest. At most kWalkJoints joints and
    // kWalkEquations equations; factors of the task are one.
    Outcome (*walks)(const WalkTask&, const Batch&);
    // J (6, k) at centres, half widths R (n,) -> out (3 + n,): the share of the limits there, by the
    // first order in the box, a bound in it, and what each joint's width has in that. At most
    // kSpeedColumns columns.
    Outcome (*speeds)(const SpeedTask&, const Batch&);
    // Boxes (12 + families,) -> their halves (2, 12 + families): middles and half widths (5,) of
    // the parts that may hold singular configurations; how far these are from families at most, from
    // each if all others are far, and from the nearest; the joint to halve.
    Outcome (*tubes)(const Tube&, const Batch&);
    // X (n,) -> least lower and upper bounds over the families, the family of the lower one (-1 is
    // none), the bounds of each family (families, 2); if points (families, n) are wanted closer
    // upper ones (Euclidean), which rest on these
    Outcome (*clearances)(const Conditions&, const Batch&);
};

#if PINSING_HAVE_BASELINE
extern const Kernel kernel_baseline;
#endif
#if PINSING_HAVE_AVX2
extern const Kernel kernel_avx2;
#endif
#if PINSING_HAVE_AVX512
extern const Kernel kernel_avx512;
#endif

}  // namespace pinsing
