// Joint speeds that tip motions take in boxes of configurations, one box in each lane: the bounds of
// pinsing/proximity/zones.py, which says what they rest on and what the letters are. One
// machine vector at a time, so that what belongs to a box stays in the first caches.
constexpr double kSpeedRounding = 1.0e-12;
constexpr double kLeastWeight = 0.3;  // of a share, by which joints weigh in the next right inverse
constexpr int kPairSteps = 5;
constexpr double kFreeTurn = 100.0;   // speed of a turn without a limit over the fastest joint's

struct Span {
    int first, last;
};

// C (a, c) += or -= A (a, b) B (b, c), in columns; A has others than zero in these of its own.
template <int sign>
PINSING_INLINE void add_product(const One* A, const One* B, int a, int b, int c, One* C, Span own,
                                Span columns) {
    for (int i = 0; i < a; i++)
        for (int j = columns.first; j < columns.last; j++) {
            One sum = C[i * c + j];
            for (int l = own.first; l < own.last; l++)
                sum += A[i * b + l] * B[l * c + j] * (1.0 * sign);
            C[i * c + j] = sum;
        }
}
template <int sign>
PINSING_INLINE void add_product(const One* A, const One* B, int a, int b, int c, One* C) {
    add_product<sign>(A, B, a, b, c, C, Span{0, b}, Span{0, c});
}
PINSING_INLINE void clear(One* x, int count) {
    for (int i = 0; i < count; i++) x[i] = spread(0.0);
}
PINSING_INLINE void product(const One* A, const One* B, int a, int b, int c, One* C) {
    clear(C, a * c);
    add_product<1>(A, B, a, b, c, C);
}

PINSING_INLINE void add_sizes(const One* x, int count, One times, One* out) {
    for (int i = 0; i < count; i++) out[i] += vabs(x[i]) * times;
}

struct BoxOfSpeeds {
    using Row = One[kSpeedColumns];
    using Wide = One[6 * kSpeedColumns];
    using Square = One[kSpeedColumns * kSpeedColumns];
    const SpeedTask& task;
    int k, m;  // columns and rows of the Jacobian
    Wide J, M, A, size, S[kSpeedColumns];  // S, G, B: slopes by the active joints
    Square G[kSpeedColumns], E1, E2, E3, Q;
    Wide B[kSpeedColumns];
    Row r, F, center, along[kSpeedColumns], pull;
    One moved[3];
    int active[kSpeedColumns], joints;

    explicit BoxOfSpeeds(const SpeedTask& t) : task(t), k(t.k), m(t.m), joints(0) {}

    // Rows of the task (m, k) of K (6, k).
    void rows_of(const One* K, One* out) const {
        clear(out, m * k);
        for (int i = 0; i < m; i++)
            for (int a = 0; a < 6; a++) {
                const double factor = task.rows[6 * i + a];
                if (factor != 0.0)
                    for (int j = 0; j < k; j++) out[i * k + j] += K[a * k + j] * factor;
            }
    }

    // Adds the derivative (6, k) of K by joint j, column j being that of L.
    void add_slope(const One* K, const One* L, int j, One* out) const {
        const One *v = L + j, *w = L + 3 * k + j;
        if (j <= task.middle) {
            for (int i = 0; i < j; i++) {
                add_cross(K + i, k, w, k, out + i, k);
                add_cross(K + 3 * k + i, k, v, k, out + i, k);
                add_cross(K + 3 * k + i, k, w, k, out + 3 * k + i, k);
            }
            return;
        }
        for (int i = 0; i < j && !task.still; i++) add_cross(K + 3 * k + i, k, v, k, out + i, k);
        for (int i = task.still ? j + 1 : j; i < k; i++) {
            add_cross(w, k, K + i, k, out + i, k);
            if (i > j) add_cross(w, k, K + 3 * k + i, k, out + 3 * k + i, k);
            if (task.still) add_cross(v, k, K + 3 * k + i, k, out + i, k);
        }
    }
    bool behind(int j) const { return j > task.middle; }
    // Columns that joint j changes.
    Span changed(int j) const { return {behind(j) && task.still ? j + 1 : 0, behind(j) ? k : j}; }
    // Columns that joints i <= j both change.
    Span changed(int i, int j) const {
        if (task.still && behind(i) != behind(j)) return {0, 0};
        return changed(task.still && behind(j) ? j : i);
    }

