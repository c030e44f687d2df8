// Included inside a namespace, for numbers and for blocks of them.

// The product of two rows.
template <class T>
T dot(const T* x, const T* y, int n) {
    T sum{};
    for (int i = 0; i < n; i++) sum += x[i] * y[i];
    return sum;
}

// Solves A y = b for a symmetric A (k, k), in place, and each of so many b (k,), which become y. With
// `ridge` times the trace on the diagonal, and pivots of at least `least` of it, rows are not exchanged:
// any y will do for a bound.
template <class T>
void solve_spd(T* A, T* b, int k, double ridge, double least, int count = 1) {
    T trace = A[0] + 1e-300;
    for (int i = 1; i < k; i++) trace += A[i * k + i];
    for (int p = 0; p < k; p++) {
        A[p * k + p] = vmax(A[p * k + p] + trace * ridge, trace * least);
        for (int i = p + 1; i < k; i++) {
            const T factor = A[i * k + p] / A[p * k + p];
            for (int j = p + 1; j < k; j++) A[i * k + j] -= factor * A[p * k + j];
            for (T* y = b; y != b + count * k; y += k) y[i] -= factor * y[p];
        }
    }
    for (T* y = b; y != b + count * k; y += k)
        for (int i = k - 1; i >= 0; i--) {
            for (int m = i + 1; m < k; m++) y[i] -= A[i * k + m] * y[m];
            y[i] = y[i] / A[i * k + i];
        }
}

// The multiples y (k,) of the rows g(i) (n,) of G whose sum is the least step against values y: they
// solve G G^T y = values, likewise.
template <class T, class Row>
void least_norm(Row g, int k, int n, T* y, double ridge, double least) {
    T gram[kMaxCombined * kMaxCombined];
    for (int i = 0; i < k; i++)
        for (int m = 0; m <= i; m++) gram[i * k + m] = gram[m * k + i] = dot(g(i), g(m), n);
    solve_spd(gram, y, k, ridge, least);
}
