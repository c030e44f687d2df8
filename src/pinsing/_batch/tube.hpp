// How far at most the singular configurations in boxes of joint values are from families of a design:
// see pinsing/families/tube.py. Sums of cosines are bounded by Taylor's theorem to the fifth order.
constexpr double kMore = 1.0 + 1e-9;  // for the rounding of the few operations that a bound is made of
constexpr double kLeast = 1e-300;
// Lines aim at this many times what a value has to fall: in small boxes, and in wide ones, which lose of it.
constexpr double kAims[] = {1.2, 4.0};
constexpr double kFar = 1e9;  // no distance
constexpr double kPi = 3.14159265358979;  // not more than it

// Derivatives of a sum of the first to the fourth order: joints are sorted, the largest first.
constexpr int place(int j, int k, int l, int m) {
    return j * (j + 1) * (j + 2) * (j + 3) / 24 + k * (k + 1) * (k + 2) / 6 + l * (l + 1) / 2 + m;
}
struct Places {
    int second[4][4]{}, third[4][4][4]{}, fourth[4][4][4][4]{};
    constexpr Places() {
        for (int j = 3; j >= 0; j--)
            for (int k = 3; k >= 0; k--) {
                second[j][k] = j < k ? second[k][j] : place(0, 0, j, k);
                for (int l = 3; l >= 0; l--) {
                    third[j][k][l] = j < k ? third[k][j][l] : k < l ? third[j][l][k] : place(0, j, k, l);
                    for (int m = 3; m >= 0; m--)
                        fourth[j][k][l][m] = j < k   ? fourth[k][j][l][m]
                                             : k < l ? fourth[j][l][k][m]
                                             : l < m ? fourth[j][k][m][l]
                                                     : place(j, k, l, m);
                }
            }
    }
};
constexpr Places kPlaces;

// Halves what lies between `low` and `high`, at most `most`, of which the latter is enough.
template <class Enough>
PINSING_INLINE void halve(One& low, One& high, double most, int times, Enough enough) {
    for (int i = 0; i < times; i++) {
        const One middle = 0.5 * (low + vmin(high, spread(most)));
        const auto good = enough(middle);
        high = select(good, middle, high);
        low = select(good, low, middle);
    }
}

// The largest of n scores, and which it is where they count; 0 where none is above zero.
PINSING_INLINE void choose(const One* scores, int n, OneMask count, One& which) {
    One best = spread(0.0);
    for (int j = 0; j < n; j++) {
        which = select((scores[j] > best) & count, spread(j), which);
        best = vmax(best, scores[j]);
    }
}

// Distances within which all families but one are.
PINSING_INLINE One all_but(int k, const One* within, int families) {
    One least = spread(kFar);
    for (int o = 0; o < families; o++)
        if (o != k) least = vmin(least, within[o]);
    return least;
}

// How the size of a value falls on its way to zero along a direction: by
// slope s - curve s^2/2 - jerk s^3/6 - snap s^4/24 - last s^5/120 at least.
struct Fall {
    One slope, curve, jerk, snap, last, top;
    One turns[4];  // by how much each joint's range changes the slope

    One by(One s) const {
        return s * (slope - s * (0.5 * curve + s * (jerk * (1.0 / 6.0) +
                                                    s * (snap * (1.0 / 24.0) + s * last * (1.0 / 120.0)))));
    }
    One at(One t) const { return by(vmin(t, top)); }  // of a step up to t
};

// A sum on a box of middle x and half widths h, by its derivatives up to the fourth order in the middle,
// or the third. TubeSum's `table` holds the coefficients of cosines and sines in these columns.
struct SumOnBox {
    const TubeSum* s;
    const One* h;
    One columns[kTubeColumns], reach[kTubeTerms];
    const One &value = columns[0], *second = columns + 1, *gradient = columns + 16;
    const One *third = columns + 20, *last = columns + 40, *fourth = columns + 48;
    // By how much it varies: in all, from the second order and from the third order on, and by joint.
    One swing, bent, higher, parts[4], noise;

