// Walks from configurations to nearby ones where the task Jacobian loses rank, a block at a time.
//
// The method, and its reasons, are those of pinsing/kinematics/refine.py, which is the same in
// NumPy: U0^T (J + sum_j dJ/dq_j dq_j) V0 = 0 by damped least-norm steps. Here the spaces U0 and V0
// come from the rotations of svd.hpp, the derivative from partial sums of columns.
//
// A lane that has arrived is computed on with the others, without effect.
constexpr double kNothing = 1.0e-28;   // square of an equation, over the longest one's, that is none
constexpr double kTiny = 1.0e-12;      // sigma_r / sigma_1 from which J v_r has no direction left

// Columns (n, m + n) of the rows of a Jacobian over a unit matrix, and rows (m, n + m) beside one, to be
// made orthogonal.
static void bordered(const Task& task, int n, const V* J, V* columns, V* rows) {
    const int m = task.m, length = m + n;
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < m; i++) columns[j * length + i] = J[task.row[i] * n + j];
        for (int k = 0; k < n; k++) columns[j * length + m + k] = broadcast(j == k ? 1.0 : 0.0);
    }
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < n; j++) rows[i * length + j] = columns[j * length + i];
        for (int k = 0; k < m; k++) rows[i * length + n + k] = broadcast(i == k ? 1.0 : 0.0);
    }
}

// sigma_1 and sigma_r at q.
static void ends_of_spectrum(const WalkTask& w, const V* q, V* J, V& first, V& last) {
    const int n = w.chain.n, m = w.task.m;
    V A[6 * kWalkJoints], S[kMaxRank];
    jacobian_block(w.chain, q, J);
    task_matrix(w.task, n, J, A);
    svd_of(m, n)(A, S);
    first = S[0];
    last = S[w.rank - 1];
}

// a x b, added to out; the parts of each are so many places apart.
template <class T>
PINSING_INLINE void add_cross(const T* a, int sa, const T* b, int sb, T* out, int so) {
    out[0] += a[sa] * b[2 * sb] - a[2 * sa] * b[sb];
    out[so] += a[2 * sa] * b[0] - a[0] * b[2 * sb];
    out[2 * so] += a[0] * b[sb] - a[sa] * b[0];
}

// u^T (dJ v / dq_j) for every joint, with u (6,) and v (n,): columns of later joints turn with joint
// j, and it is carried by the earlier ones (see jacobian_derivative in kinematics/jacobian.py).
static void derivative_along(const V* J, int n, const V* u, const V* v, V* out) {
    V later[6] = {}, earlier[3];
    for (int r = 0; r < 3; r++) earlier[r] = dot(v, J + (3 + r) * n, n);
    for (int j = n - 1; j >= 0; j--) {
        V turning[3] = {}, moving[3] = {};
        for (int r = 0; r < 6; r++) later[r] += v[j] * J[r * n + j];
        for (int r = 0; r < 3; r++) earlier[r] -= v[j] * J[(3 + r) * n + j];
        add_cross(later, 1, u, 1, turning, 1);
        add_cross(later + 3, 1, u + 3, 1, turning, 1);
        add_cross(u, 1, earlier, 1, moving, 1);
        out[j] = broadcast(0.0);
        for (int r = 0; r < 3; r++)
            out[j] += J[(3 + r) * n + j] * turning[r] + J[r * n + j] * moving[r];
    }
}

// The equations at the q that J was taken at: n derivatives and the value of each, in rows of n + 1;
// that of the singular triplet itself first.
static void equations_at(const WalkTask& w, const V* J, V* B) {
    const int n = w.chain.n, m = w.task.m, r = w.rank;
    V columns[kWalkJoints * (6 + kWalkJoints)], rows[6 * (kWalkJoints + 6)], own[6];
    const int length = m + n;
    bordered(w.task, n, J, columns, rows);
    orthogonalise(columns, n, m, n, length);
    // u_r is J v_r / sigma_r, which belongs to v_r where singular values are equal, too.
    const V* moved = columns + (r - 1) * length;
    const V first = dot(columns, columns, m), last = dot(moved, moved, m);
    const Mask has_direction = last > first * (kTiny * kTiny);
    const V scale = 1.0 / vsqrt(select(has_direction, last, broadcast(1.0)));
    if (m > r || any(~has_direction)) orthogonalise(rows, m, n, m, length);
    V* pair = B;
    for (int a = r - 1; a < m; a++) {
        V u[6] = {};
        for (int i = 0; i < m; i++) {
            own[i] = rows[a * length + n + i];
            if (a == r - 1) own[i] = select(has_direction, moved[i] * scale, own[i]);
            u[w.task.row[i]] = own[i];
        }
        for (int b = r - 1; b < n; b++, pair += n + 1) {
            const V* Jv = columns + b * length;
            derivative_along(J, n, u, Jv + m, pair);
            pair[n] = dot(own, Jv, m);
        }
    }
}

