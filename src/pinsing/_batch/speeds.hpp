// Joint speeds that tip motions take in boxes of configurations, one box in each lane: the bounds of
// pinsing/proximity/zones.py, which says what they rest on and what the letters are. One
// machine vector at a time, so that what belongs to a box stays in the first caches.
constexpr double kSpeedRounding = 1.0e-12;
constexpr double kLeastWeight = 0.3;  // of a share, by which joints weigh in the next right inverse
constexpr int kPairSteps = 5;
constexpr double kFreeTurn = 100.0;   // speed of a turn without a limit over the fastest joint's

PINSING_INLINE void clear(One* x, int count) {
    for (int i = 0; i < count; i++) x[i] = spread(0.0);
}

struct Span {
    int first, last;
};

// A small matrix in each lane; a vector is one of one column.
struct Matrix {
    int rows = 0, columns = 1;
    One at[kSpeedColumns * kSpeedColumns];

    Matrix() {}
    explicit Matrix(int rows, int columns = 1) { reset(rows, columns); }
    Matrix(const Matrix& other) { *this = other; }
    Matrix& operator=(const Matrix& other) {
        rows = other.rows, columns = other.columns;
        for (int i = 0; i < size(); i++) at[i] = other.at[i];
        return *this;
    }
    void reset(int m, int n = 1) {
        rows = m, columns = n;
        clear(at, size());
    }
    int size() const { return rows * columns; }
    One* operator[](int i) { return at + i * columns; }
    const One* operator[](int i) const { return at + i * columns; }

    // Adds A B times a sign; A has others than zero in the columns `own`, B in `some`.
    PINSING_METHOD void add(const Matrix& A, const Matrix& B, double sign, Span own, Span some) {
        for (int i = 0; i < rows; i++)
            for (int j = some.first; j < some.last; j++) {
                One sum = (*this)[i][j];
                for (int l = own.first; l < own.last; l++) sum += A[i][l] * B[l][j] * sign;
                (*this)[i][j] = sum;
            }
    }
    PINSING_METHOD void add_sizes(const Matrix& of, One times) {
        for (int i = 0; i < size(); i++) at[i] += vabs(of.at[i]) * times;
    }
};

template <class Each>
PINSING_INLINE Matrix entries(const Matrix& A, Each each) {
    Matrix out;
    out.rows = A.rows, out.columns = A.columns;
    for (int i = 0; i < A.size(); i++) out.at[i] = each(i);
    return out;
}
PINSING_INLINE Matrix operator+(const Matrix& A, const Matrix& B) {
    return entries(A, [&](int i) { return A.at[i] + B.at[i]; });
}
PINSING_INLINE Matrix operator-(const Matrix& A, const Matrix& B) {
    return entries(A, [&](int i) { return A.at[i] - B.at[i]; });
}
PINSING_INLINE Matrix operator*(const Matrix& A, double times) {
    return entries(A, [&](int i) { return A.at[i] * times; });
}
PINSING_INLINE Matrix operator*(const Matrix& A, const Matrix& B) {
    Matrix out(A.rows, B.columns);
    out.add(A, B, 1.0, {0, B.rows}, {0, B.columns});
    return out;
}
PINSING_INLINE Matrix sizes(const Matrix& A) {
    return entries(A, [&](int i) { return vabs(A.at[i]); });
}
PINSING_INLINE Matrix unit(int n) {
    Matrix out(n, n);
    for (int i = 0; i < n; i++) out[i][i] = spread(1.0);
    return out;
}

// The product of what two rows have in some columns.
PINSING_INLINE One dot(const One* x, const One* y, Span own) {
    One sum = spread(0.0);
    for (int a = own.first; a < own.last; a++) sum += x[a] * y[a];
    return sum;
}