    // Sums of `of` times columns of the table, eight at a time.
    void sums(const One* of, int column, int end) {
        for (; column < end; column += 8) {
            One a = spread(0.0), b = a, c = a, d = a, e = a, f = a, g = a, i = a;
            const double* at = s->table + column;
            for (int t = 0; t < s->terms; t++, at += kTubeColumns) {
                const One x = of[t];
                a += x * at[0];
                b += x * at[1];
                c += x * at[2];
                d += x * at[3];
                e += x * at[4];
                f += x * at[5];
                g += x * at[6];
                i += x * at[7];
            }
            const One all[8] = {a, b, c, d, e, f, g, i};
            for (int k = 0; k < 8; k++) columns[column + k] = all[k];
        }
    }

    SumOnBox(const TubeSum& sum, const One* x, const One* h, bool fine) : s(&sum), h(h) {
        One cosine[kTubeTerms], sine[kTubeTerms], farthest = spread(4.0);
        for (int j = 0; j < 4; j++) farthest = vmax(farthest, vabs(x[j]));
        for (int t = 0; t < s->terms; t++) {
            const double *term = s->term + kTubeTerm * t, *rate = term + 2;
            One angle = spread(term[1]);
            reach[t] = spread(0.0);
            for (int j = 0; j < 4; j++) {
                angle += x[j] * rate[j];
                reach[t] += h[j] * __builtin_fabs(rate[j]);
            }
            sincos(angle, sine[t], cosine[t]);
        }
        sums(cosine, 0, 16);
        sums(sine, 16, 40);
        if (fine) {
            sums(cosine, 48, kTubeColumns);
        } else {
            for (int i = 48; i < kTubeColumns; i++) columns[i] = spread(0.0);
        }
        for (int t = 0; t < s->terms; t++) {
            const One r = reach[t], rrr = r * r * r;
            cosine[t] = fine ? rrr * r * (1.0 / 120.0) : rrr * (1.0 / 24.0);
        }
        sums(cosine, 40, 48);
        noise = s->size * (s->noise + 4.5e-16 * s->reach * s->reach * s->reach * farthest);
        finish();
    }

    void finish() {
        swing = higher = spread(0.0);
        for (int j = 0; j < 4; j++) {
            One bent = spread(0.0), more = last[j];
            for (int k = 0; k < 4; k++) {
                bent += vabs(second[kPlaces.second[j][k]]) * h[k];
                One a = spread(0.0);
                for (int l = 0; l < 4; l++) {
                    One b = vabs(third[kPlaces.third[j][k][l]]) * (1.0 / 6.0);
                    for (int m = 0; m < 4; m++)
                        b += vabs(fourth[kPlaces.fourth[j][k][l][m]]) * (h[m] * (1.0 / 24.0));
                    a += b * h[l];
                }
                more += a * h[k];
            }
            higher += more * h[j];
            parts[j] = h[j] * (vabs(gradient[j]) + bent * 0.5 + more);
            swing += parts[j];
        }
        bent = swing * kMore + noise;
        swing = bent;
        for (int j = 0; j < 4; j++) bent = bent - vabs(gradient[j]) * h[j];
    }

    void add(const SumOnBox& other, double times) {
        for (int i = 0; i < kTubeColumns; i++) columns[i] += other.columns[i] * times;
        noise += other.noise * times;
    }

    // Where it is zero each joint is near the value that the others leave to it: whether that is less.
    auto zeros(int j, One& low, One& high) const {
        const One slope = gradient[j], size = vmax(vabs(slope), kLeast);
        const One other = (swing - vabs(slope) * h[j]) * kMore;
        const One to = select(slope > 0.0, -1.0 * value, value);
        low = vmax((to - other) / size, -1.0 * h[j]);
        high = vmin((to + other) / size, h[j]);
        return (low < high) & (high - low < 1.9 * h[j]);
    }

