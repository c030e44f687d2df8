// How far at most the singular configurations in boxes of joint values are from families of a design:
// see pinsing/families/tube.py. Sums of cosines are bounded by Taylor's theorem to the fifth order.
constexpr double kMore = 1.0 + 1e-9;  // for the rounding of the few operations that a bound is made of
constexpr double kLeast = 1e-300;
// Lines aim at this many times what a value has to fall: in small boxes, and in wide ones, which lose of it.
constexpr double kAims[] = {1.2, 4.0};
constexpr double kFar = 1e9;  // no distance
constexpr double kPi = 3.14159265358979;  // not more than it

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
// or the third. TubeSum's `table` holds the coefficients of cosines and sines in kTubeColumn's columns.
struct SumOnBox {
    const TubeSum* s;
    One x[4], h[4];  // of its own joints
    One columns[kTubeColumns], reach[kTubeTerms];
    const One &value = columns[0], *last = columns + kTubeSteep;
    One swing, parts[4], noise;  // by how much it varies, in all and by joint

    One& by(int j, int k = 4, int l = 4, int m = 4) { return columns[kTubeColumn.of[j][k][l][m]]; }
    const One& by(int j, int k = 4, int l = 4, int m = 4) const { return columns[kTubeColumn.of[j][k][l][m]]; }

    // Sums of `of` times columns of the table, eight at a time.
    void sums(const One* of, int column, int end) {
        for (; column < end; column += 8) {
            One all[8];
            clear(all, 8);
            const double* at = s->table + column;
            for (int t = 0; t < s->terms; t++, at += kTubeColumns) {
                PINSING_UNROLL
                for (int k = 0; k < 8; k++) all[k] += of[t] * at[k];
            }
            for (int k = 0; k < 8; k++) columns[column + k] = all[k];
        }
    }

    SumOnBox(const TubeSum& sum, const One* all_x, const One* all_h, bool fine) : s(&sum) {
        One cosine[kTubeTerms], sine[kTubeTerms], farthest = spread(4.0);
        for (int j = 0; j < 4; j++) {
            x[j] = all_x[sum.joint[j]];
            h[j] = all_h[sum.joint[j]];
            farthest = vmax(farthest, vabs(x[j]));
        }
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
        sums(cosine, 0, kTubeOdd);
        sums(sine, kTubeOdd, kTubeSteep);
        if (fine) sums(cosine, kTubeFourth, kTubeColumns);
        else clear(columns + kTubeFourth, kTubeColumns - kTubeFourth);
        for (int t = 0; t < s->terms; t++) {
            const One r = reach[t], rrr = r * r * r;
            cosine[t] = fine ? rrr * r * (1.0 / 120.0) : rrr * (1.0 / 24.0);
        }
        sums(cosine, kTubeSteep, kTubeFourth);
        noise = s->size * (s->noise + 4.5e-16 * s->reach * s->reach * s->reach * farthest);
        finish();
    }

    void finish() {
        swing = spread(0.0);
        for (int j = 0; j < 4; j++) {
            One bent = spread(0.0), more = last[j];
            for (int k = 0; k < 4; k++) {
                bent += vabs(by(j, k)) * h[k];
                One a = spread(0.0);
                for (int l = 0; l < 4; l++) {
                    One b = vabs(by(j, k, l)) * (1.0 / 6.0);
                    for (int m = 0; m < 4; m++) b += vabs(by(j, k, l, m)) * (h[m] * (1.0 / 24.0));
                    a += b * h[l];
                }
                more += a * h[k];
            }
            parts[j] = h[j] * (vabs(by(j)) + bent * 0.5 + more);
            swing += parts[j];
        }
        swing = swing * kMore + noise;
    }

    void add(const SumOnBox& other, double times) {
        for (int i = 0; i < kTubeColumns; i++) columns[i] += other.columns[i] * times;
        noise += other.noise * times;
    }

    // The least and the largest size on the box.
    One least() const { return vmax(vabs(value) - swing, 0.0); }
    One most() const { return vabs(value) + swing; }

    // Where it is zero each joint is near the value that the others leave to it: where that is less, the
    // middle and half width of a joint's range are moved.
    void zeros(int j, OneMask wanted, One& middle, One& wide) const {
        const One slope = by(j), size = vmax(vabs(slope), kLeast), range = h[j];
        const One other = (swing - vabs(slope) * range) * kMore;
        const One to = select(slope > 0.0, -1.0 * value, value);
        const One low = vmax((to - other) / size, -1.0 * range), high = vmin((to + other) / size, range);
        const auto less = wanted & (low < high) & (high - low < 1.9 * range);
        middle = select(less, middle + 0.5 * (low + high), middle);
        wide = select(less, 0.5 * kMore * (high - low) + 1e-13, wide);
    }

