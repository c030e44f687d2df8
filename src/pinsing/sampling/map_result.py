"""What a map has found: how sigma_r and sigma_r / sigma_1 are distributed, and the worst."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.joint_text import typed
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL
from pinsing.prose import PLAIN, Page, Span, Table, alarm, caution, verdict
from pinsing.sampling.map_plan import MapPlan
from pinsing.sampling.tally import (
    QUANTILE_ERROR,
    Distribution,
    WorstPoint,
)
from pinsing.serialization import JsonResult

_SHOWN_WORST = 5
_DIGITS = 9


MapPoint = WorstPoint


@dataclass(frozen=True, eq=False)
class ClearancePoint:
    """One of the configurations nearest to a family.

    Attributes
    ----------
    index : int
        Its number in the map.
    q : (n,) array
        Radians or metres.
    lower, upper : float
        Bounds of the distance to the nearest family, radians (metres over the length scale);
        ``upper`` is infinite where the closed formula gives none.
    family : str
        The family of the least lower bound.
    """

    index: int
    q: Array
    lower: float
    upper: float
    family: str


@dataclass(frozen=True, eq=False)
class ClearanceSpread:
    """How the clearance is distributed over a map.

    Attributes
    ----------
    families : tuple of str
        The families that distances are taken to: all with real points, whatever the limits.
    complete : bool
        Whether the closed form is complete. Otherwise a singular configuration that belongs to
        no family may be nearer than ``lower``.
    lower, upper : Distribution
        Of the proven lower bound, and of the upper bound, as ``pinsing.clearance`` gives them.
        Radians; of joints that slide, metres over the length scale.
    nearest : tuple of ClearancePoint
        The configurations of smallest lower bound, smallest first.
    """

    families: tuple[str, ...]
    complete: bool
    lower: Distribution
    upper: Distribution
    nearest: tuple[ClearancePoint, ...]


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
    clearance : ClearanceSpread, optional
        Bounds of the distance to the nearest family, if the map was asked for them.
    """

    schema: ClassVar[str] = "pinsing/map/1"
    made_by: ClassVar[str] = "pinsing.sigma_map(arm)"

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
    clearance: ClearanceSpread | None = field(default=None, metadata={"optional": True})

    @checked
    def head(self, page: Page = PLAIN) -> str:
        """Lines above the table of quantiles.

        Parameters
        ----------
        page : Page
            Width and colour (`pinsing.prose`); plain text of 100 columns by default.
        """
        arm = self.plan.arm
        of = "" if self.complete else f" ({self.done:,} done)"
        near = self.singular + self.near_singular
        singular = alarm("singular") if self.singular else "singular"
        lines: list[tuple[Span, ...]] = [
            (f"map of {arm.name}: {self.plan}{of}",),
            (
                f"tip {arm.tip}, task {arm.task}, length scale {arm.length_scale:g} m; "
                f"engine {self.engine}",
            ),
            (singular, f" (sigma_r/sigma_1 <= {SINGULAR_RTOL:g}): {self.singular:,}"),
            (
                caution("near-singular") if self.near_singular else "near-singular",
                f" (<= {NEAR_RTOL:g}): {self.near_singular:,}; "
                f"{100 * near / self.done:.3g} % of all are singular or near-singular",
            ),
        ]
        return "\n".join(page.paragraph(*line, rest="  ") for line in lines)

    @checked
    def text(self, page: Page = PLAIN, degrees: bool = False) -> str:
        """All that is worth reading, fitted to a page.

        Parameters
        ----------
        page : Page
            Width and colour (`pinsing.prose`); plain text of 100 columns by default.
        degrees : bool
            Angles in degrees, labelled, instead of radians.

        Examples
        --------
        >>> import pinsing
        >>> result = pinsing.sigma_map(pinsing.load("planar3r"), count=1000)
        >>> print(result.text(degrees=True).splitlines()[0])
        map of planar3r: Sobol sample of 1,000 configurations over q2, q3
        """
        rows = Table(("share", "sigma_min", "ratio"), self.quantile_rows(), frozenset({0, 1, 2}))
        parts = [self.head(page), page.table(rows), self.tail(degrees, page)]
        if self.clearance is not None:
            parts[1:1] = _clearance_text(self.clearance, self.plan, degrees, page)
        return "\n\n".join(parts)

    def quantile_rows(self) -> tuple[tuple[str, str, str], ...]:
        """Share of the configurations, and what sigma_r and the ratio are at most there."""
        return _quantile_rows(self.sigma_min, self.ratio)

    @checked
    def tail(self, degrees: bool = False, page: Page = PLAIN) -> str:
        """Lines below the table: the worst configurations, in radians or degrees, and notes.

        Parameters
        ----------
        degrees : bool
            Angles in degrees, labelled, instead of radians.
        page : Page
            Width and colour (`pinsing.prose`); plain text of 100 columns by default.
        """
        lines = [f"quantiles to {100 * QUANTILE_ERROR:.1f} %; the smallest ratios:"]
        for point in self.worst[:_SHOWN_WORST]:
            room = page.width - 34
            q = typed(point.q, self.plan.arm.prismatic, degrees, _DIGITS, room=room)
            spans = (f"{point.ratio:.3g} (", verdict(point.status), f") at {q}")
            lines.append(page.paragraph(*spans, first="  ", rest="    "))
        lines += [page.paragraph(f"note: {note}", rest="  ") for note in self.notes]
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.text()


def _quantile_rows(
    one: Distribution, two: Distribution, scale: float = 1.0
) -> tuple[tuple[str, str, str], ...]:
    rows = []
    for p in (0.0, 0.001, 0.01, 0.1, 0.5, 0.9, 0.99, 1.0):
        share = {0.0: "smallest", 0.5: "median", 1.0: "largest"}.get(p, f"{100 * p:g} %")
        values = (scale * d.quantile(p) for d in (one, two))
        a, b = (f"{value:.4g}" if value < math.inf else "-" for value in values)
        rows.append((share, a, b))
    return tuple(rows)


def _clearance_text(spread: ClearanceSpread, plan: MapPlan, degrees: bool, page: Page) -> list[str]:
    """Quantiles of both bounds, and the configurations that are nearest to a family."""
    slides = any(plan.arm.prismatic)
    unit = "degrees" if degrees else "rad"
    what = f"clearance: distance to the nearest of {', '.join(spread.families)}, in {unit}" + (
        f" (of joints that slide, metres over {plan.arm.length_scale:g} m count as rad)"
        if slides
        else ""
    )
    if not spread.complete:
        what += (
            "; the closed form is NOT complete: singular configurations of no family may be nearer"
        )
    scale = 180 / math.pi if degrees else 1.0
    rows = _quantile_rows(spread.lower, spread.upper, scale)
    table = Table(("share", "at least", "at most"), rows, frozenset({0, 1, 2}))
    lines = ["the smallest clearances:"]
    lines += [_nearest(p, plan, degrees, scale, page) for p in spread.nearest[:_SHOWN_WORST]]
    return [page.paragraph(what, rest="  "), page.table(table), "\n".join(lines)]


def _nearest(point: ClearancePoint, plan: MapPlan, degrees: bool, scale: float, page: Page) -> str:
    q = typed(point.q, plan.arm.prismatic, degrees, _DIGITS, room=page.width - 34)
    return page.paragraph(
        f"{scale * point.lower:.3g} from {point.family} at {q}", first="  ", rest="    "
    )