    // The least size on the box. A square that only adds to it is completed, of one joint or none.
    One least() const {
        const One sign = select(value > 0.0, spread(1.0), spread(-1.0));
        One off = swing;
        for (int p = 0; p < 4; p++) {
            const One bend = sign * second[kPlaces.second[p][p]], per = 1.0 / vmax(bend, 1e-6);
            One lost = 0.5 * gradient[p] * gradient[p] * per + higher;
            for (int j = 0; j < 4; j++) {
                if (j == p) continue;
                const One q = sign * second[kPlaces.second[p][j]] * per;
                One bent = spread(0.0);
                for (int k = 0; k < 4; k++)
                    if (k != p)
                        bent += vabs(second[kPlaces.second[j][k]] - q * second[kPlaces.second[p][k]]) * h[k];
                lost += h[j] * (vabs(gradient[j] - q * gradient[p]) + 0.5 * bent);
            }
            off = select(bend > 1e-6, vmin(off, lost * kMore + noise), off);
        }
        return vmax(vabs(value) - off, 0.0);
    }

    // Of values of a sign, from the middle, or from all points. Along a unit direction where its third
    // derivative counts most; else that or its opposite, whichever the value falls along at first: where
    // another sum D is zero, its gradient's multiple tells of the slope.
    Fall along(const One* e, One sign, bool all_points, bool cubic, const SumOnBox* D) const {
        const One zero = spread(0.0);
        Fall f;
        One bends[4], curve = zero, jerk = zero, snap = zero, off[5] = {zero, zero, zero, zero, zero};
        f.slope = f.last = zero;
        for (int t = 0; t < s->terms; t++) {
            const double* rate = s->term + kTubeTerm * t + 2;
            One r = zero;
            for (int j = 0; j < 4; j++) r += e[j] * rate[j];
            r = vabs(r);
            const One rr = r * r, a = rr * rate[-2], q = reach[t], qq = q * q;
            f.last += a * rr * r;
            off[1] += r * (qq * qq) * rate[-2];
            off[2] += a * qq * q;
            off[3] += a * r * qq;
            off[4] += a * rr * q;
        }
        for (int j = 0; j < 4; j++) {
            One bend = zero, twist = zero, turn = zero, more = zero;
            for (int k = 0; k < 4; k++) {
                One twisted = zero, part = zero, whole = zero;
                for (int l = 0; l < 4; l++) {
                    One c = zero;
                    for (int m = 0; m < 4; m++) c += fourth[kPlaces.fourth[j][k][l][m]] * e[m];
                    twisted += third[kPlaces.third[j][k][l]] * e[l];
                    part += vabs(c) * h[l];
                    whole += c * e[l];
                }
                bend += second[kPlaces.second[j][k]] * e[k];
                turn += (vabs(twisted) * 0.5 + part * (1.0 / 6.0)) * h[k];
                twist += twisted * e[k];
                more += whole * e[k];
                off[2] += 3.0 * vabs(whole) * h[j] * h[k];
            }
            f.slope += gradient[j] * e[j];
            curve += bend * e[j];
            jerk += twist * e[j];
            snap += more * e[j];
            bends[j] = bend;
            f.turns[j] = h[j] * (vabs(bend) + turn);
            off[1] += 24.0 * f.turns[j];
            off[2] += 6.0 * vabs(twist) * h[j];
            off[3] += 2.0 * vabs(more) * h[j];
        }
        const double per = all_points ? kMore : 0.0, n = s->reach;
        const One all = off[1] * (per / 24.0) + n * noise;
        One steep = f.slope, least = vabs(steep) - all;
        if (D && !cubic) {
            One c = zero, size = spread(kLeast), gained = zero;
            for (int j = 0; j < 4; j++) {
                c += bends[j] * D->gradient[j] * h[j] * h[j];
                size += D->gradient[j] * D->gradient[j] * h[j] * h[j];
            }
            c = c / size;
            for (int j = 0; j < 4; j++) {
                const One less = (vabs(bends[j]) - vabs(bends[j] - c * D->gradient[j])) * h[j];
                gained += less;
                bends[j] = less;
            }
            const One other = steep - c * D->value;
            const One there = vabs(other) - all * kMore + gained - vabs(c) * D->bent * kMore;
            const auto better = there > least;
            least = select(better, there, least);
            steep = select(better, other, steep);
            for (int j = 0; j < 4; j++) f.turns[j] -= select(better, bends[j], zero);
        }
        f.curve = sign * curve + off[2] * (per / 6.0) + n * n * noise;
        f.snap = sign * snap + off[4] * per + n * n * n * n * noise;
        f.last = f.last * kMore;
        const One off_third = off[3] * (per / 2.0) + n * n * n * noise;
        if (cubic) {
            f.slope = -1.0 * sign * f.slope - all;
            f.jerk = sign * jerk + off_third;
            const One root = vsqrt(vmax(f.snap * f.snap - 3.0 * f.jerk * f.last, 0.0));
            f.top = vmin(2.0 * vmax(root - f.snap, 0.0) / vmax(f.last, kLeast), spread(1.0));
            return f;
        }
        // It goes where the slope is down, if that is known.
        const One down = select(steep > 0.0, -1.0 * jerk, jerk);
        f.slope = vmax(least, 0.0);
        f.jerk = select(least > 0.0, down, vabs(jerk)) + off_third;
        // Where it falls no further, about: a step of any length is true.
        f.top = zero;
        for (int i = 0; i < 4; i++) {
            const One before = f.top;
            const One third = vmax(f.jerk + f.top * (f.snap + 0.25 * f.top * f.last) * (1.0 / 3.0), 1e-6);
            const One root = vsqrt(f.curve * f.curve + 2.0 * third * f.slope);
            f.top = select(f.curve > 0.0, 2.0 * f.slope / vmax(f.curve + root, kLeast), (root - f.curve) / third);
            f.top = vmin(f.top, i < 3 ? spread(1.0) : before);
        }
        return f;
    }

