// A block of configurations, one in each lane: two machine vectors side by side, because the
// recurrences of the kernel are latency-bound and two independent ones fill the pipeline.
//
// Included inside the namespace of one instruction set. Every operation acts on each lane alone and
// in the same way, so a result depends neither on its lane nor on its neighbours.
#define PINSING_INLINE static inline __attribute__((always_inline))

#if defined(__AVX512F__)
constexpr int kHalf = 8;
#elif defined(__AVX2__)
constexpr int kHalf = 4;
#else
constexpr int kHalf = 2;
#endif
constexpr int kLanes = 2 * kHalf;

typedef double Half __attribute__((vector_size(8 * kHalf)));
typedef std::int64_t HalfBits __attribute__((vector_size(8 * kHalf)));

struct V {
    Half a, b;
};
struct Bits {
    HalfBits a, b;
};

PINSING_INLINE V broadcast(double x) { return V{x - Half{}, x - Half{}}; }
PINSING_INLINE Bits bits(V x) { return Bits{(HalfBits)x.a, (HalfBits)x.b}; }
PINSING_INLINE V value(Bits x) { return V{(Half)x.a, (Half)x.b}; }

#define PINSING_ARITHMETIC(op)                                                     \
    PINSING_INLINE V operator op(V x, V y) { return V{x.a op y.a, x.b op y.b}; }   \
    PINSING_INLINE V operator op(V x, double y) { return V{x.a op y, x.b op y}; }  \
    PINSING_INLINE V operator op(double x, V y) { return V{x op y.a, x op y.b}; }
PINSING_ARITHMETIC(+)
PINSING_ARITHMETIC(-)
PINSING_ARITHMETIC(*)
PINSING_ARITHMETIC(/)
#undef PINSING_ARITHMETIC
PINSING_INLINE V& operator+=(V& x, V y) { return x = x + y; }
PINSING_INLINE V& operator-=(V& x, V y) { return x = x - y; }
PINSING_INLINE V& operator*=(V& x, V y) { return x = x * y; }

#define PINSING_BITWISE(op)                                                                 \
    PINSING_INLINE Bits operator op(Bits x, Bits y) { return Bits{x.a op y.a, x.b op y.b}; } \
    PINSING_INLINE Bits operator op(Bits x, std::int64_t y) { return Bits{x.a op y, x.b op y}; }
PINSING_BITWISE(&)
PINSING_BITWISE(|)
PINSING_BITWISE(^)
PINSING_BITWISE(+)
PINSING_BITWISE(<<)
#undef PINSING_BITWISE
PINSING_INLINE Bits operator-(std::int64_t x, Bits y) { return Bits{x - y.a, x - y.b}; }

// Masks: one bit a lane in AVX-512's mask registers, a lane full of ones elsewhere.
#if defined(__AVX512F__)
struct Mask {
    __mmask8 a, b;
};
#define PINSING_COMPARE(op, code)                                                      \
    PINSING_INLINE Mask operator op(V x, V y) {                                        \
        return Mask{_mm512_cmp_pd_mask((__m512d)x.a, (__m512d)y.a, code),              \
                    _mm512_cmp_pd_mask((__m512d)x.b, (__m512d)y.b, code)};             \
    }                                                                                  \
    PINSING_INLINE Mask operator op(V x, double y) { return x op broadcast(y); }
PINSING_COMPARE(<, _CMP_LT_OQ)
PINSING_COMPARE(<=, _CMP_LE_OQ)
PINSING_COMPARE(>, _CMP_GT_OQ)
#undef PINSING_COMPARE
PINSING_INLINE Mask operator&(Mask x, Mask y) {
    return Mask{(__mmask8)(x.a & y.a), (__mmask8)(x.b & y.b)};
}
PINSING_INLINE Mask operator|(Mask x, Mask y) {
    return Mask{(__mmask8)(x.a | y.a), (__mmask8)(x.b | y.b)};
}
PINSING_INLINE Mask operator~(Mask x) { return Mask{(__mmask8)~x.a, (__mmask8)~x.b}; }
PINSING_INLINE Mask none() { return Mask{0, 0}; }
PINSING_INLINE bool any(Mask m) { return (m.a | m.b) != 0; }
PINSING_INLINE bool lane(Mask m, int i) {
    return ((i < kHalf ? m.a >> i : m.b >> (i - kHalf)) & 1) != 0;
}
PINSING_INLINE Mask odd(Bits k) {
    const __m512i one = _mm512_set1_epi64(1);
    return Mask{_mm512_test_epi64_mask((__m512i)k.a, one),
                _mm512_test_epi64_mask((__m512i)k.b, one)};
}
PINSING_INLINE V select(Mask m, V x, V y) {
    return V{(Half)_mm512_mask_blend_pd(m.a, (__m512d)y.a, (__m512d)x.a),
             (Half)_mm512_mask_blend_pd(m.b, (__m512d)y.b, (__m512d)x.b)};
}
#else
struct Mask {
    HalfBits a, b;
};
#define PINSING_COMPARE(op)                                                                \
    PINSING_INLINE Mask operator op(V x, V y) {                                            \
        return Mask{(HalfBits)(x.a op y.a), (HalfBits)(x.b op y.b)};                       \
    }                                                                                      \
    PINSING_INLINE Mask operator op(V x, double y) { return x op broadcast(y); }
