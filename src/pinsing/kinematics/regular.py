"""How far around a configuration an arm is regular: proven from its Jacobian alone.

With the Jacobian J = U S V^T at q and h = S^(-1/2), J + D has the rank of J where
``|h U^T D V h| < 1``: ``h U^T (J + D) V h`` is then the identity and less, so regular. Along joint
steps d, ``D = sum d_k J_k + R`` with the derivatives J_k, which are Lie brackets of screws (Murray,
Li, Sastry, "A Mathematical Introduction to Robotic Manipulation", 1994, ch. 3), and a rest
``|R| <= K |d|^2 / 2``. Screws are written in the frame of a link in the middle of the chain, from
where fewer joints move each of them: K is small. The rank is the same in all frames.

It asks for no family and no design: a calibrated arm, or one whose families are not all known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pinsing._types import Array, Bool
from pinsing.arguments import checked
from pinsing.measures import SINGULAR_RTOL
from pinsing.robot.arm import Arm
from pinsing.robot.chain import Chain, flatten

_ROWS = 2000
"""Configurations at a time: their brackets take some megabytes."""


@checked
def regular_radius(arm: Arm, Q: npt.ArrayLike) -> Array:
    """Return how far around configurations no other one is singular, proven.

    Of the geometry of the file, whatever is known of its singular configurations. The true
    distance is larger: in the median 1.03 to 2.6 times within 3 degrees of a family, 2 to 6 times
    elsewhere.

    Parameters
    ----------
    arm : Arm
        A serial arm without mimic joints; its task is the full pose, position or orientation.
    Q : (..., n) or (..., nq) array_like
        Radians and metres.

    Returns
    -------
    (...) array
        Euclidean length of joint differences, radians, or metres over the length scale; 0 where
        nothing is known, and for other arms and tasks.

    Raises
    ------
    ConfigurationError
        If Q has the wrong shape, or a value that is not finite.

    Examples
    --------
    >>> import pinsing
    >>> arm = pinsing.load("ur5")
    >>> radius = pinsing.kinematics.regular_radius(arm, [0, -1.2, 1.3, -1, -1.5, 0])
    >>> bool(0.1 < radius < pinsing.clearance(arm, [0, -1.2, 1.3, -1, -1.5, 0]).upper)
    True
    """
    array = arm.check(Q, "Q")
    flat, found = array.reshape(-1, arm.n), np.zeros(array.shape[:-1]).reshape(-1)
    frame = arm.once("frame of a ball", lambda: _Frame.of(arm))
    if frame is not None:
        for first in range(0, len(flat), _ROWS):
            part = slice(first, first + _ROWS)
            found[part] = frame.radius(flat[part])
    return found.reshape(array.shape[:-1])


@dataclass(frozen=True, eq=False)
class _Frame:
    """A link in whose frame screws are written.

    Attributes
    ----------
    chain : Chain
        Of the arm.
    link : int
        Screws refer to the origin of this joint from 0, or to the tip, in the frame of the link
        before.
    metre : float
        Units of length in a metre: lengths count like angles.
    slide : float
        What a step of a sliding joint is multiplied by.
    rows : slice
        Of screws, translations first.
    moves : (n, n) array
        1 where joint k moves the screw of joint j away from the base, -1 towards it, [k, j].
    """

    chain: Chain
    link: int
    metre: float
    slide: float
    rows: slice
    moves: Array

    @classmethod
    def of(cls, arm: Arm) -> _Frame | None:
        """The frame in which bends are least; None where nothing is known of the arm."""
        parts = {
            (0, 1, 2, 3, 4, 5): slice(0, 6),
            (0, 1, 2): slice(0, 3),
            (3, 4, 5): slice(3, 6),
        }
        rows = parts.get(tuple(arm.task.rows))
        if rows is None or arm.coupling is not None:
            return None
        chain, n = flatten(arm), arm.n
        size = float(np.linalg.norm(chain.t[1:], axis=1).sum())
        k, j = np.indices((n, n))
        frames = []
        for link in range(n + 1) if rows.stop == 6 else [n]:  # positions are those of the tip
            moves = np.where((link <= k) & (k < j), 1.0, 0.0) - ((j < k) & (k < link))
            metre = 4 / size if size else 1.0
            frames.append(cls(chain, link, metre, arm.length_scale, rows, moves))
        return min(frames, key=lambda f: float(f.bend(np.zeros((1, n)))[0]))

    def bend(self, Q: Array) -> Array:
        """Bound (N,) of second derivatives of the Jacobian along unit steps, at Q and within 1.

        A vector that turns with f joints has second derivatives of at most ``f |d|^2``, for the sum
        of f parts of a unit step is at most the root of f. The steps of the two sides of the link
        share ``|d|^2``.
        """
        chain, n = self.chain, self.chain.n
        slides = chain.prismatic
        between = np.abs(self.moves) > 0
        turning, sliding = between[~slides].sum(axis=0), between[slides].sum(axis=0)
        steps = np.linalg.norm(chain.t, axis=1)[None, 1:] + np.where(
            slides, np.abs(Q) + self.slide, 0.0
        )
        reach = np.concatenate([np.zeros((len(Q), 1)), np.cumsum(steps, axis=1)], axis=1)
        far = np.abs(reach[:, :n] - reach[:, self.link : self.link + 1])
        arm = turning * far + 2 * np.sqrt(turning * sliding) * self.slide
        moment = self.metre * np.where(slides, turning * self.slide, arm)
        turn = np.where(slides, 0, turning)
        parts = [moment] * (self.rows.start == 0) + [turn] * (self.rows.stop == 6)
        square = np.sum([p**2 + np.zeros((len(Q), n)) for p in parts], axis=0)
        sides = square[:, : self.link].sum(axis=1), square[:, self.link :].sum(axis=1)
        return np.asarray(np.sqrt(np.maximum(*sides)))

    def screws(self, Q: Array) -> tuple[Array, Array]:
        """Translations and rotations (N, n, 3) of unit steps, in the axes of the base."""
        chain = self.chain
        R, p = np.broadcast_to(np.eye(3), (len(Q), 3, 3)), np.zeros((len(Q), 3))
        axes, origins = [], []
        for i, slides in enumerate(chain.prismatic):
            p, R = p + R @ chain.t[i], R @ chain.R[i]
            axes.append(R[:, :, 2])
            origins.append(p)
            if slides:
                p = p + Q[:, i : i + 1] * axes[-1]
            else:
                c, s = np.cos(Q[:, i, None]), np.sin(Q[:, i, None])
                x, y, z = np.moveaxis(R, 2, 0)
                R = np.stack([c * x + s * y, c * y - s * x, z], axis=2)
        origins.append(p + R @ chain.t[-1])
        a, slides = np.stack(axes, axis=1), chain.prismatic[:, None]
        off = np.stack(origins[:-1], axis=1) - origins[self.link][:, None]
        v = np.where(slides, self.slide * a, np.cross(off, a))
        return self.metre * v, np.where(slides, 0.0, a)

    def radius(self, Q: Array) -> Array:
        """How far (N,) around Q (N, n) the rank is that of Q."""
        v, w = self.screws(Q)
        J = np.concatenate([v, w], axis=2)[..., self.rows]
        V, S, Ut = np.linalg.svd(J, full_matrices=False)
        sound: Bool = S[:, -1] > SINGULAR_RTOL * S[:, 0]
        h = 1 / np.sqrt(np.maximum(S, np.where(sound, 0.0, 1.0)[:, None]))
        # Screws of joint j as joint k moves them, [k, j]; the rotation of a screw carries both.
        turned = [np.cross(w[:, :, None], x[:, None]) for x in (v, w)]
        turned[0] += np.cross(v[:, :, None], w[:, None])
        D = (self.moves[..., None] * np.concatenate(turned, axis=3))[..., self.rows]
        right, left = h[:, :, None] * Ut, V * h[:, None]
        G = np.swapaxes(left, 1, 2)[:, None] @ D @ np.swapaxes(right, 1, 2)[:, None]
        beside = np.einsum("nkij,nkil->njl", G, G), np.einsum("nkij,nklj->nil", G, G)
        most = np.minimum(*(np.linalg.eigvalsh(M)[:, -1] for M in beside))
        g, K = np.sqrt(np.maximum(most, 0.0)), self.bend(Q) * h[:, -1] ** 2
        reach = 2 / (g + np.sqrt(g**2 + 2 * K) + 1e-9)
        # Entries are right to some hundred units in the last place of the largest singular value.
        off = 1e-9 + 1e-13 * S[:, 0] * h[:, -1] ** 2
        return np.where(sound, np.minimum(reach * (1 - off), 1.0), 0.0)