    // Adds to or takes off the derivative (k, m) of A X by joint j, which moves the tip by v.
    template <int sign>
    void add_carried(int j, const One* v, int stride, One* out) const {
        if (!task.still || !behind(j)) return;
        for (int i = 0; i < k; i++) {
            One a[3], turn[3];
            clear(a, 3);
            clear(turn, 3);
            for (int b = 0; b < m; b++)
                for (int c = 0; c < 3; c++) a[c] += A[i * m + b] * task.rows[6 * b + c];
            add_cross(a, 1, v, stride, turn, 1);
            for (int b = 0; b < m; b++)
                for (int c = 0; c < 3; c++)
                    out[i * m + b] += turn[c] * (sign * task.rows[6 * b + 3 + c]);
        }
    }

    // Largest component of a row (m,) times any of the twists.
    One norm(const One* row) const {
        One v = spread(0.0), w = v;
        for (int a = 0; a < m; a++) (task.linear[a] ? v : w) += row[a] * row[a];
        return vsqrt(v) * task.tip_speed + vsqrt(w) * task.turn_speed;
    }

    One largest(const One* z) const {
        One most = spread(0.0);
        for (int j = 0; j < task.n; j++) most = vmax(most, z[j] * (1.0 / task.limits[j]));
        return most;
    }

    // A: a least square, with the weights that make the largest share least of those that are looked
    // at. Joints weigh more that take more (C. L. Lawson, 1961: to the power 1; 3/2 is sooner there).
    void take_inverse() {
        double fastest = 0.0;
        for (int j = 0; j < task.n; j++) fastest = task.limits[j] > fastest ? task.limits[j] : fastest;
        Row ease, z;
        Wide eased, X;
        One N[36];
        for (int j = 0; j < k; j++) {
            const double speed = j < task.n ? task.limits[j] : kFreeTurn * fastest;
            ease[j] = spread(speed * speed);
        }
        One least = spread(__builtin_inf());
        clear(A, k * m);
        for (int round = 0; round < (k == m || !task.rounds ? 1 : task.rounds); round++) {
            for (int j = 0; j < k; j++)
                for (int i = 0; i < m; i++) eased[j * m + i] = M[i * k + j] * ease[j];
            product(M, eased, m, k, m, N);
            for (int p = 0; p < m; p++) {  // the inverse of a positive matrix needs no pivots
                const One pivot = 1.0 / N[p * m + p];
                N[p * m + p] = spread(1.0);
                for (int j = 0; j < m; j++) N[p * m + j] *= pivot;
                for (int i = 0; i < m; i++) {
                    if (i == p) continue;
                    const One factor = N[i * m + p];
                    N[i * m + p] = spread(0.0);
                    for (int j = 0; j < m; j++) N[i * m + j] -= factor * N[p * m + j];
                }
            }
            product(eased, N, k, m, m, X);
            product(M, X, m, k, m, N);  // one step of Newton's method
            for (int i = 0; i < k * m; i++) eased[i] = X[i] * 2.0;
            add_product<-1>(X, N, k, m, m, eased);
            for (int j = 0; j < k; j++) z[j] = norm(eased + j * m);
            const One most = largest(z);
            const OneMask better = most < least;
            least = select(better, most, least);
            for (int i = 0; i < k * m; i++) A[i] = select(better, eased[i], A[i]);
            for (int j = 0; j < task.n; j++) {
                const One share = vmax(z[j] * (1.0 / task.limits[j]) / most, kLeastWeight);
                ease[j] = ease[j] / (share * vsqrt(share));
            }
        }
        if (k == m + 1 && !task.rounds) take_pair(least);
    }