PINSING_COMPARE(<)
PINSING_COMPARE(<=)
PINSING_COMPARE(>)
#undef PINSING_COMPARE
PINSING_INLINE Mask operator&(Mask x, Mask y) { return Mask{x.a & y.a, x.b & y.b}; }
PINSING_INLINE Mask operator|(Mask x, Mask y) { return Mask{x.a | y.a, x.b | y.b}; }
PINSING_INLINE Mask operator~(Mask x) { return Mask{~x.a, ~x.b}; }
PINSING_INLINE Mask none() { return Mask{HalfBits{}, HalfBits{}}; }
PINSING_INLINE bool any(Mask m) {
    HalfBits either = m.a | m.b;
    std::int64_t all = 0;
    for (int i = 0; i < kHalf; i++) all |= either[i];
    return all != 0;
}
PINSING_INLINE bool lane(Mask m, int i) { return (i < kHalf ? m.a[i] : m.b[i - kHalf]) != 0; }
PINSING_INLINE Mask odd(Bits k) { return Mask{-(k.a & 1), -(k.b & 1)}; }
PINSING_INLINE V select(Mask m, V x, V y) {
    return V{m.a ? x.a : y.a, m.b ? x.b : y.b};
}
#endif

PINSING_INLINE Half half_sqrt(Half x) {
#if defined(__AVX512F__)
    return (Half)_mm512_sqrt_pd((__m512d)x);
#elif defined(__AVX2__)
    return (Half)_mm256_sqrt_pd((__m256d)x);
#elif defined(__SSE2__)
    return (Half)_mm_sqrt_pd((__m128d)x);
#else
    for (int i = 0; i < kHalf; i++) x[i] = __builtin_sqrt(x[i]);
    return x;
#endif
}
PINSING_INLINE V vsqrt(V x) { return V{half_sqrt(x.a), half_sqrt(x.b)}; }

PINSING_INLINE Half half_min(Half x, Half y) {
#if defined(__AVX512F__)
    return (Half)_mm512_min_pd((__m512d)x, (__m512d)y);
#elif defined(__AVX2__)
    return (Half)_mm256_min_pd((__m256d)x, (__m256d)y);
#elif defined(__SSE2__)
    return (Half)_mm_min_pd((__m128d)x, (__m128d)y);
#else
    return x < y ? x : y;
#endif
}
PINSING_INLINE Half half_max(Half x, Half y) {
#if defined(__AVX512F__)
    return (Half)_mm512_max_pd((__m512d)x, (__m512d)y);
#elif defined(__AVX2__)
    return (Half)_mm256_max_pd((__m256d)x, (__m256d)y);
#elif defined(__SSE2__)
    return (Half)_mm_max_pd((__m128d)x, (__m128d)y);
#else
    return x > y ? x : y;
#endif
}
PINSING_INLINE V vmin(V x, V y) { return V{half_min(x.a, y.a), half_min(x.b, y.b)}; }
PINSING_INLINE V vmax(V x, V y) { return V{half_max(x.a, y.a), half_max(x.b, y.b)}; }
PINSING_INLINE V vmax(V x, double y) { return vmax(x, broadcast(y)); }
PINSING_INLINE V vmin(V x, double y) { return vmin(x, broadcast(y)); }

PINSING_INLINE V vabs(V x) { return value(bits(x) & INT64_MAX); }
PINSING_INLINE V copysign(V magnitude, V sign) {
    return value(bits(vabs(magnitude)) | (bits(sign) & INT64_MIN));
}

// Lane i of a block in memory.
PINSING_INLINE double* lanes(V* x) { return reinterpret_cast<double*>(x); }

// A block x[k] (k < count) in lanes to rows of an array: out[i * count + k], lanes i < width.
PINSING_INLINE void store_rows(V* x, int count, int width, double* out) {
    const double* from = lanes(x);
    for (int i = 0; i < width; i++)
        for (int k = 0; k < count; k++) *out++ = from[k * kLanes + i];
}

// Rows of an array to a block in lanes; lanes beyond width repeat the first row.
PINSING_INLINE void load_rows(const double* in, std::int64_t count, int width, V* x) {
    double* to = lanes(x);
    if (width == kLanes) {  // most often: a loop of fixed length
        for (int k = 0; k < count; k++)
            for (int i = 0; i < kLanes; i++) to[k * kLanes + i] = in[i * count + k];
    } else {
        for (int k = 0; k < count; k++)
            for (int i = 0; i < kLanes; i++)
                to[k * kLanes + i] = in[(i < width ? i : 0) * count + k];
    }
}

// The first lane that holds a NaN or an infinity in any of x[k], or -1.
PINSING_INLINE int first_not_finite(V* x, int count, int width) {
    Mask good = ~none();
    for (int k = 0; k < count; k++) good = good & (vabs(x[k]) <= 1.7976931348623157e308);
    if (!any(~good)) return -1;
    for (int i = 0; i < width; i++)
        if (!lane(good, i)) return i;
    return -1;
}
