// How the singular values of one shape of matrix are taken: bidiagonalisation, then roots, with
// rotations for the lanes where they do not settle.
using Bidiagonalise = void (*)(V*, int, V*, V*);
using Values = void (*)(const V*, const V*, V*);

struct Svd {
    int rank, columns;
    Bidiagonalise bidiagonalise;
    Values values;

    // A (rank x columns, destroyed) -> S[rank]. `ready`: entries are of order one, as they are.
    void operator()(V* A, V* S, bool ready = false) const {
        V q[kMaxRank], e[kMaxRank];
        V power = ready ? broadcast(1.0) : normalise(A, rank * columns);
        bidiagonalise(A, columns, q, e);
        values(q, e, S);
        if (!ready)
            for (int k = 0; k < rank; k++) S[k] *= power;
    }
};

// Both ways, each lane by the first one that is sure of it.
template <int K>
static __attribute__((noinline)) void roots_or_rotations(const V* q, const V* e, V* S) {
    const One *from = reinterpret_cast<const One*>(q), *beside = reinterpret_cast<const One*>(e);
    One* to = reinterpret_cast<One*>(S);
    OneMask done[2];
    for (int half = 0; half < 2; half++) {
        One a[K], b[K], x[K];
        for (int k = 0; k < K; k++) a[k] = from[2 * k + half];
        for (int k = 0; k < K - 1; k++) b[k] = beside[2 * k + half];
        done[half] = roots_of<K>(a, b, x);
        for (int k = 0; k < K; k++) to[2 * k + half] = x[k];
    }
    const Mask sure{done[0], done[1]};
    if (__builtin_expect(any(~sure), 0)) {
        V other[K];
        by_rotations<K>(q, e, other);
        for (int k = 0; k < K; k++) S[k] = select(sure, S[k], other[k]);
    }
}

// Roots take longer than rotations for two values.
constexpr int kFewestRoots = 3;

// Matrices of up to eight columns, most arms', have code of their own.
template <int K>
static Svd svd_of_rank(int columns) {
    Bidiagonalise b = &bidiagonalise<K, 0>;
    if constexpr (K >= 3) {
        switch (columns) {
            case 3: if constexpr (K <= 3) b = &bidiagonalise<K, 3>; break;
            case 4: if constexpr (K <= 4) b = &bidiagonalise<K, 4>; break;
            case 5: if constexpr (K <= 5) b = &bidiagonalise<K, 5>; break;
            case 6: b = &bidiagonalise<K, 6>; break;
            case 7: b = &bidiagonalise<K, 7>; break;
            case 8: b = &bidiagonalise<K, 8>; break;
            default: break;
        }
    }
    if constexpr (K >= kFewestRoots) return Svd{K, columns, b, &roots_or_rotations<K>};
    return Svd{K, columns, b, &by_rotations<K>};
}

// Of an m x n matrix, taken with its smaller side first.
static Svd svd_of(int m, int n) {
    const int columns = m < n ? n : m;
    switch (m < n ? m : n) {
        case 1: return svd_of_rank<1>(columns);
        case 2: return svd_of_rank<2>(columns);
        case 3: return svd_of_rank<3>(columns);
        case 4: return svd_of_rank<4>(columns);
        case 5: return svd_of_rank<5>(columns);
        default: return svd_of_rank<6>(columns);
    }
}

// Rows of the task, each times its factor, as such a matrix.
PINSING_INLINE void task_matrix(const Task& task, int n, const V* J, V* A) {
    const int m = task.m;
    for (int i = 0; i < m; i++) {
        const V* row = J + task.row[i] * n;
        const double factor = task.factor[i];
        if (m <= n) {
            for (int j = 0; j < n; j++) A[i * n + j] = row[j] * factor;
        } else {
            for (int j = 0; j < n; j++) A[j * m + i] = row[j] * factor;
        }
    }
}
