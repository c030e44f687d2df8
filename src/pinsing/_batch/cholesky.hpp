// Included inside a namespace, for numbers and for blocks of them.
//
// Solves A y = b for a symmetric A (k, k) by Cholesky's method, in place; b becomes y. With `ridge`
// times the trace on the diagonal, and `least` of it under each root, there are no pivots: any y will
// do for a bound.
template <class T>
void solve_spd(T* A, T* b, int k, double ridge, double least) {
    T trace = A[0] + 1e-300;
    for (int i = 1; i < k; i++) trace += A[i * k + i];
    for (int i = 0; i < k; i++) A[i * k + i] += trace * ridge;
    for (int i = 0; i < k; i++) {
        for (int j = 0; j <= i; j++) {
            T sum = A[i * k + j];
            for (int m = 0; m < j; m++) sum -= A[i * k + m] * A[j * k + m];
            A[i * k + j] = i == j ? vsqrt(vmax(sum, trace * least)) : sum / A[j * k + j];
        }
    }
    for (int i = 0; i < k; i++) {
        for (int m = 0; m < i; m++) b[i] -= A[i * k + m] * b[m];
        b[i] = b[i] / A[i * k + i];
    }
    for (int i = k - 1; i >= 0; i--) {
        for (int m = i + 1; m < k; m++) b[i] -= A[m * k + i] * b[m];
        b[i] = b[i] / A[i * k + i];
    }
}
