// Reciprocals and roots by estimates and Newton's steps, where the machine has estimates: a division
// of eight doubles takes as long as sixteen multiplications of them.

// 1 / x, to some two units in the last place. NaN or infinite for x = 0 and for a denormal one.
PINSING_INLINE One reciprocal(One x) {
#if defined(__AVX512F__)
    One r{(Half)_mm512_rcp14_pd((__m512d)x.v)};
    One e = 1.0 - x * r;
    One p = r + r * e;
    return p + p * (e * e);
#else
    return 1.0 / x;
#endif
}
// y / x, the same.
PINSING_INLINE One quotient(One y, One x) {
#if defined(__AVX512F__)
    return y * reciprocal(x);
#else
    return y / x;
#endif
}
// 1 / x to a few digits, for what only sets the pace.
PINSING_INLINE One rough_reciprocal(One x) {
#if defined(__AVX512F__)
    return One{(Half)_mm512_rcp14_pd((__m512d)x.v)};
#elif defined(__AVX2__)
    One r = value(INT64_C(0x7FDE623822835EEA) - bits(x));  // the exponent's sign turned round
    One e = 1.0 - x * r;
    One p = r + r * e;
    return p + p * (e * e);
#else
    return 1.0 / x;
#endif
}
// sqrt(x) for normal x > 0.
PINSING_INLINE One positive_root(One x) {
#if defined(__AVX512F__)
    One y{(Half)_mm512_rsqrt14_pd((__m512d)x.v)};
    One s = x * y, h = 0.5 * y;
    One e = 0.5 - s * h;
    s = s + s * e;
    h = h + h * e;
    One d = x - s * s;
    return s + d * h;
#else
    return vsqrt(x);
#endif
}
// sqrt(x) for x >= 0; zero for x of 1e-290 and less.
PINSING_INLINE One safe_root(One x) {
#if defined(__AVX512F__)
    return select(x > 1.0e-290, positive_root(x), spread(0.0));
#else
    return vsqrt(x);
#endif
}

// 1 / x with a relative error below kPole, for the sums of Aberth's method.
#if defined(__AVX512F__)
constexpr double kPole = 6.2e-5;
PINSING_INLINE One pole(One x) { return One{(Half)_mm512_rcp14_pd((__m512d)x.v)}; }
#elif defined(__AVX2__)
constexpr double kPole = 3.0e-3;
PINSING_INLINE One pole(One x) {
    One r = value(INT64_C(0x7FDE623822835EEA) - bits(x));  // of either sign
    return r + r * (1.0 - x * r);
}
#else
constexpr double kPole = 1.0e-16;
PINSING_INLINE One pole(One x) { return 1.0 / x; }
#endif
// y / x, to some eight digits at least.
PINSING_INLINE One early_quotient(One y, One x) {
#if defined(__AVX512F__)
    One r = pole(x);
    return y * (r + r * (1.0 - x * r));
#else
    return y / x;
#endif
}
// x^(1/16) to about a percent, for normal x > 0.
PINSING_INLINE One rough_sixteenth_root(One x) {
#if defined(__AVX512F__)
    for (int k = 0; k < 4; k++) x = x * One{(Half)_mm512_rsqrt14_pd((__m512d)x.v)};
    return x;
#else
    // A sixteenth of the logarithm, read off the bits, then a step of Newton for x^(-1/16).
    OneBits sixteenth = (bits(x) >> 4) & INT64_C(0x0fffffffffffffff);
    One y = value(INT64_C(0x43ee480000000000) - sixteenth);  // 17/16 of 1023 exponents, centred
    One y2 = y * y, y4 = y2 * y2, y8 = y4 * y4;
    return pole(y * (1.0625 - 0.0625 * (x * y8 * y8)));
#endif
}

PINSING_INLINE V reciprocal(V x) { return V{reciprocal(x.a), reciprocal(x.b)}; }
PINSING_INLINE V rough_reciprocal(V x) { return V{rough_reciprocal(x.a), rough_reciprocal(x.b)}; }
PINSING_INLINE V quotient(V y, V x) { return V{quotient(y.a, x.a), quotient(y.b, x.b)}; }
PINSING_INLINE V positive_root(V x) { return V{positive_root(x.a), positive_root(x.b)}; }
