"""A mechanism of one freedom: its output over its input, or the path of its output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.mechanism.batch import BatchLoops
from pinsing.mechanism.closure import ranks
from pinsing.mechanism.feasible import curves
from pinsing.mechanism.led_pose import led_pose
from pinsing.mechanism.modes import assembly_sign, home
from pinsing.mechanism.pose_slice import COORDINATES
from pinsing.mechanism.singular_points import find_singular
from pinsing.plot.mechanism import TYPE_1, TYPE_2
from pinsing.robot.mechanism import Mechanism

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PLUS = "#3c7a4b"
MINUS = "#b8772c"
_PLAIN = "#41719c"
_STILL = 1e-9


def motion_curve(
    mechanism: Mechanism,
    over: Sequence[str] | None = None,
    ax: Axes | None = None,
    degrees: bool = True,
) -> Axes:
    """Draw all the poses of a mechanism with one degree of freedom, as a curve.

    Green is the assembly mode of home, brown the other; what is singular is marked.

    Parameters
    ----------
    mechanism : Mechanism
        One degree of freedom.
    over : two names, optional
        Of the input and x, y, z, roll, pitch, yaw of the output; the input and what the output
        moves most by default.
    ax : Axes, optional
        Axes to draw into.
    degrees : bool
        Angles in degrees.

    Raises
    ------
    OptionError
        If it has more freedoms, or these coordinates do not move.
    """
    from matplotlib import pyplot as plt

    freedoms = ranks(mechanism).mobility
    if freedoms != 1:
        raise OptionError(
            f"{mechanism.name} has {freedoms} degrees of freedom: its poses are no curve"
        )
    names = _names(mechanism, over)
    inputs = home(mechanism)[list(mechanism.actuated)]
    found = curves(mechanism, inputs, 0)
    points = find_singular(mechanism, found)
    ways = [t.q for t in found]
    told = [_values(mechanism, q, names, degrees) for q in ways]
    for k, name in enumerate(names):
        if not told or max(float(np.ptp(v[:, k])) for v in told) <= _STILL:
            raise OptionError(
                f"{mechanism.name}: {name} does not move; take two of "
                f"{', '.join((*mechanism.inputs, *COORDINATES))}"
            )
    ax = plt.subplots(figsize=(6, 5))[1] if ax is None else ax
    shown: dict[str, str] = {}
    for q, values in zip(ways, told, strict=True):
        signs = [assembly_sign(mechanism, x) for x in q]
        for begin, end, sign in _runs(signs):
            color, label = {
                "+": (PLUS, "assembly +, as at home"), "-": (MINUS, "assembly −")
            }.get(sign, (_PLAIN, "poses"))  # fmt: skip
            part = values[begin : min(end + 1, len(values))]
            ax.plot(*part.T, color=color, lw=1.8, label=None if label in shown else label)
            shown[label] = color
    for point in points:
        place = _values(mechanism, point.q[None], names, degrees)[0]
        place = _beside(mechanism, place, told, names, degrees)
        color = TYPE_1 if point.kind == "type 1" else TYPE_2
        told_before = point.kind in shown
        ax.plot(*place, "o", color=color, ms=6, zorder=4, ls="",
                label=None if told_before else point.kind)  # fmt: skip
        shown[point.kind] = color
    for axis, name in zip((ax.xaxis, ax.yaxis), names, strict=True):
        axis.set_label_text(f"{name} [{_unit(mechanism, name, degrees)}]")
    if all(name in COORDINATES[:3] for name in names):
        ax.set_aspect("equal", adjustable="datalim")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=8)
    ax.set_title(f"{mechanism.name}: every pose, by assembly mode", fontsize=10)
    return ax


def _names(mechanism: Mechanism, over: Sequence[str] | None) -> tuple[str, str]:
    if over is None:
        return mechanism.inputs[0], COORDINATES[led_pose(mechanism)["rows"][0]]
    names = ["yaw" if n in ("phi", "φ") else n for n in over]
    known = (*mechanism.inputs, *COORDINATES)
    if len(names) != 2 or names[0] == names[1] or not set(names) <= set(known):
        raise OptionError(
            f"a curve of poses goes over two of {', '.join(known)}; got {', '.join(over)}"
        )
    return names[0], names[1]


def _values(mechanism: Mechanism, q: Array, names: Sequence[str], degrees: bool) -> Array:
    """The two coordinates (N, 2) along configurations (N, n), angles without jumps."""
    R, p, _ = BatchLoops(mechanism).output(q)
    angles = np.unwrap(np.array([pin.rpy.matrixToRpy(M) for M in R]), axis=0)
    out = []
    for name in names:
        if name in mechanism.inputs:
            value = q[:, mechanism.joints.index(name)]
        else:
            row = COORDINATES.index(name)
            value = p[:, row] if row < 3 else angles[:, row - 3]
        out.append(np.degrees(value) if degrees and _turns(mechanism, name) else value)
    return np.stack(out, axis=1)


def _turns(mechanism: Mechanism, name: str) -> bool:
    if name in mechanism.inputs:
        return not mechanism.prismatic[mechanism.joints.index(name)]
    return name in COORDINATES[3:]


def _unit(mechanism: Mechanism, name: str, degrees: bool) -> str:
    return ("°" if degrees else "rad") if _turns(mechanism, name) else "m"


def _beside(
    mechanism: Mechanism, place: Array, told: Sequence[Array], names: Sequence[str], degrees: bool
) -> Array:
    """A point moved by whole turns onto the curve that it belongs to."""
    turn = np.array(
        [(360.0 if degrees else 2 * np.pi) if _turns(mechanism, n) else 0.0 for n in names]
    )
    every = np.concatenate(list(told))
    gap = every - place
    safe = np.where(turn > 0, turn, 1.0)
    shift = np.where(turn > 0, np.round(gap / safe), 0.0) * turn
    best = int(np.argmin(np.linalg.norm(gap - shift, axis=1)))
    return np.asarray(place + shift[best])


def _runs(signs: Sequence[str]) -> list[tuple[int, int, str]]:
    """Stretches (first, beyond the last, sign) of equal signs; a zero goes with what is before."""
    out: list[tuple[int, int, str]] = []
    for k, sign in enumerate(signs):
        if out and sign in (out[-1][2], "0"):
            out[-1] = (out[-1][0], k + 1, out[-1][2])
        else:
            out.append((k, k + 1, sign))
    return out
