"""Everything about a mechanism at once: modes, ranges, singular points, closed forms."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.mechanism.closure import ranks
from pinsing.mechanism.dyad import planar_dyad
from pinsing.mechanism.feasible import Interval, curves, intervals
from pinsing.mechanism.loci import LoopForms, loop_forms
from pinsing.mechanism.loci_roots import roots
from pinsing.mechanism.modes import home, mode_of
from pinsing.mechanism.motion import mechanism_at
from pinsing.mechanism.result import Check, MechanismAnalysis, Mode
from pinsing.mechanism.singular_points import SingularPoint, find_singular
from pinsing.mechanism.problems import assemblies
from pinsing.robot.load_mechanism import Mechanism

_AGREE = 1e-9


@checked
def analyze_mechanism(
    mechanism: Mechanism, inputs: npt.ArrayLike | None = None
) -> MechanismAnalysis:
    """Find the singular configurations of a mechanism and state them.

    Each input in turn moves over all the values at which the loops close, through every
    assembly mode, while the others stay at ``inputs``; what is singular there is refined. Where a
    dyad closes the loop, all loci follow in closed form, and each method checks the other.

    Parameters
    ----------
    mechanism : Mechanism
        From ``load_mechanism``.
    inputs : (n_a,) array_like, optional
        Values of the actuated joints, radians and metres; home by default.

    Returns
    -------
    MechanismAnalysis
        With ``str()``: all of it in words.

    Raises
    ------
    InfeasibleError
        If the loops do not close there; it says where they do.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.analyze_mechanism(pinsing.load_mechanism("four_bar"))
    >>> found.mobility, found.inputs, len(found.assemblies)
    (1, ('crank',), 2)
    """
    generic = ranks(mechanism)
    q = home(mechanism)
    at_home = q[list(mechanism.actuated)]
    asked = at_home if inputs is None else mechanism.check_inputs(inputs)
    closed = assemblies(mechanism, asked)
    if inputs is not None:
        q = closed[0].q
    ranges: dict[str, tuple[Interval, ...]] = {}
    points: list[SingularPoint] = []
    for k, name in enumerate(mechanism.inputs):
        found = curves(mechanism, asked, k)
        ranges[name] = intervals(mechanism, found, k)
        points += find_singular(mechanism, found)
    forms = loop_forms(mechanism)
    dyad = planar_dyad(mechanism)
    working: tuple[Mode, ...] = ()
    if dyad is not None:
        # The pin, which every way of reaching must share.
        reached = dyad.working_modes(dyad.point(q))
        working = tuple(Mode(mode_of(mechanism, x), x) for x in reached)
    return MechanismAnalysis(
        name=mechanism.name,
        source=mechanism.source.label,
        loop_file="" if mechanism.loop_file is None else str(mechanism.loop_file),
        joints=mechanism.joints,
        inputs=mechanism.inputs,
        loops=tuple(str(x) for x in mechanism.loops),
        output=mechanism.output,
        task=mechanism.task.name,
        length_scale=mechanism.length_scale,
        mobility=generic.mobility,
        constraint_rank=generic.constraint,
        constraint_rows=mechanism.rows,
        state=mechanism_at(mechanism, q),
        assemblies=closed,
        working=working,
        ranges=ranges,
        points=tuple(points),
        forms=forms,
        checks=tuple(_checks(mechanism, asked, tuple(points), forms)),
        notes=mechanism.notes,
    )


def _checks(
    mechanism: Mechanism, inputs: Array, points: tuple[SingularPoint, ...], forms: LoopForms | None
) -> list[Check]:
    if forms is None:
        return []
    known = {locus.kind for locus in forms.loci}
    judged = [p for p in points if p.kind in known or p.kind == "type 3"]
    worst = (
        max(
            (min(abs(float(x.equation(p.inputs))) / x.equation.size for x in forms.loci))
            for p in judged
        )
        if judged
        else 0.0
    )
    out = [
        Check(
            f"each of the {len(judged)} points of the sweep lies on a locus "
            f"(largest relative value {worst:.1e})",
            worst <= _AGREE,
        )
    ]
    missed, count = [], 0
    for k, name in enumerate(mechanism.inputs):
        here = [p for p in points if p.moving == name]
        for locus in forms.loci:
            for value in roots(locus.equation, inputs, k):
                at = inputs.copy()
                at[k] = value
                if not _feasible(mechanism, at):
                    continue
                count += 1
                near = [abs(float(np.sin((p.inputs[k] - value) / 2))) for p in here]
                if min(near, default=1.0) > _AGREE:
                    missed.append(f"{name} = {value:.9g} ({locus.kind})")
    words = f"the sweep found all {count} feasible roots of the loci along its curves"
    if missed:
        words = f"the sweep missed {len(missed)} of {count} roots: {', '.join(missed)}"
    return [*out, Check(words, not missed)]


def _feasible(mechanism: Mechanism, inputs: Array) -> bool:
    """Whether the rods reach each other, to rounding."""
    dyad = planar_dyad(mechanism)
    assert dyad is not None  # asked for only where there is one
    first, second = dyad.ends(inputs)
    gap = float(np.linalg.norm(second - first))
    d1, d2 = (side.rod_length for side in dyad.sides)
    return bool(abs(d1 - d2) - _AGREE <= gap <= d1 + d2 + _AGREE)
