// Two-sided bounds of the distance to conditions, a block of configurations at a time.
//
// For one equation, with g its gradient at x and M a bound of its second derivatives, Taylor's
// theorem gives |f| >= |f(x)| - |g| r - M r^2 / 2 within r: no zero is nearer than the root r of
// the right side, and along the gradient a zero is reached by the root of |f| - |g| r + M r^2 / 2,
// where that is real. Several equations: any sum of multiples of them is zero as well; the
// multiples are those of the least-norm step to their linearised zeros.
constexpr double kHuge = 1.7976931348623157e308;
constexpr double kWidest = 1.0e3;  // radius beyond which no bound of a polynomial is sought

struct SumAt {
    V value, error, slope_error;
};

// Value and gradient (added to g, which is zero) at x.
static SumAt sum_at(const Conditions& c, std::int64_t e, const V* x, V* g) {
    V v = broadcast(0.0), size = broadcast(0.0), steep = broadcast(c.steepness[e]);
    V farthest = broadcast(4.0);
    for (std::int64_t t = c.term_start[e]; t < c.term_start[e + 1]; t++) {
        V angle = broadcast(c.phase[t]);
        for (std::int64_t k = c.rate_start[t]; k < c.rate_start[t + 1]; k++) {
            const V xj = x[c.rate_joint[k]];
            angle += c.rate[k] * xj;
            farthest = vmax(farthest, vabs(xj));
        }
        V s, co;
        sincos(angle, s, co);
        V power = broadcast(c.amplitude[t]);
        for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++)
            for (std::int64_t p = 0; p < c.power[k]; p++) power *= x[c.power_joint[k]];
        v += power * co;
        size += vabs(power);
        const V turned = power * s;
        for (std::int64_t k = c.rate_start[t]; k < c.rate_start[t + 1]; k++)
            g[c.rate_joint[k]] -= turned * c.rate[k];
        if (c.sliding[e]) steep += vabs(power) * c.rate_norm[t];
        for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++) {
            V lowered = broadcast(c.amplitude[t] * static_cast<double>(c.power[k]));
            for (std::int64_t i = c.power_start[t]; i < c.power_start[t + 1]; i++)
                for (std::int64_t p = i == k ? 1 : 0; p < c.power[i]; p++)
                    lowered *= x[c.power_joint[i]];
            g[c.power_joint[k]] += lowered * co;
            steep += vabs(lowered);
        }
    }
    const V relative = c.noise[e] + 4.5e-16 * c.reach[e] * farthest;
    return SumAt{v, size * relative, steep * relative};
}

// Bound of the second derivatives within `radius` of x.
static V curvature_within(const Conditions& c, std::int64_t e, const V* x, V radius) {
    if (!c.sliding[e]) return broadcast(c.curvature[e]);
    V total = broadcast(0.0);
    for (std::int64_t t = c.term_start[e]; t < c.term_start[e + 1]; t++) {
        V size = broadcast(fabs(c.amplitude[t])), first = broadcast(0.0), squares = broadcast(0.0);
        for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++) {
            const V a = vmax(vabs(x[c.power_joint[k]]) + radius, 1e-150);
            for (std::int64_t p = 0; p < c.power[k]; p++) size *= a;
            const double p = static_cast<double>(c.power[k]);
            first += p / a;
            squares += (p / a) * (1.0 / a);
        }
        const double r = c.rate_norm[t];
        const V second = c.largest ? first * first : vmax(first * first - squares, 0.0);
        total += size * (r * r + 2.0 * r * first + second);
    }
    return total * (1.0 + 1e-12);
}

PINSING_INLINE V dual_norm(const Conditions& c, const V* g) {
    V sum = broadcast(0.0);
    for (int j = 0; j < c.n; j++) sum += c.largest ? vabs(g[j]) : g[j] * g[j];
    return c.largest ? sum : vsqrt(sum);
}

struct Both {
    V lower, upper;
};

static V no_nearer(V value, V slope, V curvature) {
    const V root = vsqrt(slope * slope + 2.0 * (curvature * value));
    return (2.0 * value) / vmax(slope + root, 1e-300) * (1.0 - 8e-15);
}

