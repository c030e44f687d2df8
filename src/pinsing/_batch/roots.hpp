// Singular values of a block of bidiagonal matrices as roots of a polynomial, all at once.
//
// With squares q of the diagonal and e of the superdiagonal, T = B B^T is tridiagonal with diagonal
// q[k] + e[k] and couplings of square q[k+1] e[k]. Its characteristic polynomial p has the wanted
// eigenvalues as its roots, which are real, and not negative. The method of Ehrlich ("A modified
// Newton method for polynomials", 1967) and Aberth (1973) brings guesses to all of them at once:
// x_i -= N / (1 - N sum 1 / (x_i - x_j)) with N = p / p', of third order. Nothing of it waits for
// anything else. The last steps are those of Weierstrass (1891; Durand 1960, Kerner 1966):
// x_i -= p(x_i) / prod (x_i - x_j), of second order,
// which is enough next to the roots, and needs no derivative.
//
// The guesses: four root-squaring steps of Graeffe make the coefficients c_k those of the roots'
// sixteenth powers, whose ratios c_k+1 / c_k are near the powers themselves where these lie apart
// (the slopes of Newton's polygon; Bini, "Numerical computation of polynomial zeros by means of
// Aberth's method", 1996). For real roots these ratios decrease (Newton's inequalities), so that the
// guesses are in order.
//
// Why the roots are as good as those of rotations, though coefficients of a polynomial condition its
// roots badly: coefficients only make the guesses. The last steps evaluate p by the recurrence
//
//     w = p_k - e_k-1 w,   p_k+1 = x w - q_k p_k      (p_k: the leading block, w: with e beside it)
//
// which multiplies and subtracts q and e, and never divides. Each rounding of it can be moved to the
// q or the e it multiplies, as a relative change of a few units in the last place: the computed p(x)
// is the exact one of a bidiagonal matrix whose entries differ from ours by a few units in the last
// place each, and such a change moves every singular value, however small, by the same relative
// amount only (Demmel and Kahan, "Accurate singular values of bidiagonal matrices", 1990, theorem 2
// and section 3, where the same is said of counting signs for bisection). A root of the computed p
// is thereby a root to a few units in the last place, and where a step is small beside it, so is
// its error. What rounding does between roots that nearly agree, the steps do not settle on.
//
// No lane is taken at the method's word. It is sure of itself only if (a) the last steps were small:
// what one of Weierstrass leaves of an error, delta sum delta_j / (x_i - x_j), with the greatest
// delta for each, the nearest root for all, and the quotient's own error, is below rounding; (b) the
// roots are in order, and not negative; (c) their sum and the sum of their squares are the trace of T
// and of T^2 to 1e-13; (d) their product is the determinant to 1e-12: it is what sees a wrong small
// value, which the sums hardly do. All other lanes, of clusters above all, are left to rotations. Each
// lane is judged by itself alone, so that no result depends on its neighbours.

constexpr int kGraeffe = 4;
constexpr int kEarly = 3;      // steps with the coefficients, which leave some twelve digits at best
constexpr int kRootSteps = 5;  // at most, by the recurrence
constexpr double kFloor = 1.0e-150;  // of powers of roots: denormals are slow, and of no use

// Sums over j of 1 / (x_i - x_j).
template <int K>
PINSING_INLINE void sums_of_poles(const One* x, One* sum, One* beside) {
    PINSING_UNROLL
    for (int i = 0; i < K; i++) {
        PINSING_UNROLL
        for (int j = i + 1; j < K; j++) {
            One r = pole(x[i] - x[j]);
            sum[i] = i == 0 && j == 1 ? r : sum[i] + r;
            sum[j] = i == 0 ? -1.0 * r : sum[j] - r;
            if (j == i + 1) beside[i] = r;
        }
    }
}

// Products over j of x_i - x_j, and the distance of the nearest root, negative out of order.
template <int K>
PINSING_INLINE void products_of_distances(const One* x, One* product, One* nearest) {
    PINSING_UNROLL
    for (int i = 0; i < K; i++) {
        PINSING_UNROLL
        for (int j = i + 1; j < K; j++) {
            One d = x[i] - x[j];
            product[i] = i == 0 && j == 1 ? d : product[i] * d;
            product[j] = i == 0 ? d : product[j] * d;
            if (j == i + 1) {
                nearest[i] = i == 0 ? d : vmin(nearest[i], d);
                nearest[j] = d;
            }
        }
    }
    // Of root i there are i distances the other way round.
    for (int i = 1; i < K; i += 2) product[i] = -1.0 * product[i];
}

// c[0..K]: coefficients of p(-x), highest first, which are sums of positive terms.
template <int K>
PINSING_INLINE void coefficients(const One* q, const One* e, One* c) {
    One w[K];
    c[0] = w[0] = spread(1.0);
    c[1] = q[0];
    PINSING_UNROLL
    for (int k = 1; k < K; k++) {
        PINSING_UNROLL
        for (int j = k; j >= 1; j--) w[j] = c[j] + e[k - 1] * w[j - 1];
        c[k + 1] = q[k] * c[k];
        PINSING_UNROLL
        for (int j = k; j >= 1; j--) c[j] = w[j] + q[k] * c[j - 1];
    }
}