    // Of values of a sign, from the middle, or from all points: along a unit direction or its opposite,
    // whichever the value falls along at first.
    Fall along(const One* e, One sign, bool all_points) const {
        const One zero = spread(0.0);
        One slope = zero, curve = zero, jerk = zero, snap = zero, off[5] = {};
        Fall f;
        f.last = f.top = zero;
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
                    for (int m = 0; m < 4; m++) c += by(j, k, l, m) * e[m];
                    twisted += by(j, k, l) * e[l];
                    part += vabs(c) * h[l];
                    whole += c * e[l];
                }
                bend += by(j, k) * e[k];
                turn += (vabs(twisted) * 0.5 + part * (1.0 / 6.0)) * h[k];
                twist += twisted * e[k];
                more += whole * e[k];
                off[2] += 3.0 * vabs(whole) * h[j] * h[k];
            }
            slope += by(j) * e[j];
            curve += bend * e[j];
            jerk += twist * e[j];
            snap += more * e[j];
            f.turns[j] = h[j] * (vabs(bend) + turn);
            off[1] += 24.0 * f.turns[j];
            off[2] += 6.0 * vabs(twist) * h[j];
            off[3] += 2.0 * vabs(more) * h[j];
        }
        const double per = all_points ? kMore : 0.0, n = s->reach;
        const One least = vabs(slope) - (off[1] * (per / 24.0) + n * noise);
        f.slope = vmax(least, 0.0);
        f.curve = sign * curve + off[2] * (per / 6.0) + n * n * noise;
        // It goes where the slope is down, if that is known.
        f.jerk = select(least > 0.0, select(slope > 0.0, -1.0 * jerk, jerk), vabs(jerk));
        f.jerk = f.jerk + (off[3] * (per / 2.0) + n * n * n * noise);
        f.snap = sign * snap + off[4] * per + n * n * n * n * noise;
        f.last = f.last * kMore;
        // Where it falls no further, about: a step of any length is true.
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
    One within(const One* e) const {
        const Fall f = along(e, select(value > 0.0, spread(1.0), spread(-1.0)), false);
        const One left = (vabs(value) + noise) * kMore;
        One low = spread(0.0), high = select(f.by(f.top) > left, f.top, spread(kFar));
        for (double step = 1.0; step > 1e-7; step *= 0.5)
            high = select(f.by(spread(step)) > left, vmin(spread(step), high), high);
        halve(low, high, 1.0, 8, [&](One middle) { return f.by(middle) > left; });
        return high * kMore;
    }
};

// Eigenvectors (v[k] + 4) and eigenvalues (w) of the second derivatives, about: what is added to
// their diagonal makes these positive.
PINSING_INLINE void eigen(const SumOnBox& f, One v[4][8], One* w) {
    One most = spread(kLeast);
    for (int i = 0; i < 4; i++) {
        One row = spread(0.0);
        for (int j = 0; j < 8; j++) v[i][j] = j < 4 ? f.by(i, j) : spread(j == 4 + i);
        for (int j = 0; j < 4; j++) row += vabs(v[i][j]);
        most = vmax(most, row);
    }
    for (int i = 0; i < 4; i++) v[i][i] += most;
    orthogonalise(v[0], 4, 4, 4, 8);
    for (int i = 0; i < 4; i++) w[i] = vsqrt(dot(v[i], v[i], 4)) - most;
}

// The unit direction e in which a value of a sign has fallen by `drop` first, to second order:
// -m (1 + m H)^-1 g with the least m > 0. It has no proof and needs none.
PINSING_INLINE void shortest(const SumOnBox& f, const One v[4][8], const One* w, One sign, One drop,
                             One* e) {
    One g[4], bend[4], step[4], least = spread(0.0), low = least, high = spread(1.0);
    for (int i = 0; i < 4; i++) {
        g[i] = spread(0.0);
        for (int j = 0; j < 4; j++) g[i] += v[i][4 + j] * f.by(j);
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
        for (int i = 0; i < 4; i++) e[j] -= v[i][4 + j] * step[i];
    }
    const One size = vsqrt(dot(e, e, 4));
    for (int j = 0; j < 4; j++) e[j] = e[j] / size;
}

