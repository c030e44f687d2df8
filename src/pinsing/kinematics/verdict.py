"""Singular, near-singular or regular: the one place that decides it, for everything that asks.

The measure is sigma_r / sigma_1 of the task Jacobian at the arm's own scale
(`pinsing.kinematics.batch`), with r the generic rank. The length scale changes sigma, and
not the verdict. Where all of the task can vanish, sigma_1 counts as no smaller than it commonly is.

How far around a configuration an arm is regular is proven from its Jacobian alone.
With the Jacobian J = U S V^T at q and h = S^(-1/2), J + D has the rank of J where
``|h U^T D V h| < 1``: ``h U^T (J + D) V h`` is then the identity and less, so regular. Along joint
steps d, ``D = sum d_k J_k + R`` with the derivatives J_k, which are Lie brackets of screws (Murray,
Li, Sastry, "A Mathematical Introduction to Robotic Manipulation", 1994, ch. 3), and a rest
``|R| <= K |d|^2 / 2``. Screws are written in the frame of a link in the middle of the chain, from
where fewer joints move each of them: K is small. The rank is the same in all frames.
It asks for no family and no design: a calibrated arm, or one whose families are not all known.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from pinsing._version import __version__
from pinsing.arguments import checked
from pinsing.errors import OptionError
from pinsing.kinematics.batch import (
    PINOCCHIO,
    Batch,
    batch,
    fixed_engine as fixed_engine,
    joint_frames,
    own_scale,
    random_turns,
)
from pinsing.measures import (
    ALIKE,
    NEAR_RTOL as NEAR_RTOL,
    SINGULAR_RTOL as SINGULAR_RTOL,
    Array,
    ArrayLike,
    Bool,
    Chain,
    Status as Status,
    sigma_ratio,
    status_of as status_of,
)
from pinsing.robot.arm import Arm
from pinsing.robot.chain import flatten
from pinsing.robot.nominal import exact_generic_rank, nominal
from pinsing.robot.source import kept

_RANK_SAMPLES = 6
_SIZE_SAMPLES = 15


class Measured(NamedTuple):
    """What is measured at N configurations."""

    sigma: Array  # (N, r), at the arm's length scale, largest first
    ratio: Array  # (N,), sigma_r / sigma_1 at its own scale: verdicts stand on it


@checked
@kept
def generic_rank(arm: Arm) -> int:
    """Return the rank of the task Jacobian at almost every configuration.

    Taken on the nominal geometry, exactly (`pinsing.robot.nominal`): no tolerance, no
    length scale. On the raw geometry a rounded angle could pretend a motion of relative size
    1e-6. Where it is not full, with mimic joints it is the greatest rank of random configurations
    at the own scale.

    Parameters
    ----------
    arm : Arm
        The arm, from ``load``.

    Returns
    -------
    int
        r; a configuration is singular where the rank is below it.

    Raises
    ------
    OptionError
        If it is zero: no joint moves the tip in any row of the task.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.kinematics.generic_rank(pinsing.load("planar3r"))
    3
    """
    geometry = nominal(arm)
    if geometry.arm is not arm:
        return generic_rank(geometry.arm)
    # Floats alone prove that the rank is as great as the size of J allows: rounding moves no
    # singular value by more than about 1e-14 sigma_1 of all six rows (Weyl's inequality), which is
    # about one at the arm's own scale: the task's rows may be nothing but rounding. So where the
    # last one is 1e-6 of that, and of the task's sigma_1, at a single configuration, J has full
    # rank there, and thereby at almost every one.
    sigma = batch(arm, PINOCCHIO).own_sigma(random_turns(arm, _RANK_SAMPLES))
    if (sigma[:, -1] > ALIKE * np.maximum(sigma[:, 0], 1.0)).any():
        rank = min(len(arm.task.rows), arm.n)
    elif arm.coupling is not None:
        rank = _sampled_rank(arm)
    else:
        rank = exact_generic_rank(geometry, arm.task)
    OptionError.refuse_if(
        rank == 0,
        f"task {arm.task}: no joint of {arm.name} moves tip {arm.tip!r} in any of its "
        "rows; choose other rows",
    )
    return rank


@kept
def task_size(arm: Arm) -> float:
    """Return the median of sigma_1 at the arm's own scale; 0 for ``pose``, which never vanishes."""
    if arm.task.name == "pose":
        return 0.0
    found = batch(arm, PINOCCHIO).own_sigma(random_turns(arm, _SIZE_SAMPLES))
    return float(np.median(found[:, 0]))