// Guesses of the roots, largest first.
template <int K>
PINSING_INLINE void guesses(const One* c, One* x) {
    One u[K + 1];
    u[0] = c[0];
    for (int k = 1; k <= K; k++) u[k] = vmax(c[k], kFloor);
    PINSING_UNROLL
    for (int step = 0; step < kGraeffe; step++) {
        One next[K + 1];
        next[0] = u[0];
        PINSING_UNROLL
        for (int k = 1; k < K; k++) {
            One square = u[k] * u[k];
            One sum = square - 2.0 * (u[k - 1] * u[k + 1]);
            PINSING_UNROLL
            for (int j = 2; j <= (2 * k < K ? k : K - k); j++) {
                One both = 2.0 * (u[k - j] * u[k + j]);
                sum = j % 2 ? sum - both : sum + both;
            }
            next[k] = vmax(sum, square * 1.0e-3);
        }
        next[K] = u[K] * u[K];
        for (int k = 1; k <= K; k++) u[k] = vmax(next[k], kFloor);
    }
    PINSING_UNROLL
    for (int k = 0; k < K; k++) x[k] = rough_sixteenth_root(u[k + 1] * pole(u[k]));
}

// A step on the coefficients.
template <int K>
PINSING_INLINE void early_step(const One* c, One* x) {
    One sum[K], beside[K];
    sums_of_poles<K>(x, sum, beside);
    PINSING_UNROLL
    for (int i = 0; i < K; i++) {
        One y = x[i];
        One p0 = y - c[1], p1 = y + p0;
        p0 = y * p0 + c[2];
        PINSING_UNROLL
        for (int k = 3; k <= K; k++) {
            p1 = y * p1 + p0;
            p0 = k % 2 ? y * p0 - c[k] : y * p0 + c[k];
        }
        x[i] = y - p0 / (p1 - p0 * sum[i]);
    }
}

// p at y by the recurrence.
template <int K>
PINSING_INLINE One recurrence(const One* q, const One* e, One y) {
    One p = y - q[0];
    One w = p - e[0];
    p = y * w - q[1] * p;
    PINSING_UNROLL
    for (int k = 2; k < K; k++) {
        w = p - e[k - 1] * w;
        p = y * w - q[k] * p;
    }
    return p;
}

// Singular values S, descending; the mask of the lanes where they are right.
template <int K>
static __attribute__((noinline)) OneMask roots_of(const One* q_in, const One* e_in, One* S) {
    One q[K], e[K], c[K + 1], x[K];
    for (int k = 0; k < K; k++) q[k] = q_in[k];
    for (int k = 0; k < K - 1; k++) e[k] = e_in[k];
    coefficients<K>(q, e, c);
    const One trace = c[1];
    const One squares = trace * trace - 2.0 * c[2];

    // Two values next to zero are a cluster.
    OneMask done = never();
    OneMask hopeless = ~(trace * c[K - 2] * 1.0e-28 < c[K - 1]);
    if (!any(~hopeless)) return done;
    guesses<K>(c, x);
    PINSING_UNROLL
    for (int step = 0; step < kEarly; step++) early_step<K>(c, x);

    for (int step = 0; step < kRootSteps; step++) {
        One product[K], nearest[K], delta[K];
        products_of_distances<K>(x, product, nearest);
        PINSING_UNROLL
        for (int i = 0; i < K; i++)
            delta[i] = recurrence<K>(q, e, x[i]) / product[i];
        OneMask settled = ~hopeless;
        One widest = vabs(delta[0]);
        for (int i = 1; i < K; i++) widest = vmax(widest, vabs(delta[i]));
        const One others = (K - 1) * widest;
        PINSING_UNROLL
        for (int i = 0; i < K; i++) {
            // In order, and what the others' errors and the quotient's leave is below rounding.
            settled = settled & (nearest[i] > 0.0);
            One left = vabs(delta[i]) * (others + nearest[i] * 1.0e-8);
            settled = settled & (left <= nearest[i] * (1.0e-16 * x[i] + 1.0e-34 * trace));
            x[i] = select(done, x[i], x[i] - delta[i]);
        }
        done = done | settled;
        hopeless = hopeless | ~(widest <= 1.0e300);
        if (!any(~(done | hopeless))) break;
    }

    One total = spread(0.0), total_of_squares = total, product = spread(1.0);
    PINSING_UNROLL
    for (int k = 0; k < K; k++) {
        if (k > 0) done = done & (x[k] <= x[k - 1]);
        x[k] = vmax(x[k], 0.0);
        total += x[k];
        total_of_squares += x[k] * x[k];
        product *= x[k];
        S[k] = vsqrt(x[k]);
    }
    return done & (vabs(total - trace) <= 1.0e-13 * trace) &
           (vabs(total_of_squares - squares) <= 1.0e-13 * squares) &
           (vabs(product - c[K]) <= 1.0e-12 * c[K] + 1.0e-33 * (trace * c[K - 1]));
}
