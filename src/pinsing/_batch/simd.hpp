// A block of configurations, one in each lane: two machine vectors side by side, because most
// recurrences of the kernel are latency-bound and two independent ones fill the pipeline. What has
// independent ones enough, and needs the registers, works on one machine vector at a time.
//
// Included inside the namespace of one instruction set. Every operation acts on each lane alone and
// in the same way, so a result depends neither on its lane nor on its neighbours.
#define PINSING_METHOD inline __attribute__((always_inline))
#define PINSING_INLINE static PINSING_METHOD

#if defined(__AVX512F__)
constexpr int kHalf = 8;
#elif defined(__AVX2__)
constexpr int kHalf = 4;
#else
constexpr int kHalf = 2;
#endif

typedef double Half __attribute__((vector_size(8 * kHalf)));
typedef std::int64_t HalfBits __attribute__((vector_size(8 * kHalf)));
typedef std::uint64_t HalfWords __attribute__((vector_size(8 * kHalf)));

// One machine vector, and two of them side by side.
struct One {
    Half v;
};
struct OneBits {
    HalfBits v;
};
template <class T>
struct Pair {
    T a, b;
};
using V = Pair<One>;
using Bits = Pair<OneBits>;
constexpr int kLanes = 2 * kHalf;

PINSING_INLINE One spread(double x) { return One{x - Half{}}; }
PINSING_INLINE V broadcast(double x) { return V{spread(x), spread(x)}; }
PINSING_INLINE OneBits bits(One x) { return OneBits{(HalfBits)x.v}; }
PINSING_INLINE One value(OneBits x) { return One{(Half)x.v}; }
PINSING_INLINE Bits bits(V x) { return Bits{bits(x.a), bits(x.b)}; }
PINSING_INLINE V value(Bits x) { return V{value(x.a), value(x.b)}; }

#define PINSING_ARITHMETIC(op)                                                           \
    PINSING_INLINE One operator op(One x, One y) { return One{x.v op y.v}; }             \
    PINSING_INLINE One operator op(One x, double y) { return One{x.v op y}; }            \
    PINSING_INLINE One operator op(double x, One y) { return One{x op y.v}; }            \
    PINSING_INLINE V operator op(V x, V y) { return V{x.a op y.a, x.b op y.b}; }         \
    PINSING_INLINE V operator op(V x, double y) { return V{x.a op y, x.b op y}; }        \
    PINSING_INLINE V operator op(double x, V y) { return V{x op y.a, x op y.b}; }
PINSING_ARITHMETIC(+)
PINSING_ARITHMETIC(-)
PINSING_ARITHMETIC(*)
PINSING_ARITHMETIC(/)
#undef PINSING_ARITHMETIC
template <class T> PINSING_INLINE T& operator+=(T& x, T y) { return x = x + y; }
template <class T> PINSING_INLINE T& operator-=(T& x, T y) { return x = x - y; }
template <class T> PINSING_INLINE T& operator*=(T& x, T y) { return x = x * y; }

#define PINSING_BITWISE(op)                                                                \
    PINSING_INLINE OneBits operator op(OneBits x, OneBits y) { return OneBits{x.v op y.v}; } \
    PINSING_INLINE OneBits operator op(OneBits x, std::int64_t y) { return OneBits{x.v op y}; } \
    PINSING_INLINE Bits operator op(Bits x, Bits y) { return Bits{x.a op y.a, x.b op y.b}; } \
    PINSING_INLINE Bits operator op(Bits x, std::int64_t y) { return Bits{x.a op y, x.b op y}; }
PINSING_BITWISE(&)
PINSING_BITWISE(|)
PINSING_BITWISE(^)
PINSING_BITWISE(<<)
PINSING_BITWISE(>>)
#undef PINSING_BITWISE
// Sums of bits wrap around: of signed numbers that would be undefined.
PINSING_INLINE OneBits operator+(OneBits x, std::int64_t y) {
    return OneBits{(HalfBits)((HalfWords)x.v + (std::uint64_t)y)};
}
PINSING_INLINE Bits operator+(Bits x, std::int64_t y) { return Bits{x.a + y, x.b + y}; }
PINSING_INLINE OneBits operator-(std::int64_t x, OneBits y) {
    return OneBits{(HalfBits)((std::uint64_t)x - (HalfWords)y.v)};
}
PINSING_INLINE Bits operator-(std::int64_t x, Bits y) { return Bits{x - y.a, x - y.b}; }