static Both bounds_of_equation(const Conditions& c, std::int64_t e, const V* x, const SumAt& at,
                               const V* g) {
    const V norm = dual_norm(c, g);
    const V a = vmax(vabs(at.value) - at.error, 0.0), b = vabs(at.value) + at.error;
    const V steepest = norm + at.slope_error, least = norm - at.slope_error;
    const V radius = vmin(a / vmax(steepest, 1e-300), kWidest);
    const V lower = vmin(no_nearer(a, steepest, curvature_within(c, e, x, radius)), radius);
    const V within = vmin(2.0 * b / vmax(least, 1e-300), kWidest);
    const V room = least * least - 2.0 * (curvature_within(c, e, x, within) * b);
    const V reached = (2.0 * b) / vmax(least + vsqrt(vmax(room, 0.0)), 1e-300) * (1.0 + 8e-15);
    const V infinite = broadcast(__builtin_inf());
    const V upper = select((broadcast(0.0) <= room) & (least > 0.0) & (reached <= within * (1.0 + 1e-9)),
                     reached, infinite);
    return Both{lower, upper};
}

// Scratch of bounds_of_branch, in blocks.
static std::size_t branch_blocks(int n) {
    const int k = kMaxCombined;
    return static_cast<std::size_t>(n * (k + 2) + k * 4);
}

// Bounds of the equations of one branch.
static Both bounds_of_branch(const Conditions& c, std::int64_t first, std::int64_t last, const V* x,
                             V* memory) {
    const int n = c.n, most = kMaxCombined;
    V* g = memory;  // one more than are combined
    V* both = g + (most + 1) * n;
    V* value = both + n;
    V* error = value + most;
    V* slope_error = error + most;
    V* multiple = slope_error + most;
    Both best{broadcast(0.0), broadcast(__builtin_inf())};
    for (std::int64_t e = first; e < last; e++) {
        const int i = e - first < most ? static_cast<int>(e - first) : most;
        V* ge = g + i * n;
        for (int j = 0; j < n; j++) ge[j] = broadcast(0.0);
        const SumAt at = sum_at(c, e, x, ge);
        const Both one = bounds_of_equation(c, e, x, at, ge);
        best.lower = vmax(best.lower, one.lower);
        if (last - first == 1) best.upper = one.upper;
        if (i == most) continue;
        value[i] = at.value;
        error[i] = at.error;
        slope_error[i] = at.slope_error;
    }
    const int k = static_cast<int>(last - first < most ? last - first : most);
    if (k < 2) return best;
    for (int i = 0; i < k; i++) multiple[i] = value[i];
    least_norm([=](int i) { return g + i * n; }, k, n, multiple, 1e-13, 1e-15);
    V v = broadcast(0.0), err = broadcast(0.0), slope = broadcast(0.0), sizes = broadcast(0.0);
    for (int j = 0; j < n; j++) both[j] = broadcast(0.0);
    for (int i = 0; i < k; i++) {
        const V size = vabs(multiple[i]);
        v += multiple[i] * value[i];
        err += size * error[i];
        slope += size * slope_error[i];
        sizes += size * vabs(value[i]);
        for (int j = 0; j < n; j++) both[j] += multiple[i] * g[i * n + j];
    }
    const V steep = dual_norm(c, both) + slope;
    const V a = vmax(vabs(v) - err - sizes * 1e-14, 0.0);
    const V radius = vmin(a / vmax(steep, 1e-300), kWidest);
    V curvature = broadcast(0.0);
    for (int i = 0; i < k; i++)
        curvature += vabs(multiple[i]) * curvature_within(c, first + i, x, radius);
    const V joined = vmin(no_nearer(a, steep, curvature), radius);
    best.lower = vmax(best.lower, select(joined <= kHuge, joined, broadcast(0.0)));
    return best;
}

// x, a joint's value, less the nearest copy of a value of a branch.
PINSING_INLINE V off_value(const Conditions& c, std::int64_t i, V x) {
    const double turn = c.turn[c.value_joint[i]], magic = 6755399441055744.0;
    const V off = x - c.value[i];
    if (turn == 0.0) return off;
    return off - ((vmin(vmax(off * (1.0 / turn), -1e15), 1e15) + magic) - magic) * turn;
}

// Distance of the joints of a branch from their values.
static Both bounds_of_values(const Conditions& c, std::int64_t first, std::int64_t last,
                             const V* x) {
    V total = broadcast(0.0), slack = broadcast(0.0);
    for (std::int64_t i = first; i < last; i++) {
        const std::int64_t j = c.value_joint[i];
        const V off = off_value(c, i, x[j]);
        const double turn = c.turn[j];
        slack = vmax(slack, (vabs(x[j]) + (fabs(c.value[i]) + turn)) * 4.5e-16);
        total = c.largest ? vmax(total, vabs(off)) : total + off * off;
    }
    if (!c.largest) total = vsqrt(total);
    slack = slack * static_cast<double>(last - first) + total * 1e-15;
    return Both{vmax(total - slack, 0.0), total + slack};
}

