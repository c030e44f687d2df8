"""Where to put the workpiece: motions of all poses of a toolpath, and the search among them.

The search is DIRECT (Jones, Perttunen, Stuckman 1993, in SciPy): it divides boxes of the ranges in
thirds, those first that have the best value for their size. It draws nothing at random, so that the
same ranges give the same placement. That no placement is better is not proven.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.errors import OptionError

RANGES = ("x", "y", "z", "roll", "pitch", "yaw")
"""What may be placed: metres along the axes of the base, radians about them."""
ANGLES = RANGES[3:]
TRIED = 150
"""Placements that are compared: with four ranges some millimetres and degrees are told apart."""


@dataclass(frozen=True, eq=False)
class WorkpiecePlacement:
    """How a workpiece was moved from where it was given.

    Attributes
    ----------
    x, y, z : float
        Metres along the axes of the base.
    roll, pitch, yaw : float
        Radians about the fixed axes x, y, z of the base, in this order, through ``about``.
    about : (3,) array
        The middle of the path as given (of the least box around its positions), metres.
    transform : (4, 4) array
        All of it, in the base frame: a pose T of the tool becomes ``transform @ T``.
    before : float
        Proven clearance of the path with the workpiece as given, radians; 0 if there is none.
    tried : int
        Placements that were compared.
    """

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    about: Array
    transform: Array
    before: float
    tried: int

    @checked
    def text(self, degrees: bool = True) -> str:
        """Return what to do in words, empty if nothing.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, or in radians.

        Examples
        --------
        >>> import numpy as np
        >>> from pinsing.postures.placement import place_at
        >>> place_at({"x": 0.05, "yaw": 0.1}, about=np.zeros(3)).text()
        'x = +0.050 m, yaw = +5.73° about (0.000, 0.000, 0.000) m'
        """
        factor, unit = (180 / np.pi, "°") if degrees else (1.0, " rad")
        moved = [f"{name} = {getattr(self, name):+.3f} m" for name in RANGES[:3]]
        moved += [f"{name} = {factor * getattr(self, name):+.3g}{unit}" for name in ANGLES]
        said = [text for name, text in zip(RANGES, moved, strict=True) if getattr(self, name)]
        if any(getattr(self, name) for name in ANGLES):
            said[-1] += f" about ({', '.join(f'{x:.3f}' for x in self.about)}) m"
        return ", ".join(said)


def check_ranges(place: Mapping[str, tuple[float, float]]) -> None:
    """Refuse ranges that make no sense.

    Raises
    ------
    OptionError
        If a name is none of `RANGES`, or a range is empty, or there is none.
    """
    if not place:
        raise OptionError(f"place needs a range of {', '.join(RANGES)}")
    for name, ends in place.items():
        if name not in RANGES:
            raise OptionError(f"place: {name!r} is none of {', '.join(RANGES)}")
        if not (np.isfinite(ends).all() and ends[0] < ends[1]):
            raise OptionError(
                f"place: {name} needs two ascending values, got {ends[0]:g} and {ends[1]:g}"
            )
        if name in ANGLES and ends[1] - ends[0] > 2 * np.pi + 1e-9:
            raise OptionError(f"place: {name} from {ends[0]:g} to {ends[1]:g} rad is over a turn")


def place_at(
    values: Mapping[str, float], about: Array, before: float = 0.0, tried: int = 0
) -> WorkpiecePlacement:
    """Return the placement with these values, rotated about a point (3,); others are zero."""
    from scipy.spatial.transform import Rotation

    turn = [values.get(name, 0.0) for name in ANGLES]
    shift = [values.get(name, 0.0) for name in RANGES[:3]]
    moved = np.eye(4)
    moved[:3, :3] = Rotation.from_euler("xyz", turn).as_matrix()
    moved[:3, 3] = about + shift - moved[:3, :3] @ about
    x, y, z = shift
    roll, pitch, yaw = turn
    return WorkpiecePlacement(x, y, z, roll, pitch, yaw, about, moved, before, tried)


def search(
    value: Callable[[dict[str, float]], float], ranges: Mapping[str, tuple[float, float]]
) -> tuple[dict[str, float], int]:
    """Return the placement with the greatest ``value`` that was found, and how many were tried.

    It is rounded to a millimetre and a tenth of a degree, as a workpiece is put.
    """
    from scipy.optimize import direct

    found = direct(
        lambda x: -value(dict(zip(ranges, x.tolist(), strict=True))),
        list(ranges.values()),
        maxfun=TRIED,
        maxiter=TRIED,
        vol_tol=0.0,
    )
    best = {}
    for (name, (low, high)), x in zip(ranges.items(), found.x.tolist(), strict=True):
        unit = np.pi / 1800 if name in ANGLES else 1e-3
        best[name] = min(max(round(x / unit) * unit, low), high)
    return best, int(found.nfev)
