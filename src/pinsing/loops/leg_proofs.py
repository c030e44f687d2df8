"""Certificates for the legs of a mechanism, each as a serial chain from the base to its end.

Where a leg passes forces through its end, an actuator that does no work on any of them (type 1), or
passive joints that are dependent by themselves, mean that the velocities of the end by the leg's
joints are dependent: the leg is singular as an arm, and there alone. That is a question about one
Jacobian, which `pinsing.proof.checker` answers. Type 2 is about several chains and their closure:
its equation is the rank condition itself, taken apart nowhere, and has no certificate.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.errors import OptionError
from pinsing.families import ClosedForm, closed_form, prove
from pinsing.loops.leg_wrenches import (
    PLANE,
    SPHERE,
    AtZero,
    NotThisKind,
    leg_ends,
    room_of,
)
from pinsing.loops.structure import structure
from pinsing.robot.load import load
from pinsing.robot.mechanism import Mechanism

_SMALL = 1e-9
_SYMBOL = re.compile(r"\b[qd](\d+)\b")
_ROWS = ("vx", "vy", "vz")


@dataclass(frozen=True, eq=False)
class LegProof:
    """One leg as an arm.

    Attributes
    ----------
    leg : int
        Its number, from 1: that of the tree first.
    joints : tuple of str
        From the base outwards.
    task : str
        Rows of the velocity of its end.
    form : ClosedForm
        Its families; with a certificate where one was found.
    """

    leg: int
    joints: tuple[str, ...]
    task: str
    form: ClosedForm

    def __str__(self) -> str:
        parts = [
            _SYMBOL.sub(lambda m: self.joints[int(m[1]) - 1], f.text) for f in self.form.families
        ]
        where = f"if and only if {' or '.join(parts)}" if parts else "nowhere"
        return (
            f"leg {self.leg}: {', '.join(self.joints)} up to its end ({self.task}) singular "
            f"{where}: {self.form.word}"
        )


def leg_proofs(mechanism: Mechanism, seconds: float = 20.0) -> tuple[LegProof, ...]:
    """Closed forms of the legs as arms, with certificates.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``.
    seconds : float
        Time for the search of each leg's certificate.

    Returns
    -------
    tuple of LegProof
        One for each leg with one actuator.

    Raises
    ------
    OptionError
        If no leg ends in a ball, a pin or a hinge at the output.
    """
    try:
        ends = leg_ends(mechanism)
    except NotThisKind as why:
        raise OptionError(f"{mechanism.name}: no leg has a certificate of its own: {why}") from None
    out = tuple(_proofs(mechanism, ends, seconds))
    if not out:
        raise OptionError(
            f"{mechanism.name}: no leg has a certificate of its own: none has one actuator and "
            "ends in a ball, a pin or a hinge at the output"
        )
    return out


def _proofs(
    mechanism: Mechanism, ends: list[tuple[list[int], Array | None]], seconds: float
) -> Iterator[LegProof]:
    kind, turn, centre = room_of(mechanism)
    zero = AtZero(mechanism, structure(mechanism))
    task = "position"
    if kind == PLANE:
        normal = np.abs([float(v) for v in turn[2]])
        if normal.max() >= 1 - _SMALL:
            task = ",".join(r for k, r in enumerate(_ROWS) if k != int(np.argmax(normal)))
    for number, (path, place) in enumerate(ends, 1):
        joints, end = path, place
        if kind == SPHERE and end is None:
            joints, end = path[:-1], centre + zero.axes[path[-1]]
        driven = [j for j in joints if j in mechanism.actuated]
        if end is None or len(driven) != 1:
            continue
        model = pin.Model(mechanism.model)
        body = joints[-1] + 1
        name = f"end of leg {number}"
        place_there = pin.SE3(np.eye(3), np.array(zero.joints[body].actInv(end)))
        model.addFrame(pin.Frame(name, body, 0, place_there, pin.FrameType.OP_FRAME))
        names = tuple(mechanism.joints[j] for j in joints)
        arm = load(model, tip=name, joints=names, task=task)
        form = prove(closed_form(arm, prove=False), seconds)
        yield LegProof(number, names, task, form)
