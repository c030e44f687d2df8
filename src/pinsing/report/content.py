"""What a report of an arm is made from: everything is computed here, nothing is worded."""

from __future__ import annotations

import contextlib
import os
import platform
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib import metadata

import numpy as np

from pinsing._types import Array
from pinsing._version import __version__
from pinsing.configuration.at import at
from pinsing.configuration.state import State
from pinsing.errors import PinsingError
from pinsing.families import ClosedForm, Family, closed_form
from pinsing.families.telling_poses import telling_poses
from pinsing.kinematics.verdict import SINGULAR_RTOL
from pinsing.proximity.clearance import Clearance, clearance
from pinsing.proximity.suggestion import Suggestion, suggest
from pinsing.report.info import ArmInfo, describe
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal

_LIBRARIES = ("numpy", "pin", "python-flint", "matplotlib", "meshcat")


@dataclass(frozen=True, eq=False)
class Special:
    """A configuration that people ask about first.

    Attributes
    ----------
    name : str
        ``zero``, ``mid-range``, the name it has in the description, or ``given 1``.
    state : State
        All about it.
    near : Clearance or None
        How far the nearest family is; None where there is none with a real point.
    """

    name: str
    state: State
    near: Clearance | None


@dataclass(frozen=True, eq=False)
class Made:
    """When and by what a report was made.

    Attributes
    ----------
    when : str
        UTC.
    seconds : float
        What computing took.
    versions : mapping of str to str
        Programs and libraries.
    machine : str
        System and processor.
    """

    when: str
    seconds: float
    versions: Mapping[str, str]
    machine: str

    @staticmethod
    def since(started: float) -> Made:
        """Now; ``started`` is a value of ``time.monotonic``."""
        versions = {"pinsing": __version__, "Python": platform.python_version()}
        for library in _LIBRARIES:
            try:
                versions[library] = metadata.version(library)
            except metadata.PackageNotFoundError:
                continue
        return Made(
            _now(), time.monotonic() - started, versions, f"{sys.platform}, {platform.machine()}"
        )


@dataclass(frozen=True, eq=False)
class Content:
    """All that a report of an arm says.

    Attributes
    ----------
    arm : Arm
        The arm.
    info : ArmInfo
        Chain, limits, geometry.
    forms : ClosedForm
        Its families, with what became of the search for a certificate.
    poses : tuple of (Arm, State) or None
        For each family a configuration that shows it well, on the geometry on which it is
        singular; the first one of its page where the limits allow any.
    special : tuple of Special
        Configurations with verdicts.
    clearest : Suggestion or None
        The configuration of largest clearance that was found; None without families.
    """

    arm: Arm
    info: ArmInfo
    forms: ClosedForm
    poses: tuple[tuple[Arm, State] | None, ...]
    special: tuple[Special, ...]
    clearest: Suggestion | None


def gather(
    arm: Arm, forms: ClosedForm | None = None, poses: Mapping[str, Array] | None = None
) -> Content:
    """Compute what a report says.

    Parameters
    ----------
    arm : Arm
        The arm.
    forms : ClosedForm, optional
        Its families; found with a certificate where a second is enough for that by default.
    poses : mapping of str to (n,) array, optional
        More configurations to judge.
    """
    forms = closed_form(arm) if forms is None else forms
    clearest = _clearest(arm, forms)
    asked = {**special_poses(arm), **(poses or {})}
    if clearest is not None:
        asked["clearest found"] = clearest.q
    return Content(
        arm=arm,
        info=describe(arm),
        forms=forms,
        poses=tuple(_pose(arm, f, forms.families) for f in forms.families),
        special=tuple(Special(name, at(arm, q), _near(forms, q)) for name, q in asked.items()),
        clearest=clearest,
    )


def special_poses(arm: Arm) -> dict[str, Array]:
    """Zero, the middle of the limits, and what the description gives a name to."""
    lower, upper = arm.span
    ends = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    found = {"zero": np.zeros(arm.n), "mid-range": np.where(ends, (lower + upper) / 2, 0.0)}
    named = arm.source.full_model.referenceConfigurations
    for key in sorted(str(pair.key()) for pair in named):
        with contextlib.suppress(PinsingError):  # locked joints stand elsewhere in it
            found[key] = arm.q_of(np.array(named[key]))
    if np.array_equal(found["zero"], found["mid-range"]):
        found = {"zero, which is mid-range": found.pop("zero"), **found}
        del found["mid-range"]
    return found


def _clearest(arm: Arm, forms: ClosedForm) -> Suggestion | None:
    """Where to go: far from all families, if there are any that a configuration can be on."""
    if not any(f.real for f in forms.families):
        return None
    with contextlib.suppress(PinsingError):  # nothing clear within the limits
        return suggest(arm, forms=forms, seconds=2.0)
    return None


def _pose(arm: Arm, family: Family, families: tuple[Family, ...]) -> tuple[Arm, State] | None:
    """A telling configuration of a family, on the nominal geometry if the file's is rounded."""
    others = [f for f in families if f is not family and f.real]
    chosen = telling_poses(arm, family, 1, others) if family.real else ()
    q = chosen[0] if chosen else family.generic
    if q is None:
        return None
    rounded = family.raw_ratio is not None and family.raw_ratio > SINGULAR_RTOL
    shown = nominal(arm).arm if rounded else arm
    return shown, at(shown, q)


def _near(forms: ClosedForm, q: Array) -> Clearance | None:
    if not any(f.real for f in forms.families):
        return None
    return clearance(forms, q, certify=True, seconds=1.0)


def _now() -> str:
    """Now in UTC; SOURCE_DATE_EPOCH, of reproducible builds, says another time."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    stamp = int(given) if given.isdecimal() else time.time()
    return datetime.fromtimestamp(stamp, timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
