"""Loop closure of a mechanism: residual, constraint Jacobian, generic ranks.

The Jacobians are those of Pinocchio's constraint models: a point anchor for loops of kind ``3d``
and ``planar`` (which keeps its first two rows), a frame anchor for ``6d``. Rows of a loop are in
the axes of its first frame; translations before rotations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import OptionError, PinsingError
from pinsing.loops.structure import closing, idle_link, once
from pinsing.measures import SINGULAR_RTOL
from pinsing.robot.mechanism import Mechanism

Mask = npt.NDArray[np.bool_]

CLOSED = 1e-11
"""A residual (metres over the length scale, radians) up to this counts as closed."""

_SEED = 5471
_STEP = 0.03
_FAR = 30.0


@once
def to_its_size(mechanism: Mechanism) -> Mechanism:
    """The mechanism, or one whose length scale is its own size where that is far from the given.

    Newton's steps of a system with lengths and angles in it depend on it: a linkage of millimetres
    on a scale of a metre has columns that are lost beside those of turning.
    """
    ends = np.array([mechanism.lower, mechanism.upper])[:, mechanism.prismatic]
    size = max(_longest(mechanism), float(np.abs(ends[np.isfinite(ends)]).max(initial=0.0)))
    if size == 0 or 1 / _FAR <= size / mechanism.length_scale <= _FAR:
        return mechanism
    return replace(mechanism, length_scale=size)


def _longest(mechanism: Mechanism) -> float:
    """The longest shift from one joint, or frame, to the next, metres."""
    model = mechanism.model
    places = [*model.jointPlacements, *(f.placement for f in model.frames)]
    return max(float(np.linalg.norm(p.translation)) for p in places)


class Loops:
    """Pinocchio's constraint models of a mechanism with data of their own: one per thread."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        model = mechanism.model
        self._data = model.createData()
        self._output = mechanism.output_id
        self._task = np.array(mechanism.task.rows)
        self._anchors = []
        scales: list[float] = []
        for loop, i, k in zip(mechanism.loops, *closing(mechanism), strict=True):
            a, b = model.frames[i], model.frames[k]
            kind = (
                pin.FrameAnchorConstraintModel
                if loop.kind == "6d"
                else pin.PointAnchorConstraintModel
            )
            anchor = kind(model, a.parentJoint, a.placement, b.parentJoint, b.placement)
            self._anchors.append((anchor, anchor.createData(), loop.rows))
            scales += [1 / mechanism.length_scale if row < 3 else 1.0 for row in range(loop.rows)]
        joints = list(model.joints)[1:]
        self._plain = np.array([j.idx_q for j in joints if j.nq == 1], dtype=int)
        self._turning = np.array([j.idx_q for j in joints if j.nq == 2], dtype=int)
        self._from = [np.array([j.idx_v for j in joints if j.nq == k], dtype=int) for k in (1, 2)]
        self._nq = int(model.nq)
        self.row_scale = np.array(scales)
        self.column_scale = mechanism.space.metric
        self.task_scale = np.where(self._task < 3, 1 / mechanism.length_scale, 1.0)

    def model_q(self, q: Array) -> Array:
        """Pinocchio's configuration for q (n,), without checks."""
        out = np.empty(self._nq)
        out[self._plain] = q[self._from[0]]
        angles = q[self._from[1]]
        out[self._turning], out[self._turning + 1] = np.cos(angles), np.sin(angles)
        return out

    def at(self, q: Array) -> tuple[Array, Array]:
        """Residual (k,) and constraint Jacobian (k, n) at q (n,), metres and radians."""
        model, data = self.mechanism.model, self._data
        # The order matters: without calc() the Jacobian is silently that of the last call.
        pin.computeJointJacobians(model, data, self.model_q(q))
        residual, rows = [], []
        for anchor, store, count in self._anchors:
            anchor.calc(model, data, store)
            residual.append(np.array(store.constraint_position_error)[:count])
            rows.append(np.array(anchor.jacobian(model, data, store))[:count])
        return np.concatenate(residual), np.vstack(rows)

    def scaled(self, q: Array) -> tuple[Array, Array]:
        """Residual and Jacobian without units: lengths are over the length scale."""
        residual, G = self.at(q)
        return residual * self.row_scale, G * self.row_scale[:, None] * self.column_scale

    def output(self, q: Array) -> tuple[pin.SE3, Array]:
        """Placement of the output frame and its task rows (m, n), metres and radians."""
        model, data = self.mechanism.model, self._data
        J = pin.computeFrameJacobian(
            model, data, self.model_q(q), self._output, pin.LOCAL_WORLD_ALIGNED
        )
        placement = pin.updateFramePlacement(model, data, self._output)
        return pin.SE3(placement), np.array(J)[self._task]

    def output_scaled(self, q: Array) -> Array:
        """Output Jacobian without units (m, n)."""
        return np.asarray(self.output(q)[1] * self.task_scale[:, None] * self.column_scale)


