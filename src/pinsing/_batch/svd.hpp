// Singular values of a block of matrices: Householder bidiagonalisation, then the eigenvalues of the
// bidiagonal matrix's square all at once (roots.hpp), with rotations where these do not settle.
//
// A block holds one k x l matrix (k <= l) in each lane, entry (i, j) at A[i * l + j]. Values are
// accurate to 5e-15 of the largest one of their matrix, small ones included, as LAPACK's are.
// (Eigenvalues of A A^T would lose half of the digits.) No more is meant: the bidiagonalisation
// mixes rows, so values below that of a graded matrix have no correct digits of their own.
//
// Golub and Kahan (1965), "Calculating the singular values and pseudo-inverse of a matrix".

// Below this, a sum of squares of the normalised matrix is no more than zero: entries under 1e-100
// of the largest one.
constexpr double kZeroSquare = 1.0e-200;

// Divides each matrix by a power of two that brings its largest entry near one (exact; keeps the
// squares away from overflow and underflow). Returns the power.
PINSING_INLINE V normalise(V* A, int count) {
    V largest = vabs(A[0]);
    for (int k = 1; k < count; k++) largest = vmax(largest, vabs(A[k]));
    V power = value(bits(largest) & INT64_C(0x7ff0000000000000));
    power = vmax(vmin(power, 0x1p1021), 0x1p-1022);
    V inverse = value(INT64_C(0x7fd0000000000000) - bits(power));
    for (int k = 0; k < count; k++) A[k] *= inverse;
    return power + power;
}

// Turns x0 into the first entry of the Householder vector v = x + sign(x0) |x| e0, with `square` =
// |x|^2, and returns 2 / |v|^2; 0 for x = 0.
PINSING_INLINE V reflector(V& x0, V square) {
    Mask some = square > kZeroSquare;
    V norm = select(some, vsqrt(square), broadcast(0.0));
    V factor = 1.0 / (square + norm * vabs(x0));
    x0 += copysign(norm, x0);
    return select(some, factor, broadcast(0.0));
}

// A -> squares of the diagonal q[k] and of the superdiagonal e[k - 1] of a bidiagonal matrix with
// the same singular values. A is destroyed. L is the number of columns, or 0 for `columns`.
template <int K, int L>
static __attribute__((noinline)) void bidiagonalise(V* A, int columns, V* q, V* e) {
    const int l = L > 0 ? L : columns;
#define AT(i, j) A[(i) * l + (j)]
    PINSING_UNROLL
    for (int k = 0; k < K; k++) {
        {  // row k, entries k..l-1: reflect onto (k, k)
            V square = AT(k, k) * AT(k, k);
            for (int c = k + 1; c < l; c++) square += AT(k, c) * AT(k, c);
            q[k] = square;
            if (k < K - 1) {
                V factor = reflector(AT(k, k), square);
                PINSING_UNROLL
                for (int i = k + 1; i < K; i++) {
                    V dot = AT(k, k) * AT(i, k);
                    for (int c = k + 1; c < l; c++) dot += AT(k, c) * AT(i, c);
                    dot *= factor;
                    for (int c = k; c < l; c++) AT(i, c) -= dot * AT(k, c);
                }
            }
        }
        if (k < K - 1) {  // column k below the diagonal: reflect onto (k + 1, k)
            V square = AT(k + 1, k) * AT(k + 1, k);
            PINSING_UNROLL
            for (int i = k + 2; i < K; i++) square += AT(i, k) * AT(i, k);
            e[k] = square;
            if (k < K - 2) {
                V factor = reflector(AT(k + 1, k), square);
                for (int c = k + 1; c < l; c++) {
                    V dot = AT(k + 1, k) * AT(k + 1, c);
                    PINSING_UNROLL
                    for (int i = k + 2; i < K; i++) dot += AT(i, k) * AT(i, c);
                    dot *= factor;
                    PINSING_UNROLL
                    for (int i = k + 1; i < K; i++) AT(i, c) -= dot * AT(i, k);
                }
            }
        }
    }
#undef AT
}

// Turns `count` columns of `length` entries each to orthogonal ones, longest first, and `more`
// entries behind them along, by one-sided Jacobi rotations (Hestenes 1958; de Rijk 1989 for the order
// of columns), which find small singular values and vectors as exactly as large ones. Column k is at
// C + k * stride. A rotation that a lane does not need is the identity to the last bit, so that no
// lane depends on its neighbours.
constexpr int kJacobiSweeps = 16;
constexpr double kParallel = 4.0e-16;  // cosine of an angle between columns that are orthogonal
constexpr double kNoLength = 1.0e-31;  // square of a column that is nothing but rounding
template <class T>
static __attribute__((noinline)) void orthogonalise(T* C, int count, int length, int more,
                                                    int stride) {
    for (int sweep = 0; sweep < kJacobiSweeps; sweep++) {
        T longest{};
        for (int k = 0; k < count; k++) {
            const T* x = C + k * stride;
            longest = vmax(longest, dot(x, x, length));
        }
        const T nothing = longest * kNoLength;
        // By a swap as well: pairs that were looked at before it are others then.
        decltype(nothing < nothing) changed{};
        for (int k = 0; k < count - 1; k++) {
            for (int l = k + 1; l < count; l++) {
                T* x = C + k * stride;
                T* y = C + l * stride;
                const T a = dot(x, x, length), b = dot(y, y, length), g = dot(x, y, length);
                const auto swap = a < b;
                const T low = select(swap, a, b), high = select(swap, b, a);
                const auto turn =
                    (g * g > (high * low) * (kParallel * kParallel)) & (low > nothing);
                if (!any(swap | turn)) continue;
                changed = changed | swap | turn;
                // x' = c x - s y, y' = s x + c y for the longer x and the shorter y.
                const T z = (low - high) / select(turn, g + g, T{} + 1.0);
                T t = copysign(1.0 / (vabs(z) + vsqrt(1.0 + z * z)), z);
                t = select(turn, t, T{});
                const T c = 1.0 / vsqrt(1.0 + t * t), s = c * t;
                for (int i = 0; i < length + more; i++) {
                    const T p = select(swap, y[i], x[i]), r = select(swap, x[i], y[i]);
                    x[i] = c * p - s * r;
                    y[i] = s * p + c * r;
                }
            }
        }
        if (!any(changed)) break;
    }
}

// Singular values, descending, from q and e by rotations of the bidiagonal matrix itself.
template <int K>
static __attribute__((noinline)) void by_rotations(const V* q, const V* e, V* S) {
    V B[K * K];
    for (int i = 0; i < K * K; i++) B[i] = broadcast(0.0);
    for (int k = 0; k < K; k++) B[k * K + k] = vsqrt(q[k]);
    for (int k = 0; k < K - 1; k++) B[k * K + k + 1] = vsqrt(e[k]);
    orthogonalise(B, K, K, 0, K);
    for (int k = 0; k < K; k++) S[k] = vsqrt(dot(B + k * K, B + k * K, K));
}
