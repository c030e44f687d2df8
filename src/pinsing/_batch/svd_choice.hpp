// How the singular values of one shape of matrix are taken: bidiagonalisation, then dqds, or roots
// with dqds for the lanes where they do not settle.
using Bidiagonalise = void (*)(V*, int, V*, V*);
using Values = void (*)(V*, V*, V*, int);

struct Svd {
    int rank, columns;
    Bidiagonalise bidiagonalise;
    Values values;

    // A (rank x columns, destroyed) -> S[rank]. `ready`: entries are of order one, as they are.
    void operator()(V* A, V* S, int max_sweeps, bool ready = false) const {
        V q[kMaxRank], e[kMaxRank];
        V power = ready ? broadcast(1.0) : normalise(A, rank * columns);
        bidiagonalise(A, columns, q, e);
        values(q, e, S, max_sweeps);
        if (!ready)
            for (int k = 0; k < rank; k++) S[k] *= power;
    }
};

// Both ways, each lane by the first one that is sure of it.
template <int K, bool Wide>
static __attribute__((noinline)) void roots_or_dqds(V* q, V* e, V* S, int max_sweeps) {
    One *from = reinterpret_cast<One*>(q), *beside = reinterpret_cast<One*>(e);
    One* to = reinterpret_cast<One*>(S);
    OneMask done[2];
    for (int half = 0; half < 2; half++) {
        One a[K], b[K], x[K];
        for (int k = 0; k < K; k++) a[k] = from[2 * k + half];
        for (int k = 0; k < K - !Wide; k++) b[k] = beside[2 * k + half];
        done[half] = roots_of<K, Wide>(a, b, x);
        for (int k = 0; k < K; k++) to[2 * k + half] = x[k];
    }
    const Mask sure{done[0], done[1]};
    if (__builtin_expect(any(~sure), 0)) {
        V other[K];
        dqds<K, Wide>(q, e, other, max_sweeps);
        for (int k = 0; k < K; k++) S[k] = select(sure, S[k], other[k]);
    }
}

// Roots take longer than dqds for three values and less.
constexpr int kFewestRoots = 4;

// Matrices of up to eight columns, most arms', have code of their own.
template <int K>
static Svd svd_of_rank(int columns, bool by_roots) {
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
    Values values = &dqds<K, false>;
    if constexpr (K >= kFewestRoots) values = by_roots ? &roots_or_dqds<K, false> : values;
    return Svd{K, columns, b, values};
}

// Of an m x n matrix, taken with its smaller side first.
static Svd svd_of(int m, int n, bool by_roots) {
    const int columns = m < n ? n : m;
    switch (m < n ? m : n) {
        case 1: return svd_of_rank<1>(columns, by_roots);
        case 2: return svd_of_rank<2>(columns, by_roots);
        case 3: return svd_of_rank<3>(columns, by_roots);
        case 4: return svd_of_rank<4>(columns, by_roots);
        case 5: return svd_of_rank<5>(columns, by_roots);
        default: return svd_of_rank<6>(columns, by_roots);
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

// Of a 6 x n matrix whose last column is (0, 0, 0, 0, 0, 1), n >= 6.
static Svd svd_beside_unit(int columns) {
    switch (columns) {
        case 6: return Svd{6, 6, &bidiagonalise_beside_unit<6>, &roots_or_dqds<6, false>};
        case 7: return Svd{6, 7, &bidiagonalise_beside_unit<7>, &roots_or_dqds<6, true>};
        case 8: return Svd{6, 8, &bidiagonalise_beside_unit<8>, &roots_or_dqds<6, true>};
        default: return Svd{6, columns, &bidiagonalise_beside_unit<0>, &roots_or_dqds<6, true>};
    }
}