    // With one joint to spare the right inverses are A + s w for any row w (m,). What the worst twists
    // take of a joint's limit and of another's together is least where both take as much: w is of the
    // two that take most, and goes some steps to where the one that takes most of all is at rest.
    void take_pair(One least) {
        Row still, s;
        Wide at;
        One w[6], pair[6], best[6];
        double shares[kSpeedColumns];
        for (int j = 0; j < k; j++) shares[j] = j < task.n ? 1.0 / task.limits[j] : 0.0;
        clear(still, k);
        clear(w, m);
        One longest = spread(-1.0), most = longest;
        for (int j = 0; j < k; j++) {  // s, of the columns of 1 - A M the largest on its diagonal
            Row column;
            for (int i = 0; i < k; i++) {
                column[i] = spread(i == j ? 1.0 : 0.0);
                for (int a = 0; a < m; a++) column[i] -= A[i * m + a] * M[a * k + j];
            }
            const OneMask better = column[j] > longest;
            longest = select(better, column[j], longest);
            for (int i = 0; i < k; i++) still[i] = select(better, column[i], still[i]);
        }
        clear(best, m);
        for (int i = 0; i < k; i++) {
            s[i] = still[i] * shares[i];
            for (int a = 0; a < m; a++) at[i * m + a] = A[i * m + a] * shares[i];
            for (int j = 0; j < i; j++) {
                const One side = select(s[i] * s[j] < 0.0, spread(1.0), spread(-1.0));
                One both = s[i] - side * s[j];
                both = select(vabs(both) < kSpeedRounding, spread(1.0), both);
                for (int a = 0; a < m; a++) {
                    pair[a] = (side * at[j * m + a] - at[i * m + a]) / both;
                    F[a] = at[i * m + a] + s[i] * pair[a];
                }
                const One share = norm(F);
                const OneMask more = share > most;
                most = select(more, share, most);
                for (int a = 0; a < m; a++) w[a] = select(more, pair[a], w[a]);
            }
        }
        for (int step = 0; step < kPairSteps; step++) {
            One worst = spread(0.0);
            for (int i = 0; i < task.n; i++) {
                for (int a = 0; a < m; a++) F[a] = at[i * m + a] + s[i] * w[a];
                const One share = norm(F), none = select(vabs(s[i]) < kSpeedRounding, spread(1.0), s[i]);
                const OneMask more = share > worst;
                worst = select(more, share, worst);
                for (int a = 0; a < m; a++) pair[a] = select(more, -1.0 * at[i * m + a] / none, pair[a]);
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
            for (int a = 0; a < m; a++) A[i * m + a] += still[i] * best[a];
    }

    // E3: what orders of J add that are not looked at, and its rounding. With V_b the length of column
    // b, in the axes in the middle the third derivative of column k by turning joints between it and
    // the middle is at most the sum of V of the four. Of twists at the tip, by joints behind the
    // middle V_b of the last of the four; by some of each V of the last one behind. And how far the
    // tip moves in these axes: by all orders, all but the first, and all but the second.
    void bound_rest() {
        Row far, rp, rd, behind, linear, angular, d;
        const One zero = spread(0.0);
        One beyond = zero, p = zero, arms = zero, slides = zero, all = zero;
        double reach = 0.0;
        for (int j = k - 1; j >= 0; j--) {
            One here = zero;
            for (int a = 0; a < 3; a++) here += J[a * k + j] * J[a * k + j];
            far[j] = vmin(spread(task.far[j]), vsqrt(here) + beyond);
            beyond += r[j] * task.far[j];
            reach = task.far[j] > reach ? task.far[j] : reach;
            const bool before = j <= task.middle;
            rp[j] = before && task.turns[j] ? r[j] : zero;
            rd[j] = !before && task.turns[j] ? r[j] : zero;
            behind[j] = before ? zero : r[j] * far[j];
            all += behind[j];
        }
        One sum = zero, pairs = zero, triples = zero;
        for (int j = 0; j < k; j++) d[j] = sum += rd[j];
        for (int j = 0; j < k; j++) {
            const One others = d[j] - rd[j];
            pairs += far[j] * rd[j] * rd[j] + behind[j] * others * 2.0;
        }
        for (int j = k - 1; j >= 0; j--) {
            const One others = d[j] - rd[j], p2 = p * p, p3 = p2 * p;
            const One x = p2 * (arms + slides) * 3.0 + far[j] * (p3 + d[j] * d[j] * d[j]) + triples +
                          p2 * all * 3.0 + p * pairs * 3.0;
            linear[j] = x * (1.0 / 6.0) + kSpeedRounding * (task.far[j] + 1.0);
            angular[j] = (p3 + others * others * others) * (1.0 / 6.0) + kSpeedRounding;
            triples += far[j] * (d[j] * d[j] * d[j] - others * others * others);
            if (!task.turns[j]) triples += behind[j] * others * others * 3.0;
            if (!task.turns[j] && j <= task.middle) slides += r[j];
            p += rp[j];
            arms += rp[j] * far[j];
        }
        clear(moved, 3);
        if (task.still) bound_still(linear, angular);
        if (task.still) {
            moved[2] = triples * (1.0 / 6.0) + kSpeedRounding * (reach + 1.0);
            moved[1] = moved[2] + pairs * 0.5;
            moved[0] = moved[1] + all;
        }
        for (int i = 0; i < k; i++) {
            One v = zero, w = zero;
            for (int a = 0; a < m; a++)
                (task.linear[a] ? v : w) += A[i * m + a] * A[i * m + a];
            v = vsqrt(v);
            w = vsqrt(w);
            for (int j = 0; j < k; j++) E3[i * k + j] = v * linear[j] + w * angular[j];
        }
    }

    // The fourth order of columns, twists at the point that is still.
    void bound_still(One* linear, One* angular) const {
        for (int side = 0; side < 2; side++) {
            One angle = spread(0.0), arms = angle;
            for (int j = task.middle + side; side ? j < k : j >= 0; j += side ? 1 : -1) {
                One here = spread(0.0);
                for (int a = 0; a < 3; a++) here += J[a * k + j] * J[a * k + j];
                const One lever = task.turns[j] ? vsqrt(here) + arms : vsqrt(here);
                const One cube = angle * angle * angle;
                linear[j] = (arms * 4.0 + lever * angle) * cube * (1.0 / 24.0) +
                            (vsqrt(here) + (task.far[j] + 1.0)) * kSpeedRounding;
                angular[j] = angle * cube * (1.0 / 24.0) + kSpeedRounding;
                if (task.turns[j]) angle += r[j];
                arms += r[j] * lever;
            }
        }
    }

    // F (k,): the largest of (A - E1 A) X x in the box; at its centre; and by joint.
    void first_order() {
        const One zero = spread(0.0);
        for (int i = 0; i < k; i++) {
            One extra = zero;
            Row aside, ways;
            center[i] = zero;
            clear(along[i], joints);
            clear(aside, joints);
            for (int kind = 0; kind < 2; kind++) {
                const double speed = kind == 0 ? task.tip_speed : task.turn_speed;
                One square = zero;
                for (int a = 0; a < m; a++)
                    if (task.linear[a] == (kind == 0)) square += A[i * m + a] * A[i * m + a];
                const One length = vsqrt(square), scale = 1.0 / vmax(length, 1e-300);
                One across = zero, least = length;
                for (int h = 0; h < joints; h++) {
                    One with = zero, whole = zero;
                    for (int a = 0; a < m; a++)
                        if (task.linear[a] == (kind == 0)) with += B[h][i * m + a] * A[i * m + a];
                    with = with * scale;
                    for (int a = 0; a < m; a++)
                        if (task.linear[a] == (kind == 0)) {
                            const One off = B[h][i * m + a] - with * A[i * m + a] * scale;
                            whole += off * off;
                        }
                    const One by = r[active[h]];
                    across += ways[h] = by * vsqrt(whole);
                    least -= by * vabs(with);
                    along[i][h] += with * speed;
                }
                One bent = vmin(across, across * across / (vmax(least, 1e-100) * 2.0));
                bent = select(least > 0.0, bent, across - least * 2.0) * speed;
                extra += bent;
                for (int h = 0; h < joints; h++) aside[h] += bent * ways[h] / vmax(across, 1e-100);
                center[i] += length * speed;
            }
            F[i] = center[i] + extra;
            for (int h = 0; h < joints; h++) {
                along[i][h] = vabs(along[i][h]) * r[active[h]];
                F[i] += along[i][h];
                along[i][h] += aside[h];
            }
        }
    }

    // What third derivatives by joints i <= h and those no farther from the middle add to E3.
    void third_order(const One* both, int i, int h, One rr) {
        const Span columns = changed(active[i], active[h]);
        Wide slope, D;
        Square AD;
        for (int o = behind(active[h]) ? 0 : h; o < joints; o++) {
            if (behind(active[o]) != behind(active[h]) || (behind(active[h]) && o > i)) continue;
            const One rrr = rr * r[active[o]] * (1.0 / (1.0 + (o == i) + (o == h)));
            clear(slope, 6 * k);
            clear(AD, k * k);
            add_slope(both, J, active[o], slope);
            rows_of(slope, D);
            add_sizes(D, m * k, rrr, size);
            add_product<1>(A, D, k, m, k, AD, Span{0, m}, columns);
            add_sizes(AD, k * k, rrr, E3);
        }
    }

    // What second derivatives add to E2, Q, F (`bent`), and to what joints pull; and third to E3.
    void second_order(One* bent) {
        Wide both, D, turned;
        Square AD, twice;
        Row here;
        clear(E2, k * k);
        clear(Q, k * k);
        clear(bent, k);
        for (int i = 0; i < joints; i++)
            for (int h = i; h < joints; h++) {
                const Span first = changed(active[i]), second = changed(active[h]);
                const Span columns = changed(active[i], active[h]);
                const One rr = r[active[i]] * r[active[h]] * (h > i ? 1.0 : 0.5);
                clear(AD, k * k);
                clear(twice, k * k);
                clear(turned, k * m);
                if (columns.last > columns.first) {
                    clear(both, 6 * k);
                    // Bilinear in columns, so that the rule of products gives its derivative.
                    add_slope(S[h], J, active[i], both);
                    add_slope(J, S[h], active[i], both);
                    rows_of(both, D);
                    add_sizes(D, m * k, rr, size);
                    add_product<1>(A, D, k, m, k, AD, Span{0, m}, columns);
                    add_product<-1>(AD, A, k, k, m, turned, columns, Span{0, m});
                    if (task.still) third_order(both, i, h, rr);
                }
                // The same again where h is i.
                add_product<1>(G[i], G[h], k, k, k, twice, first, second);
                add_product<1>(G[h], G[i], k, k, k, twice, second, first);
                for (int a = 0; a < k * k; a++) {
                    E2[a] += vabs(AD[a]) * rr;
                    Q[a] += vabs(twice[a] - AD[a]) * rr;
                }
                add_product<1>(G[i], B[h], k, k, m, turned, first, Span{0, m});
                add_product<1>(G[h], B[i], k, k, m, turned, second, Span{0, m});
                One v[3];
                clear(v, 3);
                add_cross(J + 3 * k + active[i], k, J + active[h], k, v, 1);
                add_carried<1>(active[i], v, 1, turned);
                for (int a = 0; a < k; a++) {
                    here[a] = norm(turned + a * m) * rr;
                    bent[a] += here[a];
                }
                const One more = largest(here);
                pull[active[i]] += more;
                pull[active[h]] += more;
            }
    }

    // y (k,), at least all joint speeds in the box; where nothing is proven, the mask is empty.
    OneMask solved(const One* bent, One* y) {
        const One zero = spread(0.0);
        One K[36];
        Square slack, e1, T, X, E;
        Row z, columns, f, more, twice, first, second;
        product(M, A, m, k, m, K);
        One off = zero;
        for (int i = 0; i < m; i++) {
            One row = zero;
            for (int j = 0; j < m; j++) {
                One sizes = zero;
                for (int l = 0; l < k; l++) sizes += vabs(M[i * k + l]) * vabs(A[l * m + j]);
                row += vabs(K[i * m + j] - (i == j ? 1.0 : 0.0) * spread(1.0)) + sizes * kSpeedRounding;
            }
            off = vmax(off, row);
        }
        off = off * 2.0;
        for (int j = 0; j < k; j++) {
            columns[j] = zero;
            for (int a = 0; a < m; a++) columns[j] += size[a * k + j];
            columns[j] *= off;
        }
        for (int i = 0; i < k; i++)
            for (int j = 0; j < k; j++) {
                One sum = zero;
                for (int a = 0; a < m; a++)
                    sum += vabs(A[i * m + a]) * (size[a * k + j] * kSpeedRounding + columns[j]);
                slack[i * k + j] = sum;
            }
        for (int a = 0; a < k * k; a++) {
            e1[a] = E1[a] + slack[a];
            E2[a] += slack[a];
            E3[a] += slack[a];
            Q[a] += slack[a];
            E[a] = e1[a] + E2[a] + E3[a];
            X[a] = E2[a] + E3[a];
        }
        add_product<1>(slack, e1, k, k, k, Q);
        add_product<1>(e1, slack, k, k, k, Q);
        product(e1, X, k, k, k, T);
        add_product<1>(Q, E, k, k, k, T);
        for (int a = 0; a < k * k; a++) T[a] += E3[a];

        // Of A X x: all orders but the zeroth, but the first, and but the second.
        for (int i = 0; i < k; i++) {
            One missed = zero, lever = zero;
            for (int a = 0; a < m; a++) {
                missed += vabs(A[i * m + a]);
                if (task.linear[a]) lever += A[i * m + a] * A[i * m + a];
            }
            missed *= off * ((1.0 + moved[0]) * task.turn_speed + task.tip_speed) * 2.0;
            lever = vsqrt(lever) * task.turn_speed;
            first[i] = lever * moved[0] + missed;
            second[i] = lever * moved[1] + missed;
            z[i] = norm(A + i * m) + first[i];
            f[i] = (F[i] + bent[i]) * (1.0 + kSpeedRounding) + kSpeedRounding +
                   (lever * moved[2] + missed);
        }
        product(slack, z, k, k, 1, more);
        product(e1, z, k, k, 1, twice);
        for (int i = 0; i < k; i++) f[i] += more[i] * 3.0;
        add_product<1>(slack, twice, k, k, 1, f);
        add_product<1>(e1, more, k, k, 1, f);
        add_product<1>(e1, second, k, k, 1, f);
        add_product<1>(Q, first, k, k, 1, f);

        for (int a = 0; a < k * k; a++) X[a] = zero - vmin(T[a], spread(1e6));
        for (int i = 0; i < k; i++) {
            X[i * k + i] += spread(1.0);
            y[i] = f[i];
        }
        solve_spd(X, y, k, 0.0, 0.0);  // where a pivot is not positive, nothing is proven
        for (int i = 0; i < k; i++) y[i] = y[i] * (1.0 + 1e-9);
        product(T, y, k, k, 1, more);
        OneMask good = off < 1e-3;
        for (int i = 0; i < k; i++)
            good = good & (y[i] > 0.0) & ((f[i] + more[i]) * (1.0 + kSpeedRounding) <= y[i]) &
                   (y[i] <= 1e300);
        return good;
    }

    // out[0] to out[2]: the share at the centre, in the box by the first order, and a bound of it;
    // out[3 + j]: what joint j pulls.
    void run(One* out) {
        const One zero = spread(0.0), infinite = spread(__builtin_inf());
        rows_of(J, M);
        take_inverse();
        joints = 0;
        clear(pull, k);
        clear(E1, k * k);
        for (int a = 0; a < m * k; a++) size[a] = vabs(M[a]);
        Wide D;
        for (int j = 0; j < task.n; j++) {
            if (!task.moving[j]) continue;
            One* slope = S[joints];
            clear(slope, 6 * k);
            add_slope(J, J, j, slope);
            rows_of(slope, D);
            add_sizes(D, m * k, r[j], size);
            clear(G[joints], k * k);
            clear(B[joints], k * m);
            add_product<1>(A, D, k, m, k, G[joints], Span{0, m}, changed(j));
            add_sizes(G[joints], k * k, r[j], E1);
            add_product<1>(G[joints], A, k, k, m, B[joints], changed(j), Span{0, m});
            add_carried<-1>(j, J + j, k, B[joints]);
            active[joints++] = j;
        }
        bound_rest();
        first_order();
        // Where this is too much already, the second order is not looked at.
        Row x, y, rest, bent;
        product(E3, F, k, k, 1, rest);
        product(E1, F, k, k, 1, x);
        product(E1, x, k, k, 1, y);
        for (int i = 0; i < k; i++) y[i] += rest[i];
        product(E1, y, k, k, 1, x);
        for (int i = 0; i < k; i++) x[i] += F[i] + rest[i];
        const OneMask some = largest(x) <= spread(1.0);
        OneMask good = never();
        One most = infinite;
        if (any(some)) {
            second_order(bent);
            good = solved(bent, y) & some;
            most = select(good, largest(y) * (1.0 + kSpeedRounding), infinite);
            for (int j = 0; j < k; j++) pull[j] = select(some, pull[j], zero);
        }
        for (int i = 0; i < k; i++) x[i] = select(good, y[i], F[i]);
        product(E1, x, k, k, 1, y);
        product(E1, y, k, k, 1, rest);
        One worst = spread(-1.0);
        Row by;
        clear(by, joints);
        for (int i = 0; i < task.n; i++) {
            const One share = x[i] * (1.0 / task.limits[i]);
            const OneMask more = share > worst;
            worst = select(more, share, worst);
            for (int h = 0; h < joints; h++)
                by[h] = select(more, along[i][h] * (1.0 / task.limits[i]), by[h]);
        }
        for (int h = 0; h < joints; h++) {
            One third = zero;
            for (int i = 0; i < task.n; i++)
                for (int j = 0; j < k; j++)
                    third += vabs(G[h][i * k + j]) * rest[j] * (1.0 / task.limits[i]);
            pull[active[h]] += by[h] + r[active[h]] * third * 3.0;
        }
        const One share = largest(center);
        One taken = zero;  // no right inverse was found where A is zero
        for (int a = 0; a < k * m; a++) taken += vabs(A[a]);
        out[0] = select(taken > 0.0, share, infinite);
        out[1] = select(taken > 0.0, largest(F), infinite);
        out[2] = select(taken > 0.0, most, infinite);
        for (int j = 0; j < task.n; j++) out[3 + j] = pull[j];
    }
};