    // How far a zero is along a direction at most from the middle; far where none is proven.
    One within(const One* e, bool cubic) const {
        const Fall f = along(e, select(value > 0.0, spread(1.0), spread(-1.0)), false, cubic, nullptr);
        const One left = (vabs(value) + noise) * kMore;
        One low = spread(0.0), high = select(f.by(f.top) > left, f.top, spread(kFar));
        for (double step = 1.0; step > 1e-7; step *= 0.5)
            high = select(f.by(spread(step)) > left, vmin(spread(step), high), high);
        halve(low, high, 1.0, 8, [&](One middle) { return f.by(middle) > left; });
        return high * kMore;
    }

    // The unit direction in which the third derivative is largest, about: by powers of it.
    void twisted(One* e) const {
        One size[4], most = spread(0.0);
        for (int j = 0; j < 4; j++) {
            size[j] = spread(0.0);
            for (int k = 0; k < 4; k++)
                for (int l = 0; l < 4; l++) size[j] += vabs(third[kPlaces.third[j][k][l]]);
            most += size[j];
            e[j] = spread(0.5);
        }
        for (int i = 0; i < 8; i++) {
            One next[4], square = spread(kLeast);
            for (int j = 0; j < 4; j++) {
                next[j] = e[j] * most * 0.05;
                for (int k = 0; k < 4; k++)
                    for (int l = 0; l < 4; l++) next[j] += third[kPlaces.third[j][k][l]] * e[k] * e[l];
                square += next[j] * next[j];
            }
            for (int j = 0; j < 4; j++) e[j] = next[j] / vsqrt(square);
        }
    }
};

// Eigenvectors (columns of v) and eigenvalues (w) of a symmetric matrix, about; it is lost.
template <int n>
PINSING_INLINE void eigen(One a[n][n], One v[n][n], One* w, int rounds) {
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) v[i][j] = spread(i == j);
    for (int i = 0; i < rounds * n * n; i++) {
        const int p = i % (n * n) / n, q = i % n;
        if (q <= p) continue;
        const One d = (a[q][q] - a[p][p]) * 0.5, b = a[p][q], r = vsqrt(d * d + b * b);
        const One t = select(d > 0.0, b, -1.0 * b) / vmax(vabs(d) + r, kLeast);
        const One c = 1.0 / vsqrt(1.0 + t * t), s = t * c;
        const auto turn = [&](One& x, One& y) {
            const One z = c * x - s * y;
            y = s * x + c * y;
            x = z;
        };
        for (int k = 0; k < n; k++) turn(a[k][p], a[k][q]);
        for (int k = 0; k < n; k++) turn(a[p][k], a[q][k]);
        for (int k = 0; k < n; k++) turn(v[k][p], v[k][q]);
    }
    for (int i = 0; i < n; i++) w[i] = a[i][i];
}

