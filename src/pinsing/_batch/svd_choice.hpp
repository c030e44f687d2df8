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

// Matrices of up to eight columns, most arms', have code of their own.
template <int K, int L = 8>
static Bidiagonalise bidiagonalise_of(int columns) {
    if constexpr (L < K || K < 3) return &bidiagonalise<K, 0>;
    else return columns == L ? &bidiagonalise<K, L> : bidiagonalise_of<K, L - 1>(columns);
}

// Of an m x n matrix, taken with its smaller side first.
template <int K = kMaxRank>
static Svd svd_of(int m, int n) {
    const int columns = m < n ? n : m;
    if constexpr (K > 1)
        if ((m < n ? m : n) < K) return svd_of<K - 1>(m, n);
    Values values = &by_rotations<K>;
    if constexpr (K >= 3) values = &roots_or_rotations<K>;  // which take longer for two values
    return Svd{K, columns, bidiagonalise_of<K>(columns), values};
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
