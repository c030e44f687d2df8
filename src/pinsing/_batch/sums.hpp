// Included inside a namespace, for numbers and for blocks of them: one equation of conditions.hpp at a point.

// Its value, bounds of what rounding adds to that and to the length of the gradient, and their share of the
// terms.
template <class T>
struct SumAt {
    T value, error, slope_error, relative;
};

// Which of x are the joints of rates and powers, from the first ones of these on.
template <class Number>
struct Joints {
    const Number *rate, *power;
    std::int64_t first_rate = 0, first_power = 0;
    Number of_rate(std::int64_t k) const { return rate[k - first_rate]; }
    Number of_power(std::int64_t k) const { return power[k - first_power]; }
};
inline Joints<std::int64_t> all_joints(const Conditions& c) { return {c.rate_joint, c.power_joint}; }

// Equation e at x; its gradient is added to g, which is zero. `each` is told every term, and its angle's
// sine and cosine.
template <class T, class Number, class Each>
[[gnu::always_inline]] inline SumAt<T> sum_at(const Conditions& c, std::int64_t e, Joints<Number> joints,
                                              const T* x, T* g, Each each) {
    T value = broadcast(0.0), size = broadcast(0.0), steep = broadcast(c.steepness[e]);
    T farthest = broadcast(4.0);
    for (std::int64_t t = c.term_start[e], end = c.term_start[e + 1]; t < end; t++) {
        T angle = broadcast(c.phase[t]), sine, cosine;
        const std::int64_t rates = c.rate_start[t + 1];
        for (std::int64_t k = c.rate_start[t]; k < rates; k++) {
            const T xj = x[joints.of_rate(k)];
            angle += c.rate[k] * xj;
            farthest = vmax(farthest, vabs(xj));
        }
        sincos(angle, sine, cosine);
        const std::int64_t first = c.power_start[t], last = c.power_start[t + 1];
        T power = broadcast(c.amplitude[t]);
        for (std::int64_t k = first; k < last; k++) power *= x[joints.of_power(k)];
        value += power * cosine;
        size += vabs(power);
        const T turned = power * sine;
        for (std::int64_t k = c.rate_start[t]; k < rates; k++)
            g[joints.of_rate(k)] -= turned * c.rate[k];
        if (c.sliding[e]) steep += vabs(power) * c.rate_norm[t];
        for (std::int64_t k = first; k < last; k++) {
            T lowered = broadcast(c.amplitude[t]);
            for (std::int64_t i = first; i < last; i++)
                if (i != k) lowered *= x[joints.of_power(i)];
            g[joints.of_power(k)] += lowered * cosine;
            steep += vabs(lowered);
        }
        each(t, sine, cosine);
    }
    const T relative = c.noise[e] + 4.5e-16 * c.reach[e] * farthest;
    return {value, size * relative, steep * relative, relative};
}