// The unit direction e in which a value of a sign has fallen by `drop` first, to second order:
// -m (1 + m H)^-1 g with the least m > 0. It has no proof and needs none.
PINSING_INLINE void shortest(const SumOnBox& f, const One v[4][4], const One* w, One sign, One drop,
                             One* e) {
    One g[4], bend[4], step[4], least = spread(0.0), low = least, high = spread(1.0), size = least;
    for (int i = 0; i < 4; i++) {
        g[i] = spread(0.0);
        for (int j = 0; j < 4; j++) g[i] += v[j][i] * f.gradient[j];
        // On a ridge either side is a way down: some of the slope that a fall along it has in the end.
        const One some = 0.01 * vsqrt(drop * vabs(w[i])) + 1e-12;
        g[i] = sign * g[i];
        g[i] = select(g[i] < 0.0, vmin(g[i], -1.0 * some), vmax(g[i], some));
        bend[i] = sign * w[i];
        least = vmin(least, bend[i]);
    }
    halve(low, high, 1.0, 10, [&](One z) {  // m = k / (1 - k least), k = 50 z / (1 - z), 0 < z < 1
        const One k = 50.0 * z, m = k / (1.0 - z - k * least);
        One falls = spread(0.0);
        for (int j = 0; j < 4; j++) {
            const One q = 1.0 / (1.0 + m * bend[j]);
            step[j] = m * g[j] * q;
            falls += step[j] * g[j] * (0.5 + 0.5 * q);
        }
        return falls > drop;
    });
    for (int j = 0; j < 4; j++) {
        e[j] = spread(0.0);
        for (int i = 0; i < 4; i++) e[j] -= v[j][i] * step[i];
        size += e[j] * e[j];
    }
    for (int j = 0; j < 4; j++) e[j] = e[j] / vsqrt(size);
}

// How far points of a box are from a joint value at most and at least.
PINSING_INLINE void of_value(const TubeSum& sum, const One* x, const One* h, One& most, One& least) {
    One angle = spread(sum.term[1] - 1.5707963267948966), wide = spread(0.0);
    for (int j = 0; j < 4; j++) {
        angle += x[j] * sum.term[2 + j];
        wide += h[j] * (2.0 * __builtin_fabs(sum.term[2 + j]));
    }
    const double magic = 6755399441055744.0;  // as in sincos.hpp
    const One turns = (angle * 0.31830988618379067 + magic) - magic;
    const One middle = 2.0 * vabs(angle - turns * 3.141592653589793);
    most = (middle + wide) * kMore + 1e-12;
    least = vmax(middle - wide * kMore - 1e-12, 0.0);
}

// A condition on a box.
struct Condition {
    const TubeSum* s;
    One least, noise, within;  // its least size; how far its zeros are at most from points of the box
    One off;                   // of a joint value: how far it is at least
    One signs;                 // of values where the determinant is zero; 0 where both may be
    Fall fall[6];  // of values > 0 and < 0; by the second aim; where the third derivative is largest
    One parts[4], sway[4], most;  // most: its largest size

