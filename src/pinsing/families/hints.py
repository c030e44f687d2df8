"""What a user may want to try: offsets of a drawing that are hardly meant."""

from __future__ import annotations

from collections.abc import Sequence

from pinsing.families.family import Family
from pinsing.robot.nominal import Nominal

SNAP = 1e-3
"""Metres; shorter offsets in a longer arm are often those of a drawing."""
_LONG = 100 * SNAP


def small_offset(geometry: Nominal) -> float | None:
    """The largest coordinate of a placement that is shorter than ``SNAP``, metres, if there is one.

    None for a small arm, to which a millimetre is much.
    """
    lengths = [abs(float(x)) for row in geometry.translation for x in row]
    if sum(lengths) < _LONG:
        return None
    return max((x for x in lengths if 0 < x < SNAP), default=None)


def snap_hint(offset: float, families: Sequence[Family] | None, complete: bool = False) -> str:
    """One line: what the families are without the small offsets; None if there was no time."""
    if families is None:
        return (
            f"offsets of up to {1e3 * offset:.3g} mm are kept as they are: --snap-length {SNAP:g} "
            "puts them to zero (there was no time to tell what it gives)"
        )
    found = " | ".join(f.text for f in families) or "no singular configurations"
    whole = "" if complete else " (not complete)"
    return (
        f"offsets of up to {1e3 * offset:.3g} mm are kept as they are: "
        f"--snap-length {SNAP:g} puts them to zero and gives {found}{whole}"
    )


def unsolved_hint(systems: int) -> str:
    """One line: equations that finitely many joint values would say better."""
    if systems == 1:
        many, they = "a system of equations was", "it stays"
    else:
        many, they = f"{systems} systems of equations were", "they stay"
    return (
        f"time was over before {many} solved for joint values: {they} as stated, which is as true; "
        "more time (--seconds) may give these"
    )


def by_rank_hint(families: Sequence[Family], rank: int) -> str | None:
    """One line: which families are equations together with the rank; None if none is.

    Equations of neighbouring axes, or those that slices were led to, are zero wherever the arm is
    singular there; that they are zero nowhere else is not shown.
    """
    asked = [f for f in families if f.confirm is not None and not f.confirm.touching]
    names = [f.name for f in asked if any(b.equations for b in f.branches)]
    if not names:
        return None
    return (
        f"equations of {', '.join(names)}: they may hold at some regular configurations, too; "
        f"singular are those at which the rank drops below {rank}, for which `contains`, "
        "`distance` and `sample` ask"
    )
