"""Conditions on joint values, and the sets of singular configurations that a sweep finds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from pinsing.configuration.refine import SingularConfiguration
from pinsing.kinematics.verdict import SINGULAR_RTOL, Status
from pinsing.measures import Reachability
from pinsing.prose import Span, listed, unbroken, verdict
from pinsing.serialization import JsonResult, Written

_TURN = 2 * math.pi


@dataclass(frozen=True)
class JointCondition:
    """What forces a singularity, whatever the other joints.

    Attributes
    ----------
    fixed : mapping of str to float
        Joints held at one value each, radians or metres.
    related : tuple of str
        Joints bound by one or more equations in several angles; empty if the values alone say
        it all. The singular set then runs through these joints in a continuum.
    forced_by : mapping of str to float
        The smallest set of joint values that forces it at the configuration itself:
        ``fixed``, and the present values of ``related`` as far as they are needed.
    prismatic : tuple of str
        Which of the joints named here slide (metres).
    tested : int
        Random configurations tested.
    worst_ratio : float
        Greatest sigma_r / sigma_1 among them.
    """

    fixed: Mapping[str, float]
    related: tuple[str, ...]
    forced_by: Mapping[str, float]
    prismatic: tuple[str, ...]
    tested: int
    worst_ratio: float

    @property
    def minimal(self) -> bool:
        """True if joint values alone force it, and none of them can be left out."""
        return not self.related

    @property
    def depends_on(self) -> tuple[str, ...]:
        """All joints that the condition speaks of."""
        return (*self.fixed, *self.related)

    def same_as(self, other: JointCondition, tol: float = 1e-5) -> bool:
        """True if both say the same: values agree to ``tol``, whole turns aside."""
        if self.related != other.related or set(self.fixed) != set(other.fixed):
            return False
        return all(self.distance(name, x) <= tol for name, x in other.fixed.items())

    def distance(self, joint: str, value: float) -> float:
        """How far ``value`` is from the one that ``joint`` is fixed at, whole turns aside."""
        difference = value - self.fixed[joint]
        return abs(difference if joint in self.prismatic else math.remainder(difference, _TURN))

    def __str__(self) -> str:
        parts = [
            f"{name} = {value_text(value, name in self.prismatic)}"
            for name, value in self.fixed.items()
        ]
        if self.related:
            parts.append(f"a relation between {listed(self.related)}")
        return " and ".join(parts) if parts else "every configuration"


def value_text(value: float, prismatic: bool = False) -> str:
    """A joint value in degrees or metres, special angles short: ``0``, ``-90 deg``, ``0.1 m``."""
    if value == 0:
        return "0"
    if prismatic:
        return f"{value:.6g} m"
    degrees = math.degrees(value)
    if abs(degrees - round(degrees)) < 1e-9:
        return f"{round(degrees)} deg"
    return f"{degrees:.4f} deg ({value:.6f} rad)"


def tidy(value: float, prismatic: bool) -> float:
    """Value without whole turns, in (-pi, pi]; special angles exactly there."""
    if prismatic:
        return value + 0.0
    turned = math.remainder(value, _TURN)
    quarters = round(turned / (math.pi / 2))
    if abs(turned - quarters * math.pi / 2) < 1e-14:
        turned = (quarters if quarters > -2 else 2) * math.pi / 2
    return turned + 0.0


@dataclass(frozen=True, eq=False)
class Finding(JsonResult):
    """A set of singular (or near-singular) configurations that a sweep has found.

    Attributes
    ----------
    status : str
        ``singular`` or ``near-singular``.
    condition : JointCondition
        What forces it, whatever the other joints.
    configuration : SingularConfiguration
        A representative, on the nominal geometry; within the limits if one was found.
    raw_ratio : float
        sigma_r / sigma_1 of the representative on the raw geometry.
    reachability : Reachability
        Whether one exists within the limits (then the representative does), does not (a fixed
        value is outside), or none was found. JSON has it as ``reachable``: true, false or null.
    seen : int
        Number of dips, and of curves that are singular all along, that led here.
    curves : tuple of int
        Numbers of those curves in the plan: where all are kept, indices of the curves of the
        result.
    zeros : tuple of (int, float)
        Curve, and value of its moving joint at which it is zero itself: there only that joint
        had to move from where the dip was sampled.
    """

    schema: ClassVar[str] = "pinsing/finding/1"
    made_by: ClassVar[str] = "pinsing.singular_configurations(arm, result)"

    status: Status
    condition: JointCondition
    configuration: SingularConfiguration
    raw_ratio: float
    reachability: Reachability = field(
        metadata={"json": Written("reachable", lambda r: r.known, Reachability.of, bool | None)}
    )
    seen: int
    curves: tuple[int, ...]
    zeros: tuple[tuple[int, float], ...] = ()

    @property
    def reachable(self) -> bool | None:
        """True, False (proven), or None if no configuration within the limits was found."""
        return self.reachability.known

    def __str__(self) -> str:
        return "".join(x if isinstance(x, str) else x.text for x in finding_spans(self)).replace(
            "\u00a0", " "
        )


def finding_spans(finding: Finding) -> tuple[Span, ...]:
    """What was found, with its verdict."""
    condition = f"{finding.condition}, whatever the others"
    reach = {True: "", False: ", outside the limits", None: ", none found within the limits"}
    where = reach[finding.reachable]
    if finding.status != "singular":
        ratio = unbroken(f"sigma_r/sigma_1 = {finding.configuration.sigma_ratio:.1e}")
        return f"{condition}: ", verdict(finding.status), f", {ratio}{where}"
    kind = finding.configuration.kind
    said = f" ({kind})" if kind != "undecided" else ""
    raw = ""
    if finding.raw_ratio > SINGULAR_RTOL:
        raw = f"; on the file as it is the ratio is {finding.raw_ratio:.1e}"
    return (f"{condition}{said}{where}{raw}",)
