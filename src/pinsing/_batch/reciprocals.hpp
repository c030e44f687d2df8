// Reciprocals and roots by estimates and Newton's steps, where the machine has estimates: a division
// of eight doubles takes as long as sixteen multiplications of them.
//
// pole: 1 / x with a relative error below kPole, of either sign, for the sums of Aberth's method.
// reciprocal, quotient: 1 / x and y / x, to some two units in the last place; NaN or infinite for x = 0
// and for a denormal one. early_quotient: the same to some eight digits at least. rough_reciprocal: to a
// few digits, for what only sets the pace. positive_root: of normal x > 0; safe_root: of x >= 0, zero
// for 1e-290 and less. rough_sixteenth_root: x^(1/16) to about a percent, for normal x > 0.
#if defined(__AVX512F__)
constexpr double kPole = 6.2e-5;
PINSING_INLINE One pole(One x) { return One{(Half)_mm512_rcp14_pd((__m512d)x.v)}; }
PINSING_INLINE One rough_reciprocal(One x) { return pole(x); }
PINSING_INLINE One reciprocal(One x) {
    One r = pole(x);
    One e = 1.0 - x * r;
    One p = r + r * e;
    return p + p * (e * e);
}
PINSING_INLINE One quotient(One y, One x) { return y * reciprocal(x); }
PINSING_INLINE One early_quotient(One y, One x) {
    One r = pole(x);
    return y * (r + r * (1.0 - x * r));
}
PINSING_INLINE One rough_inverse_root(One x) { return One{(Half)_mm512_rsqrt14_pd((__m512d)x.v)}; }
PINSING_INLINE One positive_root(One x) {
    One y = rough_inverse_root(x);
    One s = x * y, h = 0.5 * y;
    One e = 0.5 - s * h;
    s = s + s * e;
    h = h + h * e;
    One d = x - s * s;
    return s + d * h;
}
PINSING_INLINE One safe_root(One x) { return select(x > 1.0e-290, positive_root(x), spread(0.0)); }
PINSING_INLINE One rough_sixteenth_root(One x) {
    for (int k = 0; k < 4; k++) x = x * rough_inverse_root(x);
    return x;
}
#else
#if defined(__AVX2__)
constexpr double kPole = 3.0e-3;
PINSING_INLINE One mirrored(One x) {  // the exponent's sign turned round
    return value(INT64_C(0x7FDE623822835EEA) - bits(x));
}
PINSING_INLINE One pole(One x) {
    One r = mirrored(x);
    return r + r * (1.0 - x * r);
}
PINSING_INLINE One rough_reciprocal(One x) {
    One r = mirrored(x);
    One e = 1.0 - x * r;
    One p = r + r * e;
    return p + p * (e * e);
}
#else
constexpr double kPole = 1.0e-16;
PINSING_INLINE One pole(One x) { return 1.0 / x; }
PINSING_INLINE One rough_reciprocal(One x) { return 1.0 / x; }
#endif
PINSING_INLINE One reciprocal(One x) { return 1.0 / x; }
PINSING_INLINE One quotient(One y, One x) { return y / x; }
PINSING_INLINE One early_quotient(One y, One x) { return y / x; }
PINSING_INLINE One positive_root(One x) { return vsqrt(x); }
PINSING_INLINE One safe_root(One x) { return vsqrt(x); }
PINSING_INLINE One rough_sixteenth_root(One x) {
    // A sixteenth of the logarithm, read off the bits, then a step of Newton for x^(-1/16).
    OneBits sixteenth = (bits(x) >> 4) & INT64_C(0x0fffffffffffffff);
    One y = value(INT64_C(0x43ee480000000000) - sixteenth);  // 17/16 of 1023 exponents, centred
    One y2 = y * y, y4 = y2 * y2, y8 = y4 * y4;
    return pole(y * (1.0625 - 0.0625 * (x * y8 * y8)));
}
#endif

PINSING_INLINE V reciprocal(V x) { return V{reciprocal(x.a), reciprocal(x.b)}; }
PINSING_INLINE V rough_reciprocal(V x) { return V{rough_reciprocal(x.a), rough_reciprocal(x.b)}; }
PINSING_INLINE V quotient(V y, V x) { return V{quotient(y.a, x.a), quotient(y.b, x.b)}; }
PINSING_INLINE V positive_root(V x) { return V{positive_root(x.a), positive_root(x.b)}; }