struct BoxOfSpeeds {
    const SpeedTask& task;
    const int k, m;  // columns and rows of the Jacobian
    const Span shifts, turns, all;  // rows of the task: translations, rotations
    double share[kSpeedColumns] = {};  // of its limit that a joint takes at speed one
    Matrix J, M, A, size, E1, E2, E3, Q;
    Matrix S[kSpeedColumns], G[kSpeedColumns], B[kSpeedColumns];  // slopes by the active joints
    Matrix F, center, along, pull;
    One r[kSpeedColumns], moved[3];
    int active[kSpeedColumns], joints = 0;

    explicit BoxOfSpeeds(const SpeedTask& t)
        : task(t), k(t.k), m(t.m), shifts{0, t.linear}, turns{t.linear, m}, all{0, m}, J(6, k) {
        for (int j = 0; j < task.n; j++) share[j] = 1.0 / task.limits[j];
    }

    // Rows of the task (m, k) of K (6, k).
    Matrix rows_of(const Matrix& K) const {
        Matrix out(m, k);
        for (int i = 0; i < m; i++)
            for (int a = 0; a < 6; a++) {
                const double factor = task.rows[6 * i + a];
                if (factor != 0.0)
                    for (int j = 0; j < k; j++) out[i][j] += K[a][j] * factor;
            }
        return out;
    }

    bool behind(int j) const { return j > task.middle; }
    // Columns that joint j changes: those between it and the middle.
    Span changed(int j) const { return {behind(j) ? j + 1 : 0, behind(j) ? k : j}; }
    // Columns that joints i <= j both change.
    Span changed(int i, int j) const {
        if (behind(i) != behind(j)) return {0, 0};
        return changed(behind(j) ? j : i);
    }

    // Adds the derivative (6, k) of K by joint j, column j being that of L.
    void add_slope(const Matrix& K, const Matrix& L, int j, Matrix& out) const {
        const auto add = [&](const One* of_i, const One* of_j, One* to) {
            behind(j) ? add_cross(of_j, k, of_i, k, to, k) : add_cross(of_i, k, of_j, k, to, k);
        };
        const One *v = L[0] + j, *w = L[3] + j;
        for (int i = changed(j).first; i < changed(j).last; i++) {
            add(K[0] + i, w, out[0] + i);
            add(K[3] + i, v, out[0] + i);
            add(K[3] + i, w, out[3] + i);
        }
    }

    // Adds to or takes off the derivative (k, m) of A X by joint j, which moves the tip by v.
    void add_carried(double sign, int j, const One* v, int stride, Matrix& out) const {
        if (!behind(j)) return;
        for (int i = 0; i < k; i++) {
            One a[3], turn[3];
            clear(a, 3);
            clear(turn, 3);
            for (int b = 0; b < m; b++)
                for (int c = 0; c < 3; c++) a[c] += A[i][b] * task.rows[6 * b + c];
            add_cross(a, 1, v, stride, turn, 1);
            for (int b = 0; b < m; b++)
                for (int c = 0; c < 3; c++)
                    out[i][b] += turn[c] * (sign * task.rows[6 * b + 3 + c]);
        }
    }

    static One length(const One* row, Span own) { return vsqrt(dot(row, row, own)); }

    // Largest component of a row (m,) times any of the twists.
    One norm(const One* row) const {
        return length(row, shifts) * task.tip_speed + length(row, turns) * task.turn_speed;
    }

    One largest(const Matrix& z) const {
        One most = spread(0.0);
        for (int j = 0; j < task.n; j++) most = vmax(most, z.at[j] * share[j]);
        return most;
    }

