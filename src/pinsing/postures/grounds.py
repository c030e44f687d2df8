"""What the answer that an arm is cuspidal stands on, and whether a motor could tell."""

from __future__ import annotations

from pinsing.families import ClosedForm, closed_form
from pinsing.geometry.nominal import nominal
from pinsing.postures.ladder import ladder_of
from pinsing.robot.arm import Arm

PRACTICAL = 1e-5
"""sigma_r / sigma_1 under which no motor tells a configuration from a singular one."""

_TINY = 1e-6
"""Lengths, in length scales, that rounding makes: no arm is built that exactly."""


def certified(arm: Arm, form: ClosedForm) -> bool:
    """Whether a closed form is proven to be complete, by a certificate that is made if need be."""
    if not form.complete:
        return False
    proof = form.proof if form.proof is not None else closed_form(arm, prove=True).proof
    return proof is not None and proof.accepted


def nearly(arm: Arm, least: float) -> list[str]:
    """Say that a way is singular for all that a motor can tell, and what tiny lengths do."""
    if not least < PRACTICAL:
        return []
    small = _TINY * arm.length_scale
    ladder = ladder_of(nominal(arm, snap_length=small))
    if ladder is None:
        found = "what the arm is without its tiny lengths is not known"
    else:
        found = f"with lengths under {small:.1g} m as zero the arm is not cuspidal: {ladder.reason}"
    return [f"the way is practically singular, sigma_r/sigma_1 falls to {least:.1e}; {found}"]