    void set(const TubeSum& sum, const SumOnBox* D, const One* x, const One* h, One drop, One sign) {
        const One zero = spread(0.0);
        const SumOnBox f(sum, x, h, true);
        s = &sum;
        signs = sign;
        least = f.least();
        noise = f.noise;
        most = vabs(f.value) + f.swing;
        within = off = zero;
        for (int j = 0; j < 4; j++) {
            parts[j] = f.parts[j];
            sway[j] = zero;
        }
        if (sum.is_value) return of_value(sum, x, h, within, off);
        One a[4][4], v[4][4], w[4], e[4];
        for (int j = 0; j < 4; j++)
            for (int k = 0; k < 4; k++) a[j][k] = f.second[kPlaces.second[j][k]];
        eigen<4>(a, v, w, 3);
        for (int j = 0; j < 4; j++)
            if (sum.uses[j]) within += h[j] * h[j];
        One reached = spread(kFar);
        One twist[4];
        // Where one family is all, its singular points may have no second derivatives either.
        const bool alone = D && any(drop < kFar);
        if (alone) f.twisted(twist);
        for (int k = 0; k < (alone ? 6 : 4); k++) {
            const One way = spread(k % 2 ? -1.0 : 1.0);
            const auto other = way * signs < 0.0;
            if (!any(~other)) continue;
            if (k < 4) {
                const One over = select(drop < kFar, f.swing, spread(1e-3));
                shortest(f, v, w, way, kAims[k / 2] * vmin(drop, vabs(f.value) + over), e);
            } else {
                for (int j = 0; j < 4; j++) e[j] = -1.0 * way * twist[j];
            }
            fall[k] = f.along(e, way, true, k > 3, D);
            if (!alone && k > 1) fall[k + 2] = fall[k];
            const auto not_its = k < 4 ? other : other | (way * f.value < 0.0);
            reached = select(not_its, reached, vmin(reached, f.within(e, k > 3)));
            if (k > 1) continue;
            One slope = zero;
            for (int j = 0; j < 4; j++) slope += f.gradient[j] * e[j];
            slope = vmax(vabs(slope), 1e-2);
            for (int j = 0; j < 4; j++)
                sway[j] = select(other, sway[j], vmax(sway[j], fall[k].turns[j] / slope));
        }
        within = (vsqrt(within) + reached) * kMore;
    }

    // What its size is not below at points of the box farther than t from its zeros.
    One below(One t) const {
        One far;
        if (s->is_value) {  // a sine, by its series
            const One u = 0.5 * vmin(vmax(t, off), spread(kPi)), z = u * u;
            far = u * (1.0 - z * (1.0 / 6.0) * (1.0 - z * (1.0 / 20.0) * (1.0 - z * (1.0 / 42.0))));
        } else {
            const auto falls = [&](int k) {
                return vmax(fall[k].at(t), vmax(fall[k + 2].at(t), fall[k + 4].at(t)));
            };
            far = select(signs < 0.0, falls(1), falls(0));
            if (any(~((signs < 0.0) | (signs > 0.0))))
                far = select(vabs(signs) > 0.0, far, vmin(falls(0), falls(1)));
        }
        return vmax(far * (1.0 / kMore) - noise, least);
    }
};

PINSING_INLINE One raised(One x, int power) {
    One out = x;
    for (int i = 1; i < power; i++) out = out * x;
    return out;
}