// Masks: one bit a lane in AVX-512's mask registers, a lane full of ones elsewhere.
#if defined(__AVX512F__)
using HalfMask = __mmask8;
#define PINSING_COMPARED(x, op, y, code) _mm512_cmp_pd_mask((__m512d)x, (__m512d)y, code)
#else
using HalfMask = HalfBits;
#define PINSING_COMPARED(x, op, y, code) (HalfBits)(x op y)
#endif
struct OneMask {
    HalfMask v;
};
PINSING_INLINE OneMask operator&(OneMask x, OneMask y) { return OneMask{(HalfMask)(x.v & y.v)}; }
PINSING_INLINE OneMask operator|(OneMask x, OneMask y) { return OneMask{(HalfMask)(x.v | y.v)}; }
PINSING_INLINE OneMask operator~(OneMask x) { return OneMask{(HalfMask)~x.v}; }
PINSING_INLINE OneMask never() { return OneMask{HalfMask{}}; }
#if defined(__AVX512F__)
PINSING_INLINE bool any(OneMask m) { return m.v != 0; }
PINSING_INLINE bool lane(OneMask m, int i) { return ((m.v >> i) & 1) != 0; }
PINSING_INLINE OneMask odd(OneBits k) {
    return OneMask{_mm512_test_epi64_mask((__m512i)k.v, _mm512_set1_epi64(1))};
}
PINSING_INLINE One select(OneMask m, One x, One y) {
    return One{(Half)_mm512_mask_blend_pd(m.v, (__m512d)y.v, (__m512d)x.v)};
}
#else
PINSING_INLINE bool lane(OneMask m, int i) { return m.v[i] != 0; }
PINSING_INLINE OneMask odd(OneBits k) { return OneMask{-(k.v & 1)}; }
#if defined(__AVX2__)
PINSING_INLINE bool any(OneMask m) { return _mm256_movemask_pd((__m256d)m.v) != 0; }
PINSING_INLINE One select(OneMask m, One x, One y) {
    return One{(Half)_mm256_blendv_pd((__m256d)y.v, (__m256d)x.v, (__m256d)m.v)};
}
#else
PINSING_INLINE bool any(OneMask m) { return (m.v[0] | m.v[1]) != 0; }
PINSING_INLINE One select(OneMask m, One x, One y) { return One{m.v ? x.v : y.v}; }
#endif
#endif
using Mask = Pair<OneMask>;

#define PINSING_COMPARE(op, code)                                                            \
    PINSING_INLINE OneMask operator op(One x, One y) { return OneMask{PINSING_COMPARED(x.v, op, y.v, code)}; } \
    PINSING_INLINE OneMask operator op(One x, double y) { return x op spread(y); }        \
    PINSING_INLINE Mask operator op(V x, V y) { return Mask{x.a op y.a, x.b op y.b}; }    \
    PINSING_INLINE Mask operator op(V x, double y) { return Mask{x.a op y, x.b op y}; }
PINSING_COMPARE(<, _CMP_LT_OQ)
PINSING_COMPARE(<=, _CMP_LE_OQ)
PINSING_COMPARE(>, _CMP_GT_OQ)
#undef PINSING_COMPARE
PINSING_INLINE Mask operator&(Mask x, Mask y) { return Mask{x.a & y.a, x.b & y.b}; }
PINSING_INLINE Mask operator|(Mask x, Mask y) { return Mask{x.a | y.a, x.b | y.b}; }
PINSING_INLINE Mask operator~(Mask x) { return Mask{~x.a, ~x.b}; }
PINSING_INLINE Mask none() { return Mask{never(), never()}; }
PINSING_INLINE bool any(Mask m) { return any(m.a | m.b); }
PINSING_INLINE bool lane(Mask m, int i) { return i < kHalf ? lane(m.a, i) : lane(m.b, i - kHalf); }
PINSING_INLINE Mask odd(Bits k) { return Mask{odd(k.a), odd(k.b)}; }
PINSING_INLINE V select(Mask m, V x, V y) { return V{select(m.a, x.a, y.a), select(m.b, x.b, y.b)}; }

// One instruction each, on every machine that has it.
PINSING_INLINE One vsqrt(One x) {
    for (int i = 0; i < kHalf; i++) x.v[i] = __builtin_sqrt(x.v[i]);
    return x;
}
PINSING_INLINE One vmin(One x, One y) { return One{x.v < y.v ? x.v : y.v}; }
PINSING_INLINE One vmax(One x, One y) { return One{x.v > y.v ? x.v : y.v}; }
PINSING_INLINE One vmax(One x, double y) { return vmax(x, spread(y)); }
PINSING_INLINE V vsqrt(V x) { return V{vsqrt(x.a), vsqrt(x.b)}; }
PINSING_INLINE V vmin(V x, V y) { return V{vmin(x.a, y.a), vmin(x.b, y.b)}; }
PINSING_INLINE V vmax(V x, V y) { return V{vmax(x.a, y.a), vmax(x.b, y.b)}; }
PINSING_INLINE V vmax(V x, double y) { return vmax(x, broadcast(y)); }
PINSING_INLINE V vmin(V x, double y) { return vmin(x, broadcast(y)); }

PINSING_INLINE One vabs(One x) { return value(bits(x) & INT64_MAX); }
PINSING_INLINE V vabs(V x) { return value(bits(x) & INT64_MAX); }
template <class T> PINSING_INLINE T copysign(T magnitude, T sign) {
    return value(bits(vabs(magnitude)) | (bits(sign) & INT64_MIN));
}

// Lanes of a block, or of one machine vector, in memory.
template <class T> PINSING_INLINE double* lanes(T* x) { return reinterpret_cast<double*>(x); }

// A block x[k] (k < count) in lanes to rows of an array: out[i * count + k], lanes i < width.
PINSING_INLINE void store_rows(V* x, int count, int width, double* out) {
    if (count == 1) return (void)memcpy(out, x, width * sizeof(double));
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