    // A: a least square, with the weights that make the largest share least of those that are looked
    // at. Joints weigh more that take more (C. L. Lawson, 1961: to the power 1; 3/2 is sooner there).
    void take_inverse() {
        double fastest = 0.0;
        for (int j = 0; j < task.n; j++) fastest = task.limits[j] > fastest ? task.limits[j] : fastest;
        One ease[kSpeedColumns], least = spread(__builtin_inf());
        for (int j = 0; j < k; j++) {
            const double speed = j < task.n ? task.limits[j] : kFreeTurn * fastest;
            ease[j] = spread(speed * speed);
        }
        A.reset(k, m);
        for (int round = 0; round < (k == m || !task.rounds ? 1 : task.rounds); round++) {
            Matrix eased(k, m), z(k);
            for (int j = 0; j < k; j++)
                for (int i = 0; i < m; i++) eased[j][i] = M[i][j] * ease[j];
            Matrix N = M * eased, X = eased;
            solve_spd(N.at, X.at, m, 0.0, 0.0, k);
            const Matrix next = X * 2.0 - X * (M * X);  // one step of Newton's method
            for (int j = 0; j < k; j++) z.at[j] = norm(next[j]);
            const One most = largest(z);
            const OneMask better = most < least;
            least = select(better, most, least);
            for (int i = 0; i < A.size(); i++) A.at[i] = select(better, next.at[i], A.at[i]);
            for (int j = 0; j < task.n; j++) {
                const One part = vmax(z.at[j] * share[j] / most, kLeastWeight);
                ease[j] = ease[j] / (part * vsqrt(part));
            }
        }
        if (k == m + 1 && !task.rounds) take_pair(least);
    }

    // With one joint to spare the right inverses are A + s w for any row w (m,). What the worst twists
    // take of a joint's limit and of another's together is least where both take as much: w is of the
    // two that take most, and goes some steps to where the one that takes most of all is at rest.
    void take_pair(One least) {
        const Matrix aside = unit(k) - A * M;
        Matrix at = A;
        One still[kSpeedColumns], s[kSpeedColumns], w[6], pair[6], best[6], sum[6];
        One longest = spread(-1.0), most = longest;
        clear(w, m);
        clear(best, m);
        for (int j = 0; j < k; j++) {  // s: of these columns the largest on the diagonal
            const OneMask better = aside[j][j] > longest;
            longest = select(better, aside[j][j], longest);
            for (int i = 0; i < k; i++) still[i] = select(better, aside[i][j], still[i]);
        }
        const auto not_small = [](One x) {
            return select(vabs(x) < kSpeedRounding, spread(1.0), x);
        };
        const auto taken = [&](int i, const One* by) {
            for (int a = 0; a < m; a++) sum[a] = at[i][a] + s[i] * by[a];
            return norm(sum);
        };
        for (int i = 0; i < k; i++) {
            s[i] = still[i] * share[i];
            for (int a = 0; a < m; a++) at[i][a] *= spread(share[i]);
            for (int j = 0; j < i; j++) {
                const One side = select(s[i] * s[j] < 0.0, spread(1.0), spread(-1.0));
                const One both = not_small(s[i] - side * s[j]);
                for (int a = 0; a < m; a++) pair[a] = (side * at[j][a] - at[i][a]) / both;
                const One takes = taken(i, pair);
                const OneMask more = takes > most;
                most = select(more, takes, most);
                for (int a = 0; a < m; a++) w[a] = select(more, pair[a], w[a]);
            }
        }
        for (int step = 0; step < kPairSteps; step++) {
            One worst = spread(0.0);
            for (int i = 0; i < task.n; i++) {
                const One takes = taken(i, w), own = not_small(s[i]);
                const OneMask more = takes > worst;
                worst = select(more, takes, worst);
                for (int a = 0; a < m; a++) pair[a] = select(more, -1.0 * at[i][a] / own, pair[a]);
            }
            const OneMask better = worst < least;
            least = select(better, worst, least);
            const One way = vmax((worst - most) / vmax(worst, spread(kSpeedRounding)), spread(0.0));
            for (int a = 0; a < m; a++) {
                best[a] = select(better, w[a], best[a]);
                w[a] += way * (pair[a] - w[a]);
            }
        }
        for (int i = 0; i < k; i++)
            for (int a = 0; a < m; a++) A[i][a] += still[i] * best[a];
    }

