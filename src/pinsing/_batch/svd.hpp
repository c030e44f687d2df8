// Singular values of a block of matrices: Householder bidiagonalisation, then the eigenvalues of the
// bidiagonal matrix's square by dqds, or all at once (roots.hpp) with dqds where these do not settle.
//
// A block holds one k x l matrix (k <= l) in each lane, entry (i, j) at A[i * l + j]. Values are
// accurate to 5e-15 of the largest one of their matrix, small ones included, as LAPACK's are.
// (Eigenvalues of A A^T would lose half of the digits.) No more is meant: the bidiagonalisation
// mixes rows, so values below that of a graded matrix have no correct digits of their own.
//
// Golub and Kahan (1965), "Calculating the singular values and pseudo-inverse of a matrix";
// Fernando and Parlett (1994), "Accurate singular values and differential qd algorithms".

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
    V norm = select(some, positive_root(square), broadcast(0.0));
    V factor = reciprocal(square + norm * vabs(x0));
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

// The same of a 6 x l matrix whose last column is (0, 0, 0, 0, 0, 1), which saves its reflections: the
// last row comes first, with one as its diagonal. Then columns and rows in turn, so that what is left
// of the last row, for more than six columns, is e[5]: an entry beside the last diagonal one.
template <int L>
static __attribute__((noinline)) void bidiagonalise_beside_unit(V* A, int columns, V* q, V* e) {
    constexpr int K = 5;  // rows of the rest
    const int l = L > 0 ? L : columns, ends = l - 1;
#define AT(i, j) A[(i) * l + (j)]
    V square = AT(K, 0) * AT(K, 0);
    for (int c = 1; c < ends; c++) square += AT(K, c) * AT(K, c);
    q[0] = broadcast(1.0);
    e[0] = square;
    V factor = reflector(AT(K, 0), square);
    PINSING_UNROLL
    for (int i = 0; i < K; i++) {
        V dot = AT(K, 0) * AT(i, 0);
        for (int c = 1; c < ends; c++) dot += AT(K, c) * AT(i, c);
        dot *= factor;
        for (int c = 0; c < ends; c++) AT(i, c) -= dot * AT(K, c);
    }
    PINSING_UNROLL
    for (int k = 0; k < K; k++) {
        {  // column k from the diagonal on: reflect onto (k, k)
            V square = AT(k, k) * AT(k, k);
            PINSING_UNROLL
            for (int i = k + 1; i < K; i++) square += AT(i, k) * AT(i, k);
            q[k + 1] = square;
            if (k < K - 1) {
                V factor = reflector(AT(k, k), square);
                for (int c = k + 1; c < ends; c++) {
                    V dot = AT(k, k) * AT(k, c);
                    PINSING_UNROLL
                    for (int i = k + 1; i < K; i++) dot += AT(i, k) * AT(i, c);
                    dot *= factor;
                    PINSING_UNROLL
                    for (int i = k; i < K; i++) AT(i, c) -= dot * AT(i, k);
                }
            }
        }
        if (k + 1 == ends) break;
        {  // row k beside the diagonal: reflect onto (k, k + 1)
            V square = AT(k, k + 1) * AT(k, k + 1);
            for (int c = k + 2; c < ends; c++) square += AT(k, c) * AT(k, c);
            e[k + 1] = square;
            if (k < K - 1 && k + 2 < ends) {
                V factor = reflector(AT(k, k + 1), square);
                PINSING_UNROLL
                for (int i = k + 1; i < K; i++) {
                    V dot = AT(k, k + 1) * AT(i, k + 1);
                    for (int c = k + 2; c < ends; c++) dot += AT(k, c) * AT(i, c);
                    dot *= factor;
                    for (int c = k + 1; c < ends; c++) AT(i, c) -= dot * AT(k, c);
                }
            }
        }
    }
#undef AT
}

// One transformation of the leading m + 1 values: (q, e) of B -> (Q, E) of a bidiagonal matrix
// whose B^T B is the former B B^T less `shift`.
struct Transformation {
    V Q[kMaxRank], E[kMaxRank];
    V low;     // the least d but the last
    V last;    // the last d, which is Q[m] unless a zero took its place
    V widest;  // of E
};