// The damped least-norm solution of B step = -values. B is destroyed.
static void solve_damped(V* B, int count, int n, V shift, V* step) {
    orthogonalise(B, count, n, 1, n + 1);
    for (int j = 0; j < n; j++) step[j] = broadcast(0.0);
    const V longest = dot(B, B, n);
    const V least = shift + longest * 4.930380657631324e-32 + 2.2250738585072014e-308;
    for (int k = 0; k < count; k++) {
        const V *row = B + k * (n + 1), square = dot(row, row, n);
        const Mask something = square > longest * kNothing;
        const V gain = select(something, row[n] / (square + least), broadcast(0.0));
        for (int j = 0; j < n; j++) step[j] -= gain * row[j];
    }
}

// One step at q: its length is bounded, joints at their limits do not leave them. Flat: sigma_r is at
// a minimum that is not zero.
static Mask step_at(const WalkTask& w, const V* q, const V* free, const V* J, V first, V last,
                    V damping, V* step) {
    const int n = w.chain.n, count = (w.task.m - w.rank + 1) * (n - w.rank + 1);
    V B[kWalkEquations * (kWalkJoints + 1)], copy[kWalkEquations * (kWalkJoints + 1)];
    equations_at(w, J, B);
    for (int k = 0; k < count; k++)
        for (int j = 0; j < n; j++) B[k * (n + 1) + j] *= free[j];
    const V shift = damping * last * last;
    const auto solve = [&] {
        for (int k = 0; k < count * (n + 1); k++) copy[k] = B[k];
        solve_damped(copy, count, n, shift, step);
    };
    solve();
    Mask blocked[kWalkJoints], some = none();
    const V zero = broadcast(0.0);
    for (int j = 0; j < n; j++) {
        blocked[j] = ((q[j] <= w.lower[j]) & (step[j] < zero)) |
                     ((broadcast(w.upper[j]) <= q[j]) & (step[j] > zero));
        some = some | blocked[j];
    }
    if (any(some)) {
        for (int k = 0; k < count; k++)
            for (int j = 0; j < n; j++)
                B[k * (n + 1) + j] = select(blocked[j], zero, B[k * (n + 1) + j]);
        solve();
    }
    for (int j = 0; j < n; j++) step[j] *= free[j];
    const V shorter = vmin(w.longest / vmax(vsqrt(dot(step, step, n)), 1e-300), 1.0);
    for (int j = 0; j < n; j++) step[j] *= shorter;
    return (dot(B, B, n) <= w.stationary * last * first) & (last > w.no_minimum * first);
}

// Walks of one block: q is moved. Out: derivatives taken, and 1 where a walk came to rest.
static void walk_block(const WalkTask& w, V* q, const V* free, V& taken, V& rest) {
    const int n = w.chain.n;
    V J[6 * kWalkJoints], other[6 * kWalkJoints], trial[2][kWalkJoints], step[kWalkJoints];
    V first, last, first_at[2], last_at[2];
    const V zero = broadcast(0.0), one = broadcast(1.0);
    ends_of_spectrum(w, q, J, first, last);
    const auto ratio_of = [&](V large, V small) {
        const V size = vmax(large, w.size);
        return select(size > zero, small / vmax(size, 1e-300), zero);
    };
    V damping = one, movable = zero;
    taken = rest = zero;
    for (int j = 0; j < n; j++) movable = vmax(movable, free[j]);
    Mask active = (ratio_of(first, last) > w.floor) & (movable > zero);
    for (int k = 0; k < w.max_iterations && any(active); k++) {
        taken = select(active, taken + one, taken);
        jacobian_block(w.chain, q, J);
        const Mask flat = step_at(w, q, free, J, first, last, damping, step);
        for (int t = 0; t < 2; t++) {
            const double times = t == 0 ? 1.0 : w.stretch;
            for (int j = 0; j < n; j++)
                trial[t][j] = vmin(vmax(q[j] + times * step[j], w.lower[j]), w.upper[j]);
            ends_of_spectrum(w, trial[t], other, first_at[t], last_at[t]);
        }
        const Mask stretch = last_at[1] < last_at[0];
        const V least = select(stretch, last_at[1], last_at[0]);
        const Mask improved = (least < last) & active;
        for (int j = 0; j < n; j++)
            q[j] = select(improved, select(stretch, trial[1][j], trial[0][j]), q[j]);
        first = select(improved, select(stretch, first_at[1], first_at[0]), first);
        last = select(improved, least, last);
        const V damped = vmax(damping * select(improved, broadcast(0.25), broadcast(16.0)), 1.0);
        damping = select(active, damped, damping);
        const V ratio = ratio_of(first, last);
        const Mask still = flat | (damping > w.most_damping);
        rest = select(active, select(still, one, zero), rest);
        active = active & ~((ratio <= w.floor) | still | ((ratio <= w.good) & ~improved));
    }
    // Where numbers overflow the end means nothing: that is left to who asked.
    taken = select((first <= kHuge) & (last <= kHuge), taken, broadcast(-1.0));
}