def ratio_of(arm: Arm, own_sigma: ArrayLike) -> Array:
    """Measure of verdicts (...,) from singular values (..., k >= r) at the arm's own scale."""
    return sigma_ratio(own_sigma, generic_rank(arm), task_size(arm))


def rank_of(arm: Arm, own_sigma: Array, rtol: float = SINGULAR_RTOL) -> int:
    """Return the number of singular values (k,) above ``rtol``, at the arm's own scale."""
    return int((own_sigma > zero_of(arm, own_sigma, rtol)).sum())


def zero_of(arm: Arm, own_sigma: Array, rtol: float = SINGULAR_RTOL) -> float:
    """Up to what a singular value is zero, beside ``own_sigma`` (k,) of the whole Jacobian."""
    return rtol * max(float(own_sigma[0]), task_size(arm))


def own_shares(arm: Arm, Q: ArrayLike) -> Array:
    """sigma_k / sigma_1 for k = 1 ... r at the arm's own scale, (N, r); the last are the ratios."""
    own = batch(arm).own_sigma(np.atleast_2d(arm.check(Q)))
    count = range(1, generic_rank(arm) + 1)
    size = task_size(arm)
    return np.stack([sigma_ratio(own, k, size) for k in count], axis=1)


def measured(on: Batch, Q: Array) -> Measured:
    """Singular values and ratios at Q (N, n), on an engine that is fixed."""
    sigma = on.sigma(Q)
    ratio = ratio_of(on.arm, on.own_sigma(Q, sigma))
    return Measured(np.asarray(sigma[:, : generic_rank(on.arm)]), ratio)


def measure(arm: Arm, Q: ArrayLike, engine: str = "auto") -> Measured:
    """Singular values and ratios at Q (N, n), radians and metres."""
    return measured(batch(arm, engine), np.atleast_2d(arm.check(Q)))


def ratios(arm: Arm, Q: ArrayLike, engine: str = "auto") -> Array:
    """Measure of verdicts (N,) at Q (N, n), radians and metres, however many turns away."""
    Q = np.atleast_2d(arm.fold(Q))
    return ratio_of(arm, batch(arm, engine).own_sigma(Q)) if len(Q) else np.zeros(0)


def basis(arm: Arm) -> dict[str, object]:
    """Return the basis of verdicts on ``arm``, for the `known` of a copy sent elsewhere."""
    return {
        "generic_rank": generic_rank(arm),
        "own_scale": own_scale(arm),
        "task_size": task_size(arm),
    }


def check_tolerances(rtol: float, near_rtol: float) -> None:
    """Raise OptionError unless 0 <= rtol <= near_rtol < 1."""
    OptionError.refuse_if(
        not 0 <= rtol <= near_rtol < 1,
        f"need 0 <= rtol <= near_rtol < 1, got {rtol:g} and {near_rtol:g}",
    )


def scale_notes(arm: Arm) -> Iterator[str]:
    """Say where sigma and verdicts stand on different lengths."""
    scale = own_scale(arm)
    if scale.of_sigma is None:
        yield (
            "sigma_r/sigma_1, which singular and near-singular are judged by, is taken at the "
            f"arm's own length of {scale.length:g} m, sigma at length scale {arm.length_scale:g} m"
        )