    // E3: what the fourth order of J adds and more, and its rounding. With V_b the length of column b the
    // fourth derivative of column k by turning joints between it and the middle is at most the sum of V
    // of the five. And how far the tip moves in the axes in the middle: by all orders, all but the first,
    // and all but the second.
    void bound_rest() {
        One here[kSpeedColumns], far[kSpeedColumns], turning[kSpeedColumns];
        const One zero = spread(0.0);
        One beyond = zero, moves = zero, pairs = zero, triples = zero, d = zero;
        double reach = 0.0;
        for (int j = k - 1; j >= 0; j--) {
            here[j] = vsqrt(J[0][j] * J[0][j] + J[1][j] * J[1][j] + J[2][j] * J[2][j]);
            far[j] = vmin(spread(task.far[j]), here[j] + beyond);
            beyond += r[j] * task.far[j];
            reach = task.far[j] > reach ? task.far[j] : reach;
            turning[j] = task.turns[j] ? r[j] : zero;
        }
        // Behind the middle, of products of two and three the later one at each place.
        for (int j = task.middle + 1; j < k; j++) {
            const One others = d, move = r[j] * far[j];
            d += turning[j];
            moves += move;
            pairs += far[j] * turning[j] * turning[j] + move * others * 2.0;
            One triple = far[j] * (d * d * d - others * others * others);
            if (!task.turns[j]) triple += move * others * others * 3.0;
            triples += triple;
        }
        One linear[kSpeedColumns], angular[kSpeedColumns];
        for (int side = 0; side < 2; side++) {
            One angle = zero, arms = zero;
            for (int j = task.middle + side; side ? j < k : j >= 0; j += side ? 1 : -1) {
                // Of the point that is still, which the joints between move.
                const One lever = task.turns[j] ? here[j] + arms : here[j], power = angle * angle * angle;
                linear[j] = (arms * 4.0 + lever * angle) * power * (1.0 / 24.0) +
                            (here[j] + (task.far[j] + 1.0)) * kSpeedRounding;
                angular[j] = angle * power * (1.0 / 24.0) + kSpeedRounding;
                angle += turning[j];
                arms += r[j] * lever;
            }
        }
        moved[2] = triples * (1.0 / 6.0) + kSpeedRounding * (reach + 1.0);
        moved[1] = moved[2] + pairs * 0.5;
        moved[0] = moved[1] + moves;
        E3.reset(k, k);
        for (int i = 0; i < k; i++) {
            const One v = length(A[i], shifts), w = length(A[i], turns);
            for (int j = 0; j < k; j++) E3[i][j] = v * linear[j] + w * angular[j];
        }
    }

    // F (k,): the largest of (A - E1 A) X x in the box; at its centre; and by joint.
    void first_order() {
        F.reset(k);
        center.reset(k);
        along.reset(k, joints);
        for (int i = 0; i < k; i++) {
            One extra = spread(0.0), aside[kSpeedColumns], ways[kSpeedColumns];
            clear(aside, joints);
            for (int kind = 0; kind < 2; kind++) {
                const Span own = kind == 0 ? shifts : turns;
                const double speed = kind == 0 ? task.tip_speed : task.turn_speed;
                const One size = length(A[i], own), scale = 1.0 / vmax(size, 1e-300);
                One across = spread(0.0), least = size;
                for (int h = 0; h < joints; h++) {
                    const One by = r[active[h]], with = dot(B[h][i], A[i], own) * scale;
                    One whole = spread(0.0);
                    for (int a = own.first; a < own.last; a++) {
                        const One off = B[h][i][a] - with * A[i][a] * scale;
                        whole += off * off;
                    }
                    across += ways[h] = by * vsqrt(whole);
                    least -= by * vabs(with);
                    along[i][h] += with * speed;
                }
                One bent = vmin(across, across * across / (vmax(least, 1e-100) * 2.0));
                bent = select(least > 0.0, bent, across - least * 2.0) * speed;
                extra += bent;
                for (int h = 0; h < joints; h++) aside[h] += bent * ways[h] / vmax(across, 1e-100);
                center.at[i] += size * speed;
            }
            F.at[i] = center.at[i] + extra;
            for (int h = 0; h < joints; h++) {
                along[i][h] = vabs(along[i][h]) * r[active[h]];
                F.at[i] += along[i][h];
                along[i][h] += aside[h];
            }
        }
    }