@dataclass(frozen=True)
class Ranks:
    """Generic ranks of a mechanism, on its loop-closed configurations.

    Attributes
    ----------
    constraint : int
        Of the constraint Jacobian; less than its rows where loops are overconstrained
        (planar ones closed in space).
    mobility : int
        Dimension of the motions: joints minus the rank of the constraints.
    output : int
        Of the output velocity over all motions.
    """

    constraint: int
    mobility: int
    output: int


def residual(mechanism: Mechanism, q: npt.ArrayLike) -> Array:
    """Loop-closure error at q (n,): (k,), metres and radians."""
    return Loops(mechanism).at(mechanism.check(q))[0]


def constraint_jacobian(mechanism: Mechanism, q: npt.ArrayLike) -> Array:
    """Constraint Jacobian of all loops at q (n,): (k, n), metres and radians."""
    return Loops(mechanism).at(mechanism.check(q))[1]


def split(mechanism: Mechanism, J: Array) -> tuple[Array, Array]:
    """Columns of the actuated and of the passive joints of J (..., k, n)."""
    return J[..., list(mechanism.actuated)], J[..., list(mechanism.passive)]


def output_jacobian(mechanism: Mechanism, q: npt.ArrayLike) -> Array:
    """Task rows of the output frame at q (n,): (m, n), LOCAL_WORLD_ALIGNED, by all joints."""
    return Loops(mechanism).output(mechanism.check(q))[1]


def gauss_newton(
    loops: Loops, q: Array, free: Mask, steps: int = 60, reach: float = np.inf
) -> tuple[Array, float]:
    """Close the loops by moving the ``free`` joints (mask) least: configuration and residual.

    Steps are cut at half a radian (half a length scale): far from closure Newton's own
    would jump between assembly modes.
    """
    q, best = q.copy(), np.inf
    start, kept = q.copy(), q.copy()
    for _ in range(steps):
        error, G = loops.scaled(q)
        size = float(np.abs(error).max())
        if size >= best and best <= CLOSED:
            break
        best = size
        kept = q.copy()
        step = np.linalg.lstsq(G[:, free], -error, rcond=1e-11)[0]
        longest = float(np.abs(step).max(initial=0.0))
        if longest > 0.5:
            step *= 0.5 / longest
        q[free] += step * loops.column_scale[free]
        if not np.isfinite(q).all() or np.abs(q - start).max() > reach:
            return kept, best
        if size <= 1e-15:
            break
    last = float(np.abs(loops.scaled(q)[0]).max())
    return (q, last) if last <= best else (kept, best)


def ranks(mechanism: Mechanism) -> Ranks:
    """Generic ranks, from closed configurations drawn at random (seeded).

    Raises
    ------
    PinsingError
        If the loops close nowhere.
    OptionError
        If fewer joints are actuated than there are degrees of freedom. More are redundant
        actuation, and taken as such.
    """
    found = _ranks(mechanism)
    if found.mobility > len(mechanism.actuated):
        count = len(mechanism.actuated)
        driven = f"{count} {'joints are' if count > 1 else 'joint is'} actuated"
        raise OptionError(
            f"{mechanism.name} has {found.mobility} degrees of freedom, but {driven} "
            f"({', '.join(mechanism.inputs)}): "
            f"name_mot must list {found.mobility} or more"
        )
    return found


def random_closed(
    mechanism: Mechanism,
    count: int,
    rng: np.random.Generator,
    free: Mask | None = None,
    start: Array | None = None,
) -> list[Array]:
    """Closed configurations that random starts lead to; joints not ``free`` stay at ``start``."""
    loops = Loops(mechanism)
    free = np.ones(mechanism.n, dtype=bool) if free is None else free
    out = []
    for _ in range(count):
        q = mechanism.home.copy() if start is None else start.copy()
        drawn = rng.uniform(-1, 1, mechanism.n)
        drawn *= np.where(mechanism.prismatic, mechanism.length_scale, np.pi)
        q[free] = drawn[free]
        q, error = gauss_newton(loops, q, free)
        if error <= CLOSED:
            out.append(mechanism.space.wrap(q))
    return out