def _sampled_rank(exact: Arm) -> int:
    """The same of an arm with mimic joints, by floats: these may follow by any multiple."""
    # Whole circles, not the limits: an arm whose limits are narrow has a generic rank too.
    Q = random_turns(exact, _RANK_SAMPLES)
    J = batch(exact).frame_jacobians(Q)
    scale = own_scale(exact)
    sigma = np.linalg.svd(scale.apply(exact, J, Q), compute_uv=False)
    largest = max(float(np.abs(J[:, :3]).max()) / scale.length, float(np.abs(J[:, 3:]).max()))
    if sigma.max() <= SINGULAR_RTOL * largest:
        return 0
    return int((sigma > SINGULAR_RTOL * sigma[:, :1]).sum(axis=1).max())


def fixed_batch(arm: Arm, engine: str = "auto") -> Batch:
    """Return a Batch on this thread alone, on a `fixed_engine`, without what only drawing needs."""
    return Batch(_lean(arm), fixed_engine(arm, engine), 1)


def last_and_ratio(on: Batch, Q: Array) -> tuple[Array, Array]:
    """Return sigma_r (N,) of configurations Q (N, n), and the ratio (N,) of verdicts."""
    found = measured(on, Q)
    return found.sigma[:, -1], found.ratio


def fingerprint(arm: Arm) -> str:
    """SHA-256 of every number of the arm that its singular values depend on."""
    chain = flatten(arm)
    parts = [chain.R, chain.t, chain.prismatic, np.array(arm.task.rows), arm.length_scale]
    if arm.task.at_tip:
        parts.append(np.array(arm.task.at_tip))
    if arm.coupling is not None:
        parts += [arm.coupling.matrix, arm.coupling.offset]
    digest = hashlib.sha256()
    for part in parts:
        array = np.ascontiguousarray(part, dtype=np.float64)
        digest.update(f"{array.shape};".encode() + array.tobytes())
    return digest.hexdigest()


def run_identity(kind: str, on: Batch) -> dict[str, Any]:
    """Return what a folder records of how a run computes, as plain JSON values."""
    return {
        "kind": kind,
        "pinsing": __version__,
        "engine": on.engine,
        "robot": fingerprint(on.arm),
        "rank": generic_rank(on.arm),
    }


def recorded_engine(known: Mapping[str, Any] | None, asked: str) -> str:
    """Engine to go on with: that of the run on disk, unless another is asked for by name."""
    if known is None or asked not in ("auto", "batch"):
        return asked
    engine = str(known.get("engine", asked))
    return asked if asked == "batch" and engine == PINOCCHIO else engine


def _lean(arm: Arm) -> Arm:
    source = replace(
        arm.source,
        path=None,
        shapes=None,
        full_model=arm.model,
        locked=(),
        reference=pin.neutral(arm.model),
        base="universe",
    )
    lean = replace(arm, source=source, notes=())
    lean.known.update(basis(arm))
    return lean


ROWS = 2000
"""Configurations at a time: their brackets take some megabytes."""


@checked
def regular_radius(arm: Arm, Q: ArrayLike) -> Array:
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
    if (frame := arm.once("frame of a ball", lambda: _Frame.of(arm))) is not None:
        for first in range(0, len(flat), ROWS):
            part = slice(first, first + ROWS)
            found[part] = frame.radius(flat[part])
    return found.reshape(array.shape[:-1])


@dataclass(frozen=True, eq=False)
class _Frame:
    """A link in whose frame screws are written, translations first."""

    chain: Chain
    link: int  # screws refer to the origin of this joint from 0, or the tip, before it moves
    metre: float  # units of length in a metre: lengths count like angles
    slide: float  # factor of steps of a sliding joint
    rows: slice
    moves: Array  # (n, n), [k, j]: 1 where k moves screw j away from the base, -1 towards it

    @classmethod
    def of(cls, arm: Arm) -> _Frame | None:
        """The frame in which bends are least; None where nothing is known of the arm."""
        parts = {(0, 1, 2, 3, 4, 5): slice(0, 6), (0, 1, 2): slice(0, 3), (3, 4, 5): slice(3, 6)}
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
        """Bound (N,) second derivatives of the Jacobian along unit steps, at Q and within 1.

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
        R, p = joint_frames(self.chain, Q)
        a, slides = R[:, :-1, :, 2], self.chain.prismatic[:, None]
        off = p[:, :-1] - p[:, self.link, None]
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