// The same where some Q is zero, which leaves NaN in the plain form: nothing couples what stands
// before such a place with the rest, which starts afresh. A zero that stands alone moves to the
// end, where it is split off: elsewhere it would allow no shift.
static __attribute__((noinline)) void split_transformation(int m, const V* q, const V* e, V shift,
                                                           V extra, Transformation& next) {
    V d = q[0] - shift;
    next.low = d;
    next.widest = broadcast(0.0);
    for (int k = 0; k < m; k++) {
        next.low = vmin(next.low, d);
        next.Q[k] = d + e[k];
        Mask split = next.Q[k] <= kZeroSquare;
        V t = q[k + 1] / vmax(next.Q[k], kZeroSquare);
        next.E[k] = select(split, broadcast(0.0), e[k] * t);
        next.widest = vmax(next.widest, next.E[k]);
        d = select(split, q[k + 1], d * t) - shift;
    }
    next.last = next.Q[m] = d + extra;
    const V zero = broadcast(0.0);
    for (int k = m - 1; k >= 0; k--) {
        Mask alone = (next.Q[k] <= kZeroSquare) & (next.E[k] <= kZeroSquare);
        if (k > 0) alone = alone & (next.E[k - 1] <= kZeroSquare);
        for (int j = k; j < m; j++) {
            next.Q[j] = select(alone, next.Q[j + 1], next.Q[j]);
            next.E[j] = select(alone, j + 1 < m ? next.E[j + 1] : zero, next.E[j]);
        }
        next.Q[m] = select(alone, zero, next.Q[m]);
    }
}