def near_home(mechanism: Mechanism) -> list[Array]:
    """Closed configurations from home and from starts around it."""
    loops, rng = Loops(mechanism), np.random.default_rng(_SEED)
    free = np.ones(mechanism.n, dtype=bool)
    out = []
    for away in (0.0, *np.repeat((0.05, 0.2), 4)):
        start = mechanism.home + away * rng.uniform(-1, 1, mechanism.n) * loops.column_scale
        q, error = gauss_newton(loops, start, free)
        if error <= CLOSED:
            out.append(mechanism.space.wrap(q))
    return out


def _beside_home(mechanism: Mechanism, loops: Loops) -> list[Array]:
    """Closed configurations on the branch of a home that closes the loops, beside it: few or none.

    Only where fewer constraints are independent there than at other closed configurations, and
    motions of a finite length show that this is no single point.
    """
    q = mechanism.home.copy()
    if np.abs(loops.scaled(q)[0]).max() > 1e-6:
        return []
    q, error = gauss_newton(loops, q, np.ones(mechanism.n, dtype=bool))
    if error > CLOSED:
        return []
    counted = {_rank(loops.scaled(q)[1], 1e-7)}
    out = [q]
    for away in (_STEP, -_STEP):
        at = q
        for _ in range(4):
            G = loops.scaled(at)[1]
            free = np.linalg.svd(G)[2][_rank(G, 1e-7) :]
            if not len(free):
                return []
            drawn = np.random.default_rng(_SEED).normal(size=len(free)) @ free
            start = at + away * drawn / np.linalg.norm(drawn) * loops.column_scale
            at, error = gauss_newton(loops, start, np.ones(mechanism.n, dtype=bool))
            if error > CLOSED or np.abs((at - start) / loops.column_scale).max() > _STEP / 2:
                return []
            counted.add(_rank(loops.scaled(at)[1], 1e-7))
            out.append(at)
    # A rank that changes at once is that of a singular point: the others tell what is generic.
    return out if len(counted) == 1 else []


def _rank(M: Array, rtol: float, size: float | None = None) -> int:
    """Singular values that are more than ``rtol`` times the largest, or another size."""
    sigma = np.linalg.svd(M, compute_uv=False)
    return int((sigma > rtol * (sigma[0] if size is None else size)).sum())


def _advice(mechanism: Mechanism) -> str:
    """What to look at where no configuration closes the loops."""
    size = _longest(mechanism)
    if size > 20.0 * mechanism.length_scale:
        return (
            f"lengths of the file are up to {size:.3g} m; if they are in millimetres, write them "
            f"in metres or give a length scale (--length-scale {10 ** round(np.log10(size)):.0f})"
        )
    return "check the frames, the lengths and the kinds of the loops"


@once
def _ranks(mechanism: Mechanism) -> Ranks:
    idle = idle_link(mechanism)
    if idle:
        raise PinsingError(f"{mechanism.name}: {idle}")
    samples = random_closed(mechanism, 12, np.random.default_rng(_SEED))
    if len(samples) < 3:
        samples += near_home(mechanism)
    if not samples:
        raise PinsingError(
            f"{mechanism.name}: the loops {', '.join(str(x) for x in mechanism.loops)} close "
            f"nowhere, as far as was looked: {_advice(mechanism)}"
        )
    loops = Loops(mechanism)
    # Branches may differ in their mobility: that of home is meant, where home closes the loops.
    around = _beside_home(mechanism, loops) or samples
    found = [loops.scaled(q)[1] for q in around]
    known = [_rank(G, SINGULAR_RTOL) for G in found]
    rank, output = max(known), 0
    if rank == mechanism.n:
        raise PinsingError(
            f"{mechanism.name}: the loops leave no motion ({mechanism.n} joints, "
            f"{rank} independent constraints): check the kinds of the loops"
        )
    for q, G, here in zip(around, found, known, strict=True):
        if here == rank:
            J = loops.output_scaled(q)
            moved = J @ np.linalg.svd(G)[2][rank:].T
            output = max(output, _rank(moved, SINGULAR_RTOL, float(np.linalg.norm(J, 2))))
    return Ranks(rank, mechanism.n - rank, output)
