"""What a map has found: how sigma_r and sigma_r / sigma_1 are distributed, and the worst."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.maps.plan import MapPlan
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
from pinsing.runs.distribution import Distribution, Point, distributions, worst_points
from pinsing.runs.tally import QUANTILE_ERROR, Tally
from pinsing.serialization import JsonResult

_SHOWN_QUANTILES = (0.0, 0.001, 0.01, 0.1, 0.5, 0.9, 0.99, 1.0)
_SHOWN_WORST = 5


MapPoint = Point


@dataclass(frozen=True, eq=False)
class MapResult(JsonResult):
    """All that a map keeps of its configurations.

    Attributes
    ----------
    plan : MapPlan
        What was asked for.
    engine : str
        ``pinocchio``, or the instruction set: the same one gives the same bits.
    done : int
        Configurations seen; fewer than planned if the map was stopped.
    singular, near_singular : int
        How many of them are that (ratio at most 1e-9; above it and at most 1e-2).
    sigma_min, ratio : Distribution
        Of sigma_r, and of sigma_r / sigma_1.
    worst : tuple of MapPoint
        Those of smallest ratio, smallest first, the first of equals first.
    complete : bool
        False if the map was stopped.
    notes : tuple of str
        The notes of the plan, and what happened on the way.
    """

    schema: ClassVar[str] = "pinsing/map/1"

    plan: MapPlan
    engine: str
    done: int
    singular: int
    near_singular: int
    sigma_min: Distribution
    ratio: Distribution
    worst: tuple[MapPoint, ...]
    complete: bool
    notes: tuple[str, ...]

    def head(self) -> str:
        """Lines above the table of quantiles."""
        arm = self.plan.arm
        of = "" if self.complete else f" ({self.done:,} done)"
        near = self.singular + self.near_singular
        return "\n".join(
            [
                f"map of {arm.name}: {self.plan}{of}",
                f"tip {arm.tip}, task {arm.task}, length scale {arm.length_scale:g} m; "
                f"engine {self.engine}",
                f"singular (sigma_r/sigma_1 <= {SINGULAR_RTOL:g}): {self.singular:,}",
                f"near-singular (<= {NEAR_RTOL:g}): {self.near_singular:,}, "
                f"{100 * near / self.done:.3g} % with the singular ones",
            ]
        )

    def quantile_rows(self) -> tuple[tuple[str, str, str], ...]:
        """Share of the configurations, and what sigma_r and the ratio are at most there."""
        rows = []
        for p in _SHOWN_QUANTILES:
            share = {0.0: "smallest", 0.5: "median", 1.0: "largest"}.get(p, f"{100 * p:g} %")
            values = (self.sigma_min.quantile(p), self.ratio.quantile(p))
            rows.append((share, *(f"{value:.4g}" for value in values)))
        return tuple(rows)  # type: ignore[arg-type]

    def tail(self, degrees: bool = False) -> str:
        """Lines below the table: the worst configurations, in radians or degrees, and notes."""
        slides = self.plan.arm.prismatic
        factor = np.where(slides, 1.0, 180 / np.pi if degrees else 1.0)
        lines = [f"quantiles to {100 * QUANTILE_ERROR:.1f} %; the worst:"]
        for point in self.worst[:_SHOWN_WORST]:
            q = ", ".join(f"{x:.6g}" for x in point.q * factor)
            lines.append(f"  {point.ratio:.3g} ({point.status}) at q = {q}")
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(lines)

    def __str__(self) -> str:
        rows = [
            f"  {share:>9}  {sigma:>10}  {ratio:>10}"
            for share, sigma, ratio in self.quantile_rows()
        ]
        top = f"  {'share':>9}  {'sigma_min':>10}  {'ratio':>10}"
        return "\n".join([self.head(), top, *rows, self.tail()])


def result_of(plan: MapPlan, engine: str, tally: Tally, notes: tuple[str, ...] = ()) -> MapResult:
    """Turn a tally into a result.

    Raises
    ------
    OptionError
        If it has seen no configuration.
    """
    if not tally.done:
        raise OptionError("the map was stopped before its first chunk was done")

    def locate(index: int) -> Array:
        return np.asarray(plan.configurations(index, index + 1)[0])

    sigma_min, ratio = distributions(tally, locate)
    return MapResult(
        plan=plan,
        engine=engine,
        done=tally.done,
        singular=tally.singular,
        near_singular=tally.near,
        sigma_min=sigma_min,
        ratio=ratio,
        worst=worst_points(tally, locate),
        complete=tally.done == plan.count,
        notes=plan.notes + notes,
    )
