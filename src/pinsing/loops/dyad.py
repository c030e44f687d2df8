"""Planar loops closed by a dyad: the 5R (RR-RR) and the four-bar (RR-R), in closed form.

Two links meet in a pin P. Each hangs on the end of an actuated crank, or on a fixed pivot; so the
passive angles follow from the intersection of two circles, and all modes can be listed.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.loops.structure import Sample, at_zero, closing, once, path_to
from pinsing.robot.mechanism import Mechanism

_TOUCH = 1e-12


@dataclass(frozen=True, eq=False)
class Side:
    """One half of the loop, at the zero of its joints, in the plane.

    Attributes
    ----------
    pivot : (2,) array
        Fixed point A, metres.
    crank : int or None
        Joint that turns the crank A-B; None if the link of the dyad hangs on A itself (B = A).
    crank_sign : float
        Sense of that joint in the plane.
    crank_length, crank_angle : float
        Metres, radians.
    pin : int
        Passive joint at B.
    pin_sign : float
        Sense of that joint.
    rod_length, rod_angle : float
        Of the link B-P.
    """

    pivot: Array
    crank: int | None
    crank_sign: float
    crank_length: float
    crank_angle: float
    pin: int
    pin_sign: float
    rod_length: float
    rod_angle: float

    def end(self, value: npt.ArrayLike) -> Array:
        """B (..., 2) at values (...) of the crank, metres."""
        angle = self.crank_sign * np.asarray(value, dtype=float) + self.crank_angle
        return self.pivot + self.crank_length * _unit(angle)


@dataclass(frozen=True, eq=False)
class Dyad:
    """The loop of a mechanism that two links close in a pin.

    Attributes
    ----------
    mechanism : Mechanism
        The whole.
    sides : tuple of two Side
        The first as in the loop's first frame.
    basis : (2, 3) array
        Axes of the plane, in those of the root.
    """

    mechanism: Mechanism
    sides: tuple[Side, Side]
    basis: Array

    def ends(self, inputs: npt.ArrayLike) -> tuple[Array, Array]:
        """Points B1 and B2 that the dyad hangs on, each (..., 2), at inputs (..., n_a)."""
        inputs = np.asarray(inputs, dtype=float)
        out = []
        for side in self.sides:
            if side.crank is None:
                out.append(np.broadcast_to(side.pivot, (*inputs.shape[:-1], 2)).copy())
            else:
                out.append(side.end(inputs[..., self.mechanism.actuated.index(side.crank)]))
        return out[0], out[1]

    def pin(self, inputs: npt.ArrayLike, left: bool) -> Array:
        """P (..., 2) at inputs (..., n_a), to the left or right of B1 -> B2; NaN if infeasible."""
        first, second = self.ends(inputs)
        gap = second - first
        distance = np.linalg.norm(gap, axis=-1)
        d1, d2 = self.sides[0].rod_length, self.sides[1].rod_length
        with np.errstate(invalid="ignore", divide="ignore"):
            along = (distance**2 + d1**2 - d2**2) / (2 * distance)
            square = d1**2 - along**2
            square = np.where(np.abs(square) <= _TOUCH * d1**2, 0.0, square)
            height = np.sqrt(square) * (1 if left else -1)
            unit = gap / distance[..., None]
        across = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
        return np.asarray(first + along[..., None] * unit + height[..., None] * across)

    def configuration(self, inputs: npt.ArrayLike, left: bool) -> Array:
        """All joints (..., n) of one assembly mode at inputs (..., n_a); NaN if infeasible."""
        return self.reaching(inputs, self.pin(inputs, left))

    def reaching(self, inputs: npt.ArrayLike, P: Array) -> Array:
        """All joints (..., n) at inputs (..., n_a) whose rods reach for P (..., 2)."""
        inputs = np.asarray(inputs, dtype=float)
        q = np.zeros((*inputs.shape[:-1], self.mechanism.n))
        q[..., list(self.mechanism.actuated)] = inputs
        for side, B in zip(self.sides, self.ends(inputs), strict=True):
            reach = P - B
            turned = 0.0 if side.crank is None else side.crank_sign * q[..., side.crank]
            angle = np.arctan2(reach[..., 1], reach[..., 0]) - side.rod_angle - turned
            q[..., side.pin] = side.pin_sign * angle
        return self.mechanism.space.wrap(q)

    def link_directions(self, q: npt.ArrayLike, side: int) -> tuple[Array, Array]:
        """Unit vectors (..., 2) along the crank and the rod of a side at q (..., n)."""
        q = np.asarray(q, dtype=float)
        this = self.sides[side]
        turned = 0.0 if this.crank is None else this.crank_sign * q[..., this.crank]
        rod = turned + this.pin_sign * q[..., this.pin] + this.rod_angle
        return _unit(turned + this.crank_angle), _unit(rod)

    def elbow_sine(self, q: npt.ArrayLike, side: int) -> Array:
        """Sine (...) of the angle from crank to rod at q (..., n), zero if straight."""
        crank, rod = self.link_directions(q, side)
        return np.asarray(crank[..., 0] * rod[..., 1] - crank[..., 1] * rod[..., 0])

    def point(self, q: npt.ArrayLike) -> Array:
        """P (..., 2) at closed configurations q (..., n), along the first side."""
        q = np.asarray(q, dtype=float)
        side = self.sides[0]
        B = side.pivot if side.crank is None else side.end(q[..., side.crank])
        return np.asarray(B + side.rod_length * self.link_directions(q, 0)[1])

    def at_pin(self, mechanism: Mechanism) -> bool:
        """Whether the output is the position of the pin, in the plane."""
        frames = mechanism.model.frames
        output = frames[mechanism.output_id]
        pins = [frames[k] for (k,) in closing(mechanism)]
        meets = any(
            output.parentJoint == p.parentJoint
            and np.allclose(output.placement.translation, p.placement.translation, atol=1e-12)
            for p in pins
        )
        rows = mechanism.task.rows
        across = [k for k in range(3) if k not in rows]
        position = set(rows) <= {0, 1, 2} and not (np.abs(self.basis[:, across]) > 1e-9).any()
        return meets and position

    def close(self, inputs: npt.ArrayLike) -> tuple[Array, ...]:
        """All configurations (n,) at one set of inputs (n_a,): two, one at type 2, or none.

        Where both links are equally long and their ends coincide, P is free on a circle: two of
        those configurations are given.
        """
        inputs = self.mechanism.check_inputs(inputs)
        first, second = self.ends(inputs)
        if np.linalg.norm(second - first) <= _TOUCH and np.isclose(
            self.sides[0].rod_length, self.sides[1].rod_length, rtol=1e-12
        ):
            around = [first + self.sides[0].rod_length * _unit(turn) for turn in (0.0, np.pi)]
            return tuple(self.reaching(inputs, P) for P in around)
        found = [self.configuration(inputs, left) for left in (True, False)]
        found = [q for q in found if np.isfinite(q).all()]
        if (
            len(found) == 2
            and np.abs(self.mechanism.space.wrap(found[0] - found[1])).max() <= 1e-12
        ):
            found.pop()
        return tuple(found)

    def working_modes(self, point: npt.ArrayLike) -> tuple[Array, ...]:
        """All configurations (n,) that put the pin at a point (2,) of the plane: up to four."""
        point = np.asarray(point, dtype=float)
        choices: list[list[tuple[float, ...]]] = []
        for side in self.sides:
            reach = point - side.pivot
            far, length, rod = float(np.linalg.norm(reach)), side.crank_length, side.rod_length
            if side.crank is None:
                choices.append([()] if abs(far - rod) <= 1e-9 * rod else [])
                continue
            cosine = (far**2 + length**2 - rod**2) / (2 * far * length) if far > 0 else np.inf
            away = float(np.arctan2(reach[1], reach[0])) - side.crank_angle
            bend = float(np.arccos(np.clip(cosine, -1, 1)))
            turns = [] if abs(cosine) > 1 + _TOUCH else [bend, -bend] if bend > 0 else [0.0]
            choices.append([(side.crank_sign * (away + turn),) for turn in turns])
        cranks = [side.crank for side in self.sides if side.crank is not None]
        out = []
        for one, two in itertools.product(*choices):
            values = dict(zip(cranks, (*one, *two), strict=True))
            out.append(self.reaching([values[j] for j in self.mechanism.actuated], point))
        return tuple(out)


@once
def planar_dyad(mechanism: Mechanism) -> Dyad | None:
    """Recognise a single planar loop that a dyad closes; None if the mechanism is another.

    Asked for: one loop; each of its frames at the end of an actuated crank and a passive link, or
    of a passive link alone; all axes parallel; both frames in one plane; no other joint.
    """
    model = mechanism.model
    if len(mechanism.loops) != 1 or mechanism.prismatic.any() or mechanism.loops[0].kind == "6d":
        return None
    loop = mechanism.loops[0]
    zero = at_zero(mechanism)
    axes = zero.axis
    normal = axes[0]
    if np.abs(np.abs(axes @ normal) - 1).max() > 1e-9:
        return None
    basis = _plane(normal)
    sides, used, heights = [], 0, []
    for (k,) in closing(mechanism):
        frame = model.frames[k]
        path = path_to(mechanism, int(frame.parentJoint))
        used += len(path)
        end = np.zeros(3)
        if path:
            end = zero.joints[path[-1] + 1].act(frame.placement.translation)
        side = _side(mechanism, path, zero, axes @ normal, basis, end)
        if side is None:
            return None
        sides.append(side)
        heights.append(float(end @ normal))
    # Ends that miss each other along the axes never close as points in space.
    if used != mechanism.n or (loop.kind == "3d" and abs(heights[0] - heights[1]) > 1e-9):
        return None
    return Dyad(mechanism, (sides[0], sides[1]), basis)


def _side(
    mechanism: Mechanism, path: list[int], zero: Sample, senses: Array, basis: Array, end: Array
) -> Side | None:
    driven = [j in mechanism.actuated for j in path]
    if driven not in ([True, False], [False]):
        return None
    points = [basis @ zero.origins[j] for j in path]
    rod = basis @ end - points[-1]
    length = float(np.linalg.norm(rod))
    crank = points[-1] - points[0]
    crank_length = float(np.linalg.norm(crank))
    if length <= 0 or (len(path) == 2 and crank_length <= 0):
        return None
    return Side(
        pivot=points[0],
        crank=path[0] if len(path) == 2 else None,
        crank_sign=float(np.sign(senses[path[0]])) if len(path) == 2 else 1.0,
        crank_length=crank_length,
        crank_angle=float(np.arctan2(crank[1], crank[0])) if len(path) == 2 else 0.0,
        pin=path[-1],
        pin_sign=float(np.sign(senses[path[-1]])),
        rod_length=length,
        rod_angle=float(np.arctan2(rod[1], rod[0])),
    )


def _plane(normal: Array) -> Array:
    """Axes of the plane, right-handed with the normal; x and y themselves where they fit."""
    if abs(normal[2]) > 1 - 1e-12:
        return np.array([[1.0, 0, 0], [0, np.sign(normal[2]), 0]])
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _unit(angle: npt.ArrayLike) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
