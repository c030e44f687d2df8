"""What answers about aspects stand on, and whether a motor could tell."""

from __future__ import annotations

import numpy as np

from pinsing._types import Array
from pinsing.families import ClosedForm
from pinsing.postures.ladder import ladder_of
from pinsing.postures.newton import columns, regular_way
from pinsing.proximity.watched import Forms
from pinsing.robot.arm import Arm
from pinsing.robot.nominal import nominal

PRACTICAL = 1e-5
"""sigma_r / sigma_1 under which no motor tells a configuration from a singular one."""

_PIECES = (2_000, 20_000)

_CLEAR = 1e-9
"""sigma_r / sigma_1 above which a determinant has a sign that rounding does not make."""


PROVEN, PROBABLE, NOT_COMPLETE = "proven", "probable", "not complete"


def sureness(forms: Forms) -> str:
    """Return how sure it is that no family is missing: of several forms the least sure."""
    words = [form.word for form in _each(forms)]
    return next((w for w in (NOT_COMPLETE, PROBABLE) if w in words), PROVEN)


def missing(forms: Forms) -> list[str]:
    """Return the doubts about completeness, in sentences; empty where there are none."""
    gaps = [g for form in _each(forms) if not form.complete for g in form.gaps[:1]]
    if sureness(forms) == NOT_COMPLETE:
        because = f" ({gaps[0]})" if gaps else ""
        return [f"the closed form is not complete{because}: a family that is missing may cut more"]
    tried = [form.proof for form in _each(forms) if form.proof and not form.proof.accepted]
    if tried:
        return [f"that no family is missing is probable: no certificate ({tried[0].reason})"]
    if sureness(forms) == PROBABLE:
        return ["that no family is missing is probable: no certificate was looked for"]
    return []


def of_design(forms: Forms) -> list[str]:
    """Return what is to be said where the families are of a robot's design; empty elsewhere."""
    if all(form.tube is None for form in _each(forms)):
        return []
    return ["aspects are of the design: where two walls meet this robot may pass between them"]


def proven_regular(forms: Forms, path: Array) -> bool:
    """Return True if the rank along a path is proven from the Jacobian, for each form's task.

    Where the families are probably all it is no more than a second proof, and given up early.
    """
    most = _PIECES[sureness(forms) == NOT_COMPLETE]
    arms = [form.loaded for form in _each(forms)]
    return all(arm and arm.coupling is None and regular_way(arm, path, most) for arm in arms)


def opposite(forms: Forms, a: Array, b: Array) -> bool:
    """Return True if a square Jacobian has determinants of opposite signs at two configurations.

    Its sign changes only where it is singular. No closed form is needed for that.
    """
    for form in _each(forms):
        arm = None if form.geometry is None else form.geometry.arm
        if arm is None or arm.coupling is not None or len(arm.task.rows) != arm.n:
            continue
        J = columns(arm, np.stack([a, b]))
        sizes = np.linalg.svd(J, compute_uv=False)
        if (sizes[:, -1] > _CLEAR * sizes[:, 0]).all() and np.prod(np.linalg.det(J)) < 0:
            return True
    return False


def _each(forms: Forms) -> list[ClosedForm]:
    return [forms] if isinstance(forms, ClosedForm) else list(forms)


def nearly(arm: Arm, least: float) -> list[str]:
    """Say that a way is singular for all that a motor can tell, and what tiny lengths do."""
    if not least < PRACTICAL:
        return []
    # Lengths, in length scales, that rounding makes: no arm is built that exactly.
    small = 1e-6 * arm.length_scale
    ladder = ladder_of(nominal(arm, snap_length=small))
    if ladder is None:
        found = "what the arm is without its tiny lengths is not known"
    else:
        found = f"with lengths under {small:.1g} m as zero the arm is not cuspidal: {ladder.reason}"
    return [f"the path is practically singular, sigma_r/sigma_1 falls to {least:.1e}; {found}"]
