// Two-sided bounds of the distance to conditions, a block of configurations at a time.
//
// For one equation, with g its gradient at x and M a bound of its second derivatives, Taylor's
// theorem gives |f| >= |f(x)| - |g| r - M r^2 / 2 within r: no zero is nearer than the root r of
// the right side, and along the gradient a zero is reached by the root of |f| - |g| r + M r^2 / 2,
// where that is real. Several equations: any sum of multiples of them is zero as well; the
// multiples are those of the least-norm step to their linearised zeros.
constexpr double kHuge = 1.7976931348623157e308;
constexpr double kWidest = 1.0e3;  // radius beyond which no bound of a polynomial is sought

// Value and gradient g of an equation at x.
static SumAt<V> equation_at(const Conditions& c, std::int64_t e, const V* x, V* g) {
    for (int j = 0; j < c.n; j++) g[j] = broadcast(0.0);
    return sum_at(c, e, all_joints(c), x, g, [](std::int64_t, const V&, const V&) {});
}

// Bound of the second derivatives within `radius` of x.
static V curvature_within(const Conditions& c, std::int64_t e, const V* x, V radius) {
    if (!c.sliding[e]) return broadcast(c.curvature[e]);
    V total = broadcast(0.0);
    for (std::int64_t t = c.term_start[e]; t < c.term_start[e + 1]; t++) {
        V size = broadcast(fabs(c.amplitude[t])), first = broadcast(0.0), squares = broadcast(0.0);
        for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++) {
            const V a = vmax(vabs(x[c.power_joint[k]]) + radius, 1e-150);
            size *= a;
            first += 1.0 / a;
            squares += (1.0 / a) * (1.0 / a);
        }
        const double r = c.rate_norm[t];
        const V second = c.largest ? first * first : vmax(first * first - squares, 0.0);
        total += size * (r * r + 2.0 * r * first + second);
    }
    return total * (1.0 + 1e-12);
}

PINSING_INLINE V dual_norm(const Conditions& c, const V* g) {
    if (!c.largest) return vsqrt(dot(g, g, c.n));
    V sum = broadcast(0.0);
    for (int j = 0; j < c.n; j++) sum += vabs(g[j]);
    return sum;
}

struct Both {
    V lower, upper;
};

// Within this there is no zero of the sum of multiples of k equations, from e on: `at` and g (k, n) are theirs
// at x, `both` (n,) is scratch.
static V no_nearer(const Conditions& c, std::int64_t e, int k, const SumAt<V>* at, const V* g,
                   const V* multiple, const V* x, V* both) {
    V value = broadcast(0.0), error = value, slope = value, curvature = value;
    for (int j = 0; j < c.n; j++) both[j] = broadcast(0.0);
    for (int i = 0; i < k; i++) {
        const V size = vabs(multiple[i]);
        value += multiple[i] * at[i].value;
        error += size * at[i].error;
        if (k > 1) error += size * vabs(at[i].value) * 1e-14;
        slope += size * at[i].slope_error;
        for (int j = 0; j < c.n; j++) both[j] += multiple[i] * g[i * c.n + j];
    }
    slope += dual_norm(c, both);
    const V left = vmax(vabs(value) - error, 0.0);
    const V radius = vmin(left / vmax(slope, 1e-300), kWidest);
    for (int i = 0; i < k; i++) curvature += vabs(multiple[i]) * curvature_within(c, e + i, x, radius);
    const V root = vsqrt(slope * slope + 2.0 * (curvature * left));
    return vmin((2.0 * left) / vmax(slope + root, 1e-300) * (1.0 - 8e-15), radius);
}

// How far a zero of an equation is at most, along its gradient.
static V reached_along(const Conditions& c, std::int64_t e, const SumAt<V>& at, const V* g, const V* x) {
    const V b = vabs(at.value) + at.error, least = dual_norm(c, g) - at.slope_error;
    const V within = vmin(2.0 * b / vmax(least, 1e-300), kWidest);
    const V room = least * least - 2.0 * (curvature_within(c, e, x, within) * b);
    const V reached = (2.0 * b) / vmax(least + vsqrt(vmax(room, 0.0)), 1e-300) * (1.0 + 8e-15);
    const Mask sure = (broadcast(0.0) <= room) & (least > 0.0) & (reached <= within * (1.0 + 1e-9));
    return select(sure, reached, broadcast(__builtin_inf()));
}

// Scratch of bounds_of_branch and reach_families, in blocks.
static std::size_t branch_blocks(int n) { return static_cast<std::size_t>(n * (kMaxCombined + 2)); }

// Bounds of the equations of one branch.
static Both bounds_of_branch(const Conditions& c, std::int64_t first, std::int64_t last, const V* x,
                             V* memory) {
    constexpr int most = kMaxCombined;
    const int n = c.n;
    V *g = memory, *both = g + (most + 1) * n;  // one more than are combined
    SumAt<V> at[most + 1];
    const V one = broadcast(1.0);
    Both best{broadcast(0.0), broadcast(__builtin_inf())};
    for (std::int64_t e = first; e < last; e++) {
        const int i = e - first < most ? static_cast<int>(e - first) : most;
        at[i] = equation_at(c, e, x, g + i * n);
        best.lower = vmax(best.lower, no_nearer(c, e, 1, at + i, g + i * n, &one, x, both));
        if (last - first == 1) best.upper = reached_along(c, e, at[i], g, x);
    }
    const int k = static_cast<int>(last - first < most ? last - first : most);
    if (k < 2) return best;
    V multiple[most];
    for (int i = 0; i < k; i++) multiple[i] = at[i].value;
    least_norm([=](int i) { return g + i * n; }, k, n, multiple, 1e-13, 1e-15);
    const V joined = no_nearer(c, first, k, at, g, multiple, x, both);
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
            const SumAt<V> at = sums == 0 ? SumAt<V>{more, more, more, more} : equation_at(c, e, p, g);
            if (sums > 0) more = reached_along(c, e, at, g, p);
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
