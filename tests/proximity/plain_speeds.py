"""`pinsing.proximity.zones` once more, in NumPy, but for rounding: what the kernel is held to."""

import numpy as np

from pinsing.proximity.zones import SpeedBounds, sums_behind


class PlainBounds(SpeedBounds):
    """Bounds by arrays, without what one joint to spare has a better choice for."""

    def _inverses(self, M, rounds):
        """Return right inverses (N, k, m) of M (N, m, k), of which the limits' shares are small."""
        # A least square with weights; where there is a choice, those joints weigh more that take
        # more (C. L. Lawson, 1961).
        spin = np.full(M.shape[2] - len(self.judge.limits), 100 * self.judge.limits.max())
        ease = np.tile(np.append(self.judge.limits, spin) ** 2, (len(M), 1))
        best, least = np.zeros((len(M), M.shape[2], M.shape[1])), np.full(len(M), np.inf)
        for _ in range(1 if M.shape[1] == M.shape[2] else rounds):
            eased = np.swapaxes(M * ease[:, None], 1, 2)
            A = eased @ np.linalg.inv(M @ eased)
            A = 2 * A - A @ (M @ A)
            z = self._norms(A)
            most = self._largest(z)
            best[most < least], least = A[most < least], np.minimum(least, most)
            limits = self.judge.limits
            share = z[:, : len(limits)] / limits / np.maximum(most, 1e-300)[:, None]
            ease[:, : len(limits)] /= np.maximum(share, 0.3) ** 1.5
        return best

    def _largest(self, z):
        """Shares (N,) of the limits that joint speeds (N, k) are."""
        limits = self.judge.limits
        return np.asarray((z[:, : len(limits)] / limits).max(axis=1))

    def plain(self, C, R, rounds):
        """Bounds of shares (N,) in boxes of centres C (N, n) and half widths R (N, n)."""
        J = self.jacobians(C)
        M = self.rows @ J
        A, k = self._inverses(M, rounds), M.shape[2]
        active = np.flatnonzero(self.moving)
        r, slopes = R[:, active], [self._slope(J, J, int(j)) for j in active]
        G = np.empty((len(C), len(active), k, k))
        B = np.empty((len(C), len(active), *A.shape[1:]))
        for i, (j, slope) in enumerate(zip(active, slopes, strict=True)):
            Mj = self.rows @ slope
            G[:, i] = A @ Mj
            B[:, i] = G[:, i] @ A - self._carried(A, int(j), J[:, :3, j])
        E1, (E3, moved) = np.einsum("nj,njab->nab", r, np.abs(G)), self._rest(A, J, R)
        F = self._first_order(A, B, r)
        more = _times(E1, _times(E1, _times(E1, F)) + _times(E3, F)) + _times(E3, F)
        y = self._with_second_order(slopes, J, A, G, B, E1, E3, F, moved, r)
        # Where the first order is too much already, the second is not looked at.
        good = np.isfinite(y).all(axis=1) & (self._largest(F + more) <= 1)
        return np.where(good, self._largest(y), np.inf)

    def _with_second_order(self, slopes, J, A, G, B, E1, E3, F, moved, r):
        """Bounds y (N, d), infinite where nothing is proven."""
        active = np.flatnonzero(self.moving)
        E2, E3, Q, bent = np.zeros_like(E1), E3.copy(), np.zeros_like(E1), np.zeros(F.shape)
        for i, j in enumerate(active):
            for h in range(i, len(active)):
                # Bilinear in columns, so that the rule of products gives its derivative.
                both = self._slope(slopes[h], J, int(j)) + self._slope(J, slopes[h], int(j))
                Mjl = self.rows @ both
                rr = r[:, i] * r[:, h] / (1 if h > i else 2)
                second = A @ Mjl
                E2 += np.abs(second) * rr[:, None, None]
                squared = G[:, i] @ G[:, h] + G[:, h] @ G[:, i] - second
                Q += np.abs(squared) * rr[:, None, None]
                w, v = J[:, 3:, j], J[:, :3, active[h]]
                turned = G[:, i] @ B[:, h] + G[:, h] @ B[:, i] - second @ A
                turned += self._carried(A, int(j), np.cross(w, v))
                bent += self._norms(turned) * rr[:, None]
                for o in self._nearer(active, i, h):
                    third = self.rows @ self._slope(both, J, int(active[o]))
                    rrr = rr * r[:, o] / (1 + (o == i) + (o == h))
                    E3 += np.abs(A @ third) * rrr[:, None, None]
        T = Q @ (E1 + E2 + E3) + E1 @ (E2 + E3) + E3
        # Of A X x: all orders but the zeroth, but the first, and but the second.
        lever = self.w * np.linalg.norm(A[..., self.linear], axis=-1)
        first, second, third = (lever * moved[:, i, None] for i in range(3))
        F = F + bent + third + _times(E1, second) + _times(Q, first)
        with np.errstate(all="ignore"):
            left = np.eye(T.shape[1]) - np.minimum(T, 1e6)
            y = np.linalg.solve(left, F[..., None])[..., 0] * (1 + 1e-9)
            holds = (y > 0) & (F + _times(T, y) <= y)
        return np.where(np.all(holds, axis=1, keepdims=True), y, np.inf)

    def _slope(self, J, K, j):
        """Return derivatives (N, 6, k) of Jacobians by joint j, axes of the link behind ``middle``.

        Of twists at its point where the tip is at the centre: in base axes it is w_a x v_b with a
        before b. Column j is taken of K, the others of J: it is linear in both.
        """
        out = np.zeros_like(J)
        w, v = K[:, 3:, j, None], K[:, :3, j, None]
        own = slice(0, j) if j <= self.middle else slice(j + 1, J.shape[2])
        sign = 1 if j <= self.middle else -1
        linear, angular = J[:, :3, own], J[:, 3:, own]
        out[:, :3, own] = sign * (np.cross(linear, w, axis=1) + np.cross(angular, v, axis=1))
        out[:, 3:, own] = sign * np.cross(angular, w, axis=1)
        return out

    def _nearer(self, active, i, h):
        """Which of the active joints are third ones of i <= h, no farther from the middle."""
        behind = active > self.middle
        if behind[i] != behind[h]:
            return []
        nearer = range(i + 1) if behind[h] else range(h, len(active))
        return [o for o in nearer if behind[o] == behind[h]]

    def _carried(self, A, j, v):
        """Derivative (N, k, m) of A X by joint j, which moves the tip by v (N, 3)."""
        if j <= self.middle:
            return np.zeros_like(A)
        linear = A @ self.rows[:, :3]
        return np.asarray(np.cross(linear, v[:, None]) @ self.rows[:, 3:].T)

    def _rest(self, A, J, R):
        """Bound (N, k, k) what the third order and more of J adds to A M.

        With V_b the length of column b: in the axes in the middle the fourth derivative of column k
        by turning joints between it and the middle is at most the sum of V of the five. And bound
        (N, 3) how far the tip moves in these axes, by all orders, all but the first, and all but
        the second.
        """
        N, k = len(J), J.shape[2]
        r = np.concatenate([R * self.moving, np.zeros((N, k - R.shape[1]))], axis=1)
        here = np.linalg.norm(J[:, :3], axis=1)
        far = np.minimum(self.far, here + sums_behind(r * self.far))
        before, turning = np.arange(k) <= self.middle, r * self.turns
        rd = turning * ~before
        d = np.cumsum(rd, axis=1)
        behind, others = r * ~before * far, d - rd
        # Behind the middle, of products of two and three the later one at each place.
        pairs = far * rd**2 + 2 * behind * others
        triples = far * (d**3 - others**3) + 3 * behind * ~self.turns * others**2
        p, linear = np.zeros_like(r), np.zeros_like(r)
        for side in (range(self.middle, -1, -1), range(self.middle + 1, k)):
            angle, arms = np.zeros(N), np.zeros(N)
            for j in side:  # of the point, which the joints between move
                lever = here[:, j] + (arms if self.turns[j] else 0.0)
                p[:, j], linear[:, j] = angle, (4 * arms + lever * angle) * angle**3
                angle, arms = angle + turning[:, j], arms + r[:, j] * lever
        orders = triples.sum(axis=1) / 6, pairs.sum(axis=1) / 2, behind.sum(axis=1)
        moved = np.cumsum(np.stack(orders, axis=1), axis=1)[:, ::-1]
        linear, angular = linear / 24, p**4 / 24
        av = np.linalg.norm(A[..., self.linear], axis=-1)[..., None]
        aw = np.linalg.norm(A[..., ~self.linear], axis=-1)[..., None]
        return np.asarray(av * linear[:, None] + aw * angular[:, None]), moved

    def _norms(self, rhs):
        """Largest component (N, d) of rhs (N, d, m) times any of the twists."""
        v, w = rhs[..., self.linear], rhs[..., ~self.linear]
        return np.asarray(self.v * np.linalg.norm(v, axis=-1) + self.w * np.linalg.norm(w, axis=-1))

    def _first_order(self, rhs, B, r):
        """Largest (N, d) of (A - E1 A) X x in a box."""
        most, along = np.zeros(rhs.shape[:2]), np.zeros((len(rhs), B.shape[1], rhs.shape[1]))
        for speed, own in ((self.v, self.linear), (self.w, ~self.linear)):
            if not speed or not own.any():
                continue
            a, da = rhs[..., own], -B[..., own]
            length = np.linalg.norm(a, axis=-1)
            unit = a / np.maximum(length, 1e-300)[..., None]
            with_it = np.einsum("njdm,ndm->njd", da, unit)
            off = np.linalg.norm(da - with_it[..., None] * unit[:, None], axis=-1)
            across = np.einsum("nj,njd->nd", r, off)
            least = length - np.einsum("nj,njd->nd", r, np.abs(with_it))
            bow = np.minimum(across, across**2 / (2 * np.maximum(least, 1e-100)))
            bent = np.where(least > 0, bow, across - 2 * least)
            most += speed * (length + bent)
            along += speed * with_it
        return most + (np.abs(along) * r[..., None]).sum(axis=1)


def _times(M, x):
    """Products (N, d) of M (N, d, d) and x (N, d)."""
    return np.asarray((M @ x[..., None])[..., 0])
