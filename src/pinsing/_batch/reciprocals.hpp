// Estimates of reciprocals and roots, where the machine has some: a division of eight doubles takes as
// long as sixteen multiplications of them.

// 1 / x with a relative error below 0.003, of either sign, for the sums of Aberth's method.
PINSING_INLINE One pole(One x) {
#if defined(__AVX512F__)
    return One{(Half)_mm512_rcp14_pd((__m512d)x.v)};
#elif defined(__AVX2__)
    const One r = value(INT64_C(0x7FDE623822835EEA) - bits(x));  // the exponent's sign turned round
    return r + r * (1.0 - x * r);
#else
    return 1.0 / x;
#endif
}

// x^(1/16) to about a percent, for normal x > 0: a sixteenth of the logarithm, read off the bits, then a
// step of Newton for x^(-1/16).
PINSING_INLINE One rough_sixteenth_root(One x) {
    const OneBits sixteenth = (bits(x) >> 4) & INT64_C(0x0fffffffffffffff);
    const One y = value(INT64_C(0x43ee480000000000) - sixteenth);  // 17/16 of 1023 exponents, centred
    const One y2 = y * y, y4 = y2 * y2, y8 = y4 * y4;
    return pole(y * (1.0625 - 0.0625 * (x * y8 * y8)));
}