// Singular values, descending, from q and e (destroyed); with `Wide`, e[K - 1] stands beside the last
// diagonal entry. A lane that has not converged within
// max_sweeps transformations for one value, or whose values do not conserve the trace and the sum
// of squares of the eigenvalues, is NaN.
//
// q[m] is split off once what couples it to the rest cannot move any value by more than rounding.
// With B the bidiagonal matrix, T = B B^T is tridiagonal: q[m] in its last place, beside it the
// coupling of square c = q[m] e[m-1], before it q[m-1] + e[m-1]. Dropping c moves eigenvalues by at
// most sqrt(c), and by at most c / gap, where gap is how far q[m] lies below the eigenvalues of the
// rest. Those are at least min(d) / m - shift by the last transformation, since sum(1 / d) is the
// trace of the inverse (Fernando and Parlett 1994, section 4). The e[m-1] that stays behind in the
// last place of the rest goes into the last d of the next transformation (`extra`).
template <int K, bool Wide>
static __attribute__((noinline)) void dqds(V* q, V* e, V* S, int max_sweeps) {
    V extra = Wide ? e[K - 1] : broadcast(0.0);
    V trace = q[0] + extra;
    for (int k = 1; k < K; k++) trace += q[k] + e[k - 1];
    V squares = (q[K - 1] + extra) * (q[K - 1] + extra);  // of T, Frobenius
    for (int k = 0; k < K - 1; k++) {
        V diagonal = q[k] + e[k];
        squares += diagonal * diagonal + 2.0 * (q[k + 1] * e[k]);
    }
    const V negligible = trace * 1.0e-34;
    V sigma = broadcast(0.0);  // the shifts so far: a lower bound of the smallest eigenvalue left
    V shift = sigma;
    Mask unfinished = none();

    PINSING_UNROLL
    for (int m = K - 1; m >= 2; m--) {
        const double share = 1.0 / m;
        Mask failed = none();         // lanes whose last shift was too large
        V smallest = broadcast(0.0);  // of d[0..m-1] in the last transformation
        V gap = smallest, safe = smallest;
        Mask active = none();
        for (int sweep = 0;; sweep++) {
            V last = e[m - 1];
            V harmless = vmax(gap * (2.0e-16 * sigma + negligible), 1.0e-32 * (sigma * sigma));
            active = (last > 1.0e-31 * (sigma + q[m])) & (last > negligible) &
                     (q[m] * last > harmless);
            if (!any(active) || sweep == max_sweeps) break;

            V Q[K], E[K];
            V d = q[0] - shift;
            V low = d;
            V widest = broadcast(0.0);  // E
            PINSING_UNROLL
            for (int k = 0; k < m; k++) {
                low = vmin(low, d);
                Q[k] = d + e[k];
                V t = quotient(q[k + 1], Q[k]);
                E[k] = e[k] * t;
                widest = vmax(widest, E[k]);
                d = d * t - shift;
            }
            d += extra;
            Q[m] = d;
            Mask lost = active & ~(vabs(d) <= 1.0e300);
            if (__builtin_expect(any(lost), 0)) {
                V from[2][kMaxRank];
                for (int k = 0; k <= m; k++) from[0][k] = q[k];
                for (int k = 0; k < m; k++) from[1][k] = e[k];
                Transformation next;
                split_transformation(m, from[0], from[1], shift, extra, next);
                for (int k = 0; k < m; k++) {
                    Q[k] = select(lost, next.Q[k], Q[k]);
                    E[k] = select(lost, next.E[k], E[k]);
                }
                Q[m] = select(lost, next.Q[m], Q[m]);
                d = select(lost, next.last, d);
                low = select(lost, next.low, low);
                widest = select(lost, next.widest, widest);
            }

            // Accept only where every d is >= 0 (NaN is not). Other lanes keep what they have.
            Mask early = ~(broadcast(0.0) <= low);
            Mask bad = early | ~(broadcast(0.0) <= d);
            Mask accepted = active & ~bad;
            PINSING_UNROLL
            for (int k = 0; k < m; k++) {
                q[k] = select(accepted, Q[k], q[k]);
                e[k] = select(accepted, E[k], e[k]);
            }
            q[m] = select(accepted, Q[m], q[m]);
            extra = select(accepted, broadcast(0.0), extra);
            sigma += select(accepted, shift, broadcast(0.0));
            smallest = select(accepted, low, smallest);
            gap = select(accepted, low * share - shift - d, gap);

            // The next shift. Usually: the last d less what its coupling may take, where that
            // leaves most of it; else half of the smallest. In a cluster of equal values the bound
            // (sqrt(least) - sqrt(widest))^2 (Weyl) is better; `certain` is that without the root:
            // 2 sqrt(x y) <= a x + y / a. The constants only set the pace.
            V room = low - d;
            V least = vmin(low, d);
            V pace = rough_reciprocal(vmax(room, kZeroSquare));
            V bound = d - 1.5 * (d * E[m - 1] * pace);
            V next = select((room > 0.0) & (bound > 0.5 * d), bound * 0.999999999, 0.5 * least);
            V certain = vmax(0.97 * least - 33.4 * widest, 0.99999 * least - 1.0e5 * widest);
            next = vmax(next, certain);
            // After a failure: a last d < 0 tells how much too large the shift was; else halve it,
            // or take the certain bound; after a second one, none, which never fails.
            V retry = vmax(select(early, 0.5 * shift, (shift + d) * 0.9999999999), safe);
            retry = select(failed, broadcast(0.0), retry);
            safe = select(accepted, vmax(certain, 0.0), safe);
            shift = select(accepted, next, select(active, retry, shift));
            failed = active & bad;
        }
        unfinished = unfinished | active;
        S[m] = vsqrt(sigma + (q[m] + extra));
        extra = e[m - 1];
        shift = 0.9 * vmax(smallest, 0.0);
    }

    if constexpr (K == 1) {
        S[0] = vsqrt(q[0]);
    } else {  // 2 x 2: both eigenvalues, without cancellation
        V first = q[0] + e[0], second = q[1] + extra;
        V difference = first - second;
        V large = 0.5 * (first + second + vsqrt(difference * difference + 4.0 * (q[1] * e[0])));
        V small = (q[0] * q[1] + extra * first) / vmax(large, kZeroSquare);
        S[0] = vsqrt(sigma + large);
        S[1] = vsqrt(sigma + small);
    }

    V sum = broadcast(0.0), sum_of_squares = sum;
    for (int k = 0; k < K; k++) {
        V eigenvalue = S[k] * S[k];
        sum += eigenvalue;
        sum_of_squares += eigenvalue * eigenvalue;
    }
    Mask sound = (vabs(sum - trace) <= 1.0e-13 * trace) &
                 (vabs(sum_of_squares - squares) <= 1.0e-13 * squares) & ~unfinished;
    for (int i = 0; i < K - 1; i++) {
        for (int k = 0; k < K - 1 - i; k++) {
            V x = S[k], y = S[k + 1];
            S[k] = vmax(x, y);
            S[k + 1] = vmin(x, y);
        }
    }
    for (int k = 0; k < K; k++) S[k] = select(sound, S[k], broadcast(__builtin_nan("")));
}