PINSING_INLINE V joined(const Conditions& c, V x, V y) {
    return c.largest ? vmax(x, y) : vsqrt(x * x + y * y);
}

// Bounds of the distance to each family: bound[2 f] and bound[2 f + 1].
static void bounds_of_families(const Conditions& c, const V* x, V* bound, V* memory) {
    for (int f = 0; f < c.families; f++) bound[2 * f] = bound[2 * f + 1] = broadcast(__builtin_inf());
    for (int b = 0; b < c.branches; b++) {
        Both at{broadcast(0.0), broadcast(0.0)};
        const bool values = c.value_start[b + 1] > c.value_start[b];
        const bool equations = c.equation_start[b + 1] > c.equation_start[b];
        if (values) at = bounds_of_values(c, c.value_start[b], c.value_start[b + 1], x);
        if (equations) {
            const Both part =
                bounds_of_branch(c, c.equation_start[b], c.equation_start[b + 1], x, memory);
            at.lower = values ? joined(c, at.lower, part.lower) * (1.0 - 1e-15) : part.lower;
            at.upper = values ? joined(c, at.upper, part.upper) * (1.0 + 1e-15) : part.upper;
        }
        const std::int64_t f = c.family[b];
        bound[2 * f] = vmin(bound[2 * f], at.lower);
        bound[2 * f + 1] = vmin(bound[2 * f + 1], at.upper);
    }
}

constexpr int kSteps = 12;        // to the nearest point of a surface
constexpr double kShare = 0.6;    // of the way to where the last tangent plane is nearest
constexpr double kLongest = 0.6;  // of a step

// Upper bounds that are closer, with points (families, n) that they rest on: families are no farther
// from these than a bound is longer than the way to its point. Of surfaces they are on the way to a
// nearest one.
static void reach_families(const Conditions& c, const V* x, V* bound, V* points, V* memory) {
    const int n = c.n;
    V *start = memory, *p = start + n, *g = p + n;
    for (int i = 0; i < c.families * n; i++) points[i] = x[i % n];
    for (int b = 0; b < c.branches; b++) {
        const std::int64_t e = c.equation_start[b], sums = c.equation_start[b + 1] - e;
        const std::int64_t first = c.value_start[b], last = c.value_start[b + 1];
        V &upper = bound[2 * c.family[b] + 1], *point = points + c.family[b] * n;
        for (int j = 0; j < n; j++) start[j] = x[j];
        for (auto i = first; i < last; i++)
            start[c.value_joint[i]] -= off_value(c, i, x[c.value_joint[i]]);
        for (int j = 0; j < n; j++) p[j] = start[j];
        for (int k = 0; sums < 2 && k <= sums * kSteps; k++) {
            V way = broadcast(0.0), more = way;
            for (int j = 0; j < n; j++) {
                way += (p[j] - x[j]) * (p[j] - x[j]);
                g[j] = broadcast(0.0);
            }
            const SumAt at = sums == 0 ? SumAt{more, more, more} : sum_at(c, e, p, g);
            if (sums > 0) more = bounds_of_equation(c, e, p, at, g).upper;
            way = (vsqrt(way) + more) * (1.0 + 1e-9);
            // Bounds of values have no points yet.
            const Mask closer = way <= upper * (sums == 0 ? 1.0 + 1e-8 : 1.0);
            for (int j = 0; j < n; j++) point[j] = select(closer, p[j], point[j]);
            upper = vmin(way, upper);
            for (auto i = first; i < last; i++) g[c.value_joint[i]] = broadcast(0.0);
            V along = broadcast(0.0) - at.value, square = broadcast(1e-12), far = square;
            for (int j = 0; j < n; j++) {
                along += g[j] * (p[j] - start[j]);
                square += g[j] * g[j];
            }
            for (int j = 0; j < n; j++) {
                g[j] = start[j] + g[j] * along / square - p[j];
                far += g[j] * g[j];
            }
            const V share = vmin(kLongest / vsqrt(far), kShare);
            for (int j = 0; j < n; j++) p[j] += g[j] * share;
        }
    }
}