// A box x, h (4,) -> the part of it that may hold singular configurations, beyond which distance none
// is (far: of each family if all others are far, last of all), and the joint to halve.
inline void tube_box(const Tube& p, One* x, One* h, One* far, One& split) {
    const One zero = spread(0.0);
    const int F = p.families;
    const SumOnBox rest(p.sums[1], x, h, false);
    SumOnBox D(p.sums[0], x, h, true);
    const One most = (vabs(rest.value) + rest.swing) * kMore;
    // Of all robots between the design and this one: P + E/2 within |E|/2.
    D.add(rest, 0.5);
    D.noise += 0.5 * most;
    D.finish();
    const auto clear = D.least() > 0.0;
    split = zero;
    for (int k = 0; k <= F; k++) far[k] = zero;
    if (!any(~clear)) return;
    One middle[4], wide[4];
    for (int j = 0; j < 4; j++) {
        One low, high;
        const auto less = D.zeros(j, low, high) & ~clear;
        middle[j] = select(less, x[j] + 0.5 * (low + high), x[j]);
        wide[j] = select(less, 0.5 * kMore * (high - low) + 1e-13, h[j]);
        h[j] = select(less, kMore * vmax(high, -1.0 * low) + 1e-13, h[j]);
    }
    const SumOnBox whole(p.sums[2], x, h, false);
    const One room = vmax(vabs(whole.value) - whole.swing, 0.0);
    One drop = spread(kFar), sign = zero, score[4];
    if (p.factors == 1 && p.sums[3].power == 1) {
        drop = most / vmax(room, kLeast);
        sign = select(whole.value > 0.0, -1.0 * rest.value, rest.value);
        sign = select(vabs(rest.value) > rest.swing, sign, zero);
    }
    for (int j = 0; j < 4; j++) score[j] = rest.parts[j] / vmax(most, kLeast);
    Condition all[kTubeSums];
    One within[kTubeSums], nearest = spread(kFar);
    for (int k = 0; k < F; k++) within[k] = nearest;
    for (int i = 0; i < p.factors; i++) {
        const TubeSum& s = p.sums[3 + i];
        all[i].set(s, &D, x, h, drop, sign);
        within[s.family] = vmin(within[s.family], all[i].within);
        nearest = vmin(nearest, all[i].within);
    }
    for (int k = F; k >= 0; k--) {
        if (F == 1 && k == 0) {
            far[0] = far[1];
            break;
        }
        const One others = all_but(k, within, F);
        const auto apart = ~(others < p.near);
        if (k < F && !any(apart)) continue;
        const One at_most = k < F ? vmin(far[F], within[k]) : nearest;
        const auto none_beyond = [&](One t) {
            One product = room;
            for (int i = 0; i < p.factors; i++) {
                const bool moves = k == F || p.sums[3 + i].family == k;
                product = product * raised(all[i].below(moves ? t : spread(p.near)), p.sums[3 + i].power);
            }
            return product > most;
        };
        One low = zero, high = vmin(at_most, spread(kPi));
        const auto some = none_beyond(low) | clear, few = none_beyond(high);
        halve(low, high, kPi, 12, none_beyond);
        far[k] = select(some, zero, select(few, high, at_most));
        if (k < F) far[k] = select(apart, far[k], zero);
    }
    // What halving a joint's range gains: E, and conditions that stay off zero, vary less; slopes of
    // those that do not are bounded better.
    for (int i = 0; i < p.factors; i++) {
        const Condition& c = all[i];
        const auto zeros = c.least < c.below(vmin(far[F], spread(kPi))) * 1.001;
        for (int j = 0; j < 4; j++)
            score[j] += c.s->power * select(zeros, c.sway[j], c.parts[j] / vmax(c.least, kLeast));
    }
    choose(score, 4, ~clear, split);
    for (int j = 0; j < 4; j++) {
        x[j] = middle[j];
        h[j] = wide[j];
    }
}

// What a sum's own joints are on a box.
PINSING_INLINE void own(const TubeSum& s, const One* x, const One* h, One* at, One* wide) {
    for (int j = 0; j < 4; j++) {
        at[j] = x[s.joint[j]];
        wide[j] = h[s.joint[j]];
    }
}