    // What third derivatives by joints i <= h and those no farther from the middle add to E3.
    void third_order(const Matrix& both, int i, int h, One rr) {
        for (int o = behind(active[h]) ? 0 : h; o < joints; o++) {
            if (behind(active[o]) != behind(active[h]) || (behind(active[h]) && o > i)) continue;
            const One rrr = rr * r[active[o]] * (1.0 / (1.0 + (o == i) + (o == h)));
            Matrix slope(6, k), AD(k, k);
            add_slope(both, J, active[o], slope);
            const Matrix D = rows_of(slope);
            size.add_sizes(D, rrr);
            AD.add(A, D, 1.0, all, changed(active[i], active[h]));
            E3.add_sizes(AD, rrr);
        }
    }

    // What second derivatives add to E2, Q, F (which is returned), and to what joints pull; and third
    // to E3.
    Matrix second_order() {
        Matrix bent(k);
        E2.reset(k, k);
        Q.reset(k, k);
        for (int i = 0; i < joints; i++)
            for (int h = i; h < joints; h++) {
                const int p = active[i], q = active[h];
                const Span first = changed(p), second = changed(q), common = changed(p, q);
                const One rr = r[p] * r[q] * (h > i ? 1.0 : 0.5);
                Matrix AD(k, k), twice(k, k), turned(k, m), here(k);
                if (common.last > common.first) {
                    Matrix both(6, k);
                    // Bilinear in columns, so that the rule of products gives its derivative.
                    add_slope(S[h], J, p, both);
                    add_slope(J, S[h], p, both);
                    const Matrix D = rows_of(both);
                    size.add_sizes(D, rr);
                    AD.add(A, D, 1.0, all, common);
                    turned.add(AD, A, -1.0, common, all);
                    third_order(both, i, h, rr);
                }
                // The same again where h is i.
                twice.add(G[i], G[h], 1.0, first, second);
                twice.add(G[h], G[i], 1.0, second, first);
                E2.add_sizes(AD, rr);
                for (int a = 0; a < Q.size(); a++) Q.at[a] += vabs(twice.at[a] - AD.at[a]) * rr;
                turned.add(G[i], B[h], 1.0, first, all);
                turned.add(G[h], B[i], 1.0, second, all);
                One v[3];
                clear(v, 3);
                add_cross(J[3] + p, k, J[0] + q, k, v, 1);
                add_carried(1.0, p, v, 1, turned);
                for (int a = 0; a < k; a++) bent.at[a] += here.at[a] = norm(turned[a]) * rr;
                pull.at[p] += largest(here);
                pull.at[q] += largest(here);
            }
        return bent;
    }

    // y (k,), at least all joint speeds in the box; where nothing is proven, the mask is empty.
    OneMask solved(const Matrix& bent, Matrix& y) {
        const Matrix a = sizes(A);
        const Matrix missed = sizes(M * A - unit(m)) + sizes(M) * a * kSpeedRounding;
        One off = spread(0.0);
        for (int i = 0; i < m; i++) {
            One row = spread(0.0);
            for (int j = 0; j < m; j++) row += missed[i][j];
            off = vmax(off, row * 2.0);
        }
        Matrix rounding = size * kSpeedRounding;
        for (int j = 0; j < k; j++) {
            One column = spread(0.0);
            for (int i = 0; i < m; i++) column += size[i][j] * off;
            for (int i = 0; i < m; i++) rounding[i][j] += column;
        }
        const Matrix slack = a * rounding, e1 = E1 + slack, e3 = E3 + slack, rest = E2 + slack + e3;
        const Matrix q = Q + slack + slack * e1 + e1 * slack;
        const Matrix T = e1 * rest + q * (e1 + rest) + e3;

        // Of A X x: all orders but the zeroth, but the first, and but the second.
        Matrix first(k), second(k), z(k), f(k);
        for (int i = 0; i < k; i++) {
            One lost = spread(0.0);
            for (int j = 0; j < m; j++) lost += a[i][j];
            lost *= off * ((1.0 + moved[0]) * task.turn_speed + task.tip_speed) * 2.0;
            const One lever = length(A[i], shifts) * task.turn_speed;
            first.at[i] = lever * moved[0] + lost;
            second.at[i] = lever * moved[1] + lost;
            z.at[i] = norm(A[i]) + first.at[i];
            f.at[i] = (F.at[i] + bent.at[i]) * (1.0 + kSpeedRounding) + kSpeedRounding +
                      (lever * moved[2] + lost);
        }
        const Matrix more = slack * z;
        f = f + more * 3.0 + slack * (e1 * z) + e1 * (more + second) + q * first;
        Matrix left = unit(k) - entries(T, [&](int i) { return vmin(T.at[i], spread(1e6)); });
        y = f;
        solve_spd(left.at, y.at, k, 0.0, 0.0);  // where a pivot is not positive, nothing is proven
        y = y * (1.0 + 1e-9);
        const Matrix least = (f + T * y) * (1.0 + kSpeedRounding);
        OneMask good = off < 1e-3;
        for (int i = 0; i < k; i++)
            good = good & (y.at[i] > 0.0) & (least.at[i] <= y.at[i]) & (y.at[i] <= 1e300);
        return good;
    }

