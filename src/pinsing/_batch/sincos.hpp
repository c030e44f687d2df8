// Sine and cosine of a block, or of one machine vector, to about one unit in the last place.
//
// Reduction after Cody and Waite: pi/2 in two parts of 33 bits, whose products with the quadrant
// number are exact with or without fused multiply-add, and a rest; the rounding errors of the
// subtractions are carried along. The polynomials are those of fdlibm (k_sin.c, k_cos.c).
constexpr double kReducible = 1.0e6;  // beyond it the quadrant number has too many bits

template <class T>
PINSING_INLINE void sincos(T x, T& sine, T& cosine) {
    const double magic = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
    T shifted = x * 0.63661977236758134308 + magic;
    auto quadrant = bits(shifted);
    T n = shifted - magic;
    T head = x - n * 1.57079632673412561417e+00;  // exact
    T second = n * 6.07710050630396597660e-11;    // exact
    T mid = head - second;
    T rest = n * 2.02226624879595063154e-21 - ((head - mid) - second);
    T r = mid - rest;
    T tail = (mid - r) - rest;

    T z = r * r;
    T w = z * z;
    // sin r = r + r z (S1 + z S), cos r = 1 - z / 2 + z C
    T S_low = 8.33333333332248946124e-03 +
              z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06);
    T S_high = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10;
    T S = S_low + (z * w) * S_high;
    T C_low = 4.16666666666666019037e-02 +
              z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05);
    T C_high = -2.75573143513906633035e-07 +
               z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11);
    T C = z * C_low + (w * w) * C_high;
    T s = r + ((z * r) * (-1.66666666666666324348e-01 + z * S) + tail * (1.0 - 0.5 * z));
    T half = 0.5 * z;
    T one = 1.0 - half;
    T c = one + (((1.0 - one) - half) + (z * C - r * tail));

    auto swap = odd(quadrant);
    sine = value(bits(select(swap, c, s)) ^ ((quadrant & 2) << 62));
    cosine = value(bits(select(swap, s, c)) ^ (((quadrant + INT64_C(1)) & 2) << 62));

    auto large = vabs(x) > kReducible;
    if (__builtin_expect(any(large), 0)) {
        for (int i = 0; i < static_cast<int>(sizeof(T) / sizeof(double)); i++) {
            if (!lane(large, i)) continue;
            double angle = lanes(&x)[i];
            lanes(&sine)[i] = ::sin(angle);
            lanes(&cosine)[i] = ::cos(angle);
        }
    }
}
