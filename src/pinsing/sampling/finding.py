"""What a sweep leads to: a set of singular configurations, stated, and its line of text."""

from __future__ import annotations

from dataclasses import field
from typing import ClassVar

from pinsing._dataclass import dataclass
from pinsing.configuration.refine import SingularConfiguration
from pinsing.kinematics.verdict import SINGULAR_RTOL, Status
from pinsing.measures import Reachability
from pinsing.prose import Span, unbroken, verdict
from pinsing.sampling.joint_condition import JointCondition
from pinsing.serialization import JsonResult, Written


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