// As tube_box, of an arm of seven joints: its Jacobian has full rank where a minor is not zero. That is a
// sum in four joints and a small one in all five.
inline void rank_box(const Tube& p, One* x, One* h, One* far, One& split) {
    constexpr int n = kTubeJoints;
    const int F = p.families;
    const One zero = spread(0.0);
    for (int k = 0; k <= F; k++) far[k] = zero;
    split = zero;
    One scores[n] = {zero, zero, zero, zero, zero};
    auto clear = zero > 0.0;
    for (int i = 3 + p.factors; i < p.count && any(~clear); i += 2) {
        const TubeSum &s = p.sums[i], &more = p.sums[i + 1];
        One at[4], wide[4];
        own(s, x, h, at, wide);
        SumOnBox minor(s, at, wide, false);
        const One least = minor.least();
        // Whether the second sum matters: else it is less than its terms.
        clear = clear | (least > more.size * (kMore + more.noise));
        const bool matters = any((least > 0.0) & ~clear);
        if (!matters) minor.noise += spread(more.size * kMore);
        // To the second order; what it varies by the joint that is not among the minor's own is noise.
        One slope[n] = {zero, zero, zero, zero, zero}, bend[n][n] = {}, alone[n];
        for (int t = 0; t < more.terms * matters; t++) {
            const double *term = more.term + kTubeTerm * t, *rate = term + 2;
            One angle = spread(term[1]), reach = zero, sine, cosine;
            for (int j = 0; j < n; j++) {
                angle += x[j] * rate[j];
                reach += h[j] * __builtin_fabs(rate[j]);
            }
            sincos(angle, sine, cosine);
            minor.columns[0] += cosine * term[0];
            for (int j = 0; j < n; j++) {
                slope[j] -= sine * (term[0] * rate[j]);
                for (int k = 0; k <= j; k++) bend[j][k] -= cosine * (term[0] * rate[j] * rate[k]);
            }
            minor.noise += reach * reach * reach * (term[0] * kMore / 6.0);
        }
        for (int j = 0; j < n; j++) {
            alone[j] = h[j];
            for (int k = 0; k < j; k++) bend[k][j] = bend[j][k];
        }
        for (int j = 0; j < 4; j++) {
            alone[s.joint[j]] = zero;
            minor.columns[16 + j] += slope[s.joint[j]];
            for (int k = 0; k <= j; k++)
                minor.columns[1 + kPlaces.second[j][k]] += bend[s.joint[j]][s.joint[k]];
        }
        for (int j = 0; j < n; j++) {
            One steepest = vabs(slope[j]);
            for (int k = 0; k < n; k++) steepest += vabs(bend[j][k]) * h[k];
            minor.noise += alone[j] * steepest * kMore;
        }
        minor.noise += spread(more.size * (more.noise + 1e-13));
        minor.finish();
        clear = clear | (minor.least() > 0.0);
        const One ratio = 0.2 + vabs(minor.value) / minor.swing, part = 1.0 / minor.swing;
        for (int j = 0; j < 4; j++)
            scores[s.joint[j]] += ratio * ratio * part * minor.parts[j];
        for (int j = 0; j < 4; j++) {
            One low, high, &at_j = x[s.joint[j]], &wide_j = h[s.joint[j]];
            const auto less = minor.zeros(j, low, high) & ~clear;
            at_j = select(less, at_j + 0.5 * (low + high), at_j);
            wide_j = select(less, 0.5 * kMore * (high - low) + 1e-13, wide_j);
        }
    }
    choose(scores, n, ~clear, split);
    if (!any(~clear)) return;
    One within[kTubeSums], nearest = spread(kFar), inside = nearest;
    for (int k = 0; k < F; k++) within[k] = nearest;
    for (int i = 0; i < p.factors;) {
        const int first = p.sums[3 + i].branch, k = p.sums[3 + i].family;
        One square = zero, middle_square = zero, parts[n] = {zero, zero, zero, zero, zero};
        for (; i < p.factors && p.sums[3 + i].branch == first; i++) {
            const TubeSum& s = p.sums[3 + i];
            if (!s.is_value && !any(~clear & (square < 9.0 * p.near * p.near))) {
                square = middle_square = spread(kFar * kFar);
                continue;
            }
            One at[4], wide[4];
            own(s, x, h, at, wide);
            One low = zero, high;
            if (s.is_value) {
                of_value(s, at, wide, high, low);
                square += high * high;
                parts[s.joint[0]] += wide[0];
                middle_square += (high - wide[0]) * (high - wide[0]);
                continue;
            }
            Condition c;
            c.set(s, nullptr, at, wide, spread(1e8), zero);
            high = c.within;
            halve(low, high, 2.0, 12, [&](One middle) { return c.below(middle) > c.most; });
            square += high * high;
            One left = c.most;
            for (int j = 0; j < 4; j++) {
                if (!s.uses[j]) continue;
                left -= c.parts[j];
                parts[s.joint[j]] += high * (c.parts[j] / vmax(c.most, kLeast) + vmin(c.sway[j], spread(1.0)));
            }
            const One middle = high * left / vmax(c.most, kLeast);
            middle_square += middle * middle;
        }
        const auto nearer = square < nearest * nearest;
        inside = select(nearer, middle_square, inside);
        for (int j = 0; j < n; j++) scores[j] = select(nearer, parts[j], scores[j]);
        within[k] = vmin(within[k], vsqrt(square) * kMore);
        nearest = vmin(nearest, within[k]);
    }
    // Near a family, that its distance varies less.
    const auto beside = ~clear & (4.0 * inside < nearest * nearest);
    choose(scores, n, beside, split);
    far[F] = select(clear, zero, nearest);
    for (int k = 0; k < F; k++) {
        const One others = all_but(k, within, F);
        far[k] = select(clear | (others < p.near), zero, vmin(within[k], nearest));
    }
}