// How far points of a box are from a joint value at most and at least.
PINSING_INLINE void of_value(const TubeSum& sum, const One* x, const One* h, One& most, One& least) {
    One angle = spread(sum.term[1] - 1.5707963267948966), wide = spread(0.0);
    for (int j = 0; j < 4; j++) {
        angle += x[sum.joint[j]] * sum.term[2 + j];
        wide += h[sum.joint[j]] * (2.0 * __builtin_fabs(sum.term[2 + j]));
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
    One least, most, noise, within;  // its least and largest size; how far its zeros are at most from points
    One off;                         // of a joint value: how far it is at least
    One signs;                       // of values where the determinant is zero; 0 where both may be
    Fall fall[4];                    // of values > 0 and < 0; by the second aim
    One parts[4], sway[4];

    void set(const TubeSum& sum, const One* x, const One* h, One drop, One sign) {
        const One zero = spread(0.0);
        const SumOnBox f(sum, x, h, true);
        s = &sum;
        signs = sign;
        least = f.least();
        most = f.most();
        noise = f.noise;
        within = off = zero;
        clear(sway, 4);
        for (int j = 0; j < 4; j++) parts[j] = f.parts[j];
        if (sum.is_value) return of_value(sum, x, h, within, off);
        for (int j = 0; j < 4; j++)
            if (sum.uses[j]) within += f.h[j] * f.h[j];
        One reached = spread(kFar), v[4][8], w[4], e[4];
        eigen(f, v, w);
        for (int k = 0; k < 4; k++) {
            const One way = spread(k % 2 ? -1.0 : 1.0);
            const auto other = way * signs < 0.0;
            if (!any(~other)) continue;
            const One over = select(drop < kFar, f.swing, spread(1e-3));
            shortest(f, v, w, way, kAims[k / 2] * vmin(drop, vabs(f.value) + over), e);
            fall[k] = f.along(e, way, true);
            reached = select(other, reached, vmin(reached, f.within(e)));
            if (k > 1) continue;
            One slope = zero;
            for (int j = 0; j < 4; j++) slope += f.by(j) * e[j];
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
            const auto falls = [&](int k) { return vmax(fall[k].at(t), fall[k + 2].at(t)); };
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
    const TubeSum* factors = p.sums + 3;
    clear(far, F + 1);
    split = zero;
    const SumOnBox rest(p.sums[1], x, h, false);
    SumOnBox D(p.sums[0], x, h, true);
    const One most = rest.most() * kMore;
    // Of all robots between the design and this one: P + E/2 within |E|/2.
    D.add(rest, 0.5);
    D.noise += 0.5 * most;
    D.finish();
    const auto done = D.least() > 0.0;
    if (!any(~done)) return;
    for (int j = 0; j < 4; j++) D.zeros(j, ~done, x[j], h[j]);
    const SumOnBox whole(p.sums[2], x, h, false);
    const One room = whole.least();
    One drop = spread(kFar), sign = zero, score[4];
    if (p.factors == 1 && factors[0].power == 1) {
        drop = most / vmax(room, kLeast);
        sign = select(whole.value > 0.0, -1.0 * rest.value, rest.value);
        sign = select(vabs(rest.value) > rest.swing, sign, zero);
    }
    for (int j = 0; j < 4; j++) score[j] = rest.parts[j] / vmax(most, kLeast);
    Condition all[kTubeSums];
    One within[kTubeSums], nearest = spread(kFar);
    for (int k = 0; k < F; k++) within[k] = nearest;
    for (int i = 0; i < p.factors; i++) {
        all[i].set(factors[i], x, h, drop, sign);
        One& of = within[factors[i].family];
        of = vmin(of, all[i].within);
        nearest = vmin(nearest, of);
    }
    for (int k = F; k >= 0; k--) {
        if (F == 1 && k == 0) {
            far[0] = far[1];
            break;
        }
        const auto apart = ~(all_but(k, within, F) < p.near);
        if (k < F && !any(apart)) continue;
        const One at_most = k < F ? vmin(far[F], within[k]) : nearest;
        const auto none_beyond = [&](One t) {
            One product = room;
            for (int i = 0; i < p.factors; i++) {
                const bool moves = k == F || factors[i].family == k;
                product = product * raised(all[i].below(moves ? t : spread(p.near)), factors[i].power);
            }
            return product > most;
        };
        One low = zero, high = vmin(at_most, spread(kPi));
        const auto some = none_beyond(low) | done, few = none_beyond(high);
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
    choose(score, 4, ~done, split);
}

// Adds a small sum in all five joints to a minor in four of them, to the second order; what it varies by
// the joint that is not among these is noise.
inline void add_small(const TubeSum& more, const One* x, const One* h, SumOnBox& minor) {
    constexpr int n = kTubeJoints;
    const int* own = minor.s->joint;
    One slope[n], bend[n][n], alone[n];
    clear(slope, n);
    clear(bend[0], n * n);
    for (int t = 0; t < more.terms; t++) {
        const double *term = more.term + kTubeTerm * t, *rate = term + 2;
        One angle = spread(term[1]), reach = spread(0.0), sine, cosine;
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
        alone[own[j]] = spread(0.0);
        minor.by(j) += slope[own[j]];
        for (int k = 0; k <= j; k++) minor.by(j, k) += bend[own[j]][own[k]];
    }
    for (int j = 0; j < n; j++) {
        One steepest = vabs(slope[j]);
        for (int k = 0; k < n; k++) steepest += vabs(bend[j][k]) * h[k];
        minor.noise += alone[j] * steepest * kMore;
    }
}

// As tube_box, of an arm of seven joints: its Jacobian has full rank where a minor is not zero. That is a
// sum in four joints and a small one in all five.
inline void rank_box(const Tube& p, One* x, One* h, One* far, One& split) {
    constexpr int n = kTubeJoints;
    const int F = p.families;
    const One zero = spread(0.0);
    One scores[n];
    clear(far, F + 1);
    clear(scores, n);
    split = zero;
    auto done = never();
    for (int i = 3 + p.factors; i < p.count && any(~done); i += 2) {
        const TubeSum &s = p.sums[i], &more = p.sums[i + 1];
        SumOnBox minor(s, x, h, false);
        const One least = minor.least();
        // Whether the second sum matters: else it is less than its terms.
        done = done | (least > more.size * (kMore + more.noise));
        if (any((least > 0.0) & ~done)) add_small(more, x, h, minor);
        else minor.noise += spread(more.size * kMore);
        minor.noise += spread(more.size * (more.noise + 1e-13));
        minor.finish();
        done = done | (minor.least() > 0.0);
        const One ratio = 0.2 + vabs(minor.value) / minor.swing, part = 1.0 / minor.swing;
        for (int j = 0; j < 4; j++) {
            const int joint = s.joint[j];
            scores[joint] += ratio * ratio * part * minor.parts[j];
            minor.zeros(j, ~done, x[joint], h[joint]);
        }
    }
    choose(scores, n, ~done, split);
    if (!any(~done)) return;
    One within[kTubeSums], nearest = spread(kFar), inside = nearest;
    for (int k = 0; k < F; k++) within[k] = nearest;
    for (int i = 0; i < p.factors;) {
        const int first = p.sums[3 + i].branch, k = p.sums[3 + i].family;
        One square = zero, middle_square = zero, parts[n];
        clear(parts, n);
        for (; i < p.factors && p.sums[3 + i].branch == first; i++) {
            const TubeSum& s = p.sums[3 + i];
            if (!s.is_value && !any(~done & (square < 9.0 * p.near * p.near))) {
                square = middle_square = spread(kFar * kFar);
                continue;
            }
            One low = zero, high, middle;
            if (s.is_value) {
                of_value(s, x, h, high, low);
                middle = high - h[s.joint[0]];
                parts[s.joint[0]] += h[s.joint[0]];
            } else {
                Condition c;
                c.set(s, x, h, spread(1e8), zero);
                high = c.within;
                halve(low, high, 2.0, 12, [&](One t) { return c.below(t) > c.most; });
                One left = c.most;
                for (int j = 0; j < 4; j++) {
                    if (!s.uses[j]) continue;
                    left -= c.parts[j];
                    const One share = c.parts[j] / vmax(c.most, kLeast) + vmin(c.sway[j], spread(1.0));
                    parts[s.joint[j]] += high * share;
                }
                middle = high * left / vmax(c.most, kLeast);
            }
            square += high * high;
            middle_square += middle * middle;
        }
        const auto nearer = square < nearest * nearest;
        inside = select(nearer, middle_square, inside);
        for (int j = 0; j < n; j++) scores[j] = select(nearer, parts[j], scores[j]);
        within[k] = vmin(within[k], vsqrt(square) * kMore);
        nearest = vmin(nearest, within[k]);
    }
    // Near a family, that its distance varies less.
    choose(scores, n, ~done & (4.0 * inside < nearest * nearest), split);
    for (int k = 0; k <= F; k++) {
        const auto none = k < F ? done | (all_but(k, within, F) < p.near) : done;
        far[k] = select(none, zero, k < F ? vmin(within[k], nearest) : nearest);
    }
}