    // out[0] to out[2]: the share at the centre, in the box by the first order, and a bound of it;
    // out[3 + j]: what joint j pulls.
    void run(One* out) {
        const One infinite = spread(__builtin_inf());
        M = rows_of(J);
        take_inverse();
        joints = 0;
        pull.reset(k);
        size = sizes(M);
        E1.reset(k, k);
        for (int j = 0; j < task.n; j++) {
            if (!task.moving[j]) continue;
            Matrix &slope = S[joints], &g = G[joints], &b = B[joints];
            slope.reset(6, k);
            g.reset(k, k);
            b.reset(k, m);
            add_slope(J, J, j, slope);
            const Matrix D = rows_of(slope);
            size.add_sizes(D, r[j]);
            g.add(A, D, 1.0, all, changed(j));
            E1.add_sizes(g, r[j]);
            b.add(g, A, 1.0, changed(j), all);
            add_carried(-1.0, j, J[0] + j, k, b);
            active[joints++] = j;
        }
        bound_rest();
        first_order();
        // Where this is too much already, the second order is not looked at.
        const Matrix rest = E3 * F;
        const OneMask some = largest(F + rest + E1 * (E1 * (E1 * F) + rest)) <= spread(1.0);
        OneMask good = never();
        One most = infinite;
        Matrix x = F;
        if (any(some)) {
            Matrix y;
            good = solved(second_order(), y) & some;
            most = select(good, largest(y) * (1.0 + kSpeedRounding), infinite);
            for (int j = 0; j < k; j++) pull.at[j] = select(some, pull.at[j], spread(0.0));
            for (int i = 0; i < k; i++) x.at[i] = select(good, y.at[i], F.at[i]);
        }
        const Matrix twice = E1 * (E1 * x);
        One worst = spread(-1.0), by[kSpeedColumns];
        clear(by, joints);
        for (int i = 0; i < task.n; i++) {
            const OneMask more = x.at[i] * share[i] > worst;
            worst = select(more, x.at[i] * share[i], worst);
            for (int h = 0; h < joints; h++) by[h] = select(more, along[i][h] * share[i], by[h]);
        }
        for (int h = 0; h < joints; h++) {
            One third = spread(0.0);
            for (int i = 0; i < task.n; i++)
                for (int j = 0; j < k; j++) third += vabs(G[h][i][j]) * twice.at[j] * share[i];
            pull.at[active[h]] += by[h] + r[active[h]] * third * 3.0;
        }
        One taken = spread(0.0);  // no right inverse was found where A is zero
        for (int i = 0; i < A.size(); i++) taken += vabs(A.at[i]);
        const One told[] = {largest(center), largest(F), most};
        for (int i = 0; i < 3; i++) out[i] = select(taken > 0.0, told[i], infinite);
        for (int j = 0; j < task.n; j++) out[3 + j] = pull.at[j];
    }
};
