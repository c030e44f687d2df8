"""Everything about a mechanism at once: modes, ranges, singular points, closed forms."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.arguments import checked
from pinsing.errors import OptionError
from pinsing.loops.closure import Ranks, ranks
from pinsing.loops.forms import PoseForms
from pinsing.loops.joint_loci import joint_forms
from pinsing.loops.legs import why_no_rods
from pinsing.loops.loop_forms import LoopForms, loop_forms, planar_dyad, roots
from pinsing.loops.modes import home, home_error, home_outside
from pinsing.loops.motion import mechanism_at, motions
from pinsing.loops.pose import pose_of
from pinsing.loops.pose_loci import locus_distance, pose_forms
from pinsing.loops.problems import Modes, assembly_modes, working_modes
from pinsing.loops.result import FORMS, Check, MechanismAnalysis
from pinsing.loops.singular_points import SingularPoint, Trace, find_singular
from pinsing.loops.solve import MOST_CURVES, InfeasibleError, Interval, curves, feasible, intervals
from pinsing.loops.structure import output_pose, without_length
from pinsing.robot.mechanism import Mechanism
from pinsing.sampling.execute import Stages

_AGREE = 1e-9


@checked
def analyze_mechanism(
    mechanism: Mechanism,
    inputs: npt.ArrayLike | None = None,
    *,
    ignore_limits: bool = False,
    seconds: float | None = None,
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
    ignore_limits : bool
        Let all joints, active and passive, go beyond their limits.
    seconds : float, optional
        Time for all of it; as long as it takes if not given. Assembly modes are always counted,
        and what has begun of modes and closed forms is brought to its end; the curves of the
        inputs come last. What there is when the time is up, or at Ctrl-C after the assembly
        modes, is returned, and ``missing`` says what is not.

    Returns
    -------
    MechanismAnalysis
        With ``str()``: all of it in words.

    Raises
    ------
    InfeasibleError
        If the loops do not close there; it says where they do.
    OptionError
        If fewer joints are actuated than there are degrees of freedom, or ``seconds`` is no
        positive number.

    Examples
    --------
    >>> import pinsing
    >>> found = pinsing.loops.analyze_mechanism(pinsing.load_mechanism("four_bar"))
    >>> found.mobility, found.inputs, len(found.assemblies)
    (1, ('crank',), 2)
    """
    if seconds is not None and not seconds > 0:
        raise OptionError(f"seconds must be positive, got {seconds:g}")
    if ignore_limits:
        mechanism = mechanism.without_limits()
    stages = Stages(seconds)
    generic = ranks(mechanism)
    q = home(mechanism)
    at_home = q[list(mechanism.actuated)]
    asked = at_home if inputs is None else mechanism.check_inputs(inputs)
    direct = assembly_modes(mechanism, inputs if inputs is None else asked)
    if not direct.modes:
        if inputs is None and home_outside(mechanism):
            raise home_error(mechanism)
        raise InfeasibleError(mechanism, asked, feasible(mechanism, asked), direct.beyond)
    if inputs is not None:
        q = direct.modes[0].q
    notes = [*mechanism.notes, *_notes(mechanism, generic)]
    inverse = stages.run("working modes", lambda: _inverse(mechanism, generic, q), None, True)
    poses = stages.run(f"{FORMS}pose", lambda: pose_forms(mechanism), None, True)
    forms = stages.run(f"{FORMS}inputs", lambda: loop_forms(mechanism), None, True)
    joints = stages.run(
        "closed forms in the joint angles", lambda: joint_forms(mechanism), None, True
    )
    fixed = poses is None or not poses.architecture
    moved = independent_inputs(mechanism, generic, q)
    ranges: dict[str, tuple[Interval, ...]] = {}
    points: list[SingularPoint] = []
    at = asked if moved is mechanism else q[list(moved.actuated)]
    swept = []
    for k, name in enumerate(moved.inputs if fixed else ()):
        before = len(stages.missing)
        along = stages.run(
            f"curves of {name}, its range and singular points",
            functools.partial(_along, mechanism, moved, at, k, stages),
            None,
        )
        if along is not None:
            found, covered, here = along
            points += here
            if found:
                ranges[name] = covered
            if len(found) == MOST_CURVES:
                notes.append(f"of the curves of {name} {MOST_CURVES} were followed; there are more")
        if len(stages.missing) == before:
            swept.append(name)
    if not fixed:
        notes.append("every pose is of type 2: ranges and points along the inputs are left out")
    return MechanismAnalysis(
        name=mechanism.name,
        source=mechanism.source.label.encode("utf-8", "backslashreplace").decode(),
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
        assemblies=direct.modes,
        direct=direct.statement,
        working=() if inverse is None else inverse.modes,
        inverse="" if inverse is None else inverse.statement,
        ranges=ranges,
        points=tuple(points),
        forms=forms,
        pose_forms=poses,
        checks=(
            *_checks(mechanism, asked, tuple(points), forms, swept),
            *_pose_checks(mechanism, poses, tuple(points)),
        ),
        notes=tuple(notes),
        joint_forms=joints,
        missing=tuple(stages.missing),
        why_none="" if poses is not None else why_no_rods(mechanism),
    )


def _along(
    mechanism: Mechanism, moved: Mechanism, inputs: Array, moving: int, stages: Stages
) -> tuple[tuple[Trace, ...], tuple[Interval, ...], tuple[SingularPoint, ...]]:
    """The curves of one input, its range, and what is singular along them."""
    found = curves(moved, inputs, moving, over=lambda: stages.over)
    points = find_singular(mechanism, _measured(mechanism, moved, found), over=lambda: stages.over)
    return found, intervals(moved, found, moving), points


def _inverse(mechanism: Mechanism, generic: Ranks, q: Array) -> Modes | None:
    """Working modes at the pose of q; None where a pose leaves a freedom open."""
    if generic.output < generic.mobility:
        return None
    return working_modes(mechanism, output_pose(mechanism, q).homogeneous)


def _notes(mechanism: Mechanism, generic: Ranks) -> list[str]:
    out = []
    count = len(mechanism.actuated)
    if count > generic.mobility:
        out.append(
            f"redundantly actuated: {count} actuators for {generic.mobility} degrees of freedom; "
            "type 2 means that the output moves with all of them held. They are moved as far as "
            "they are independent, and the others follow"
        )
    return [*out, *filter(None, (without_length(mechanism), home_outside(mechanism)))]


def independent_inputs(mechanism: Mechanism, generic: Ranks, q: Array) -> Mechanism:
    """The mechanism driven by as many inputs as it has freedoms; itself where it is."""
    if len(mechanism.actuated) == generic.mobility:
        return mechanism
    inputs = motions(mechanism, q).inputs
    chosen: list[int] = []
    for k in range(len(inputs)):
        if len(chosen) < generic.mobility:
            sigma = np.linalg.svd(inputs[[*chosen, k]], compute_uv=False)
            if sigma[len(chosen)] > _AGREE:
                chosen.append(k)
    return mechanism.with_actuated([mechanism.inputs[k] for k in chosen])


def _measured(
    mechanism: Mechanism, moved: Mechanism, found: tuple[Trace, ...]
) -> tuple[Trace, ...]:
    """Curves with the measures that all actuators together give."""
    if moved is mechanism:
        return found
    return tuple(
        replace(
            t,
            input_ratio=np.array([motions(mechanism, q).input_ratio for q in t.q]),
            moving=mechanism.actuated.index(moved.actuated[t.moving]),
        )
        for t in found
    )


def _checks(
    mechanism: Mechanism,
    inputs: Array,
    points: tuple[SingularPoint, ...],
    forms: LoopForms | None,
    swept: Sequence[str],
) -> list[Check]:
    """Points against loci, and roots of the loci against the inputs ``swept`` to the end."""
    dyad = planar_dyad(mechanism)
    if forms is None or dyad is None:
        return []
    known = {locus.kind for locus in forms.loci}
    # Of a curve that is singular throughout no equation over the inputs tells; the notes do.
    judged = [p for p in points if (p.kind in known or p.kind == "type 3") and not p.whole_curve]
    # Of nothing, nothing is said.
    out = []
    if judged:
        worst = max(
            min(abs(float(x.equation(p.inputs))) / x.equation.size for x in forms.loci)
            for p in judged
        )
        words = f"{_lie(judged)} on a locus (largest relative value {worst:.1e})"
        out.append(Check(words, worst <= _AGREE))
    missed, count = [], 0
    for k, name in enumerate(mechanism.inputs):
        if name not in swept:
            continue
        here = [p for p in points if p.moving == name]
        for locus in forms.loci:
            for value in roots(locus.equation, inputs, k):
                at = np.where(np.arange(len(inputs)) == k, value, inputs)
                if dyad.excess(at) > _AGREE:
                    continue
                count += 1
                if all(abs(np.sin((p.inputs[k] - value) / 2)) > _AGREE for p in here):
                    missed.append(f"{name} = {value:.9g} ({locus.kind})")
    if not count:
        return out
    words = f"the sweep found all {count} feasible roots of the loci along its curves"
    if missed:
        words = f"the sweep missed {len(missed)} of {count} roots: {', '.join(missed)}"
    return [*out, Check(words, not missed)]


def _pose_checks(
    mechanism: Mechanism, forms: PoseForms | None, points: tuple[SingularPoint, ...]
) -> list[Check]:
    """The numbers against the loci over the pose, at each point of the sweep."""
    if forms is None or not forms.loci:
        return []
    if "z" in forms.variables and "e0" not in forms.variables:
        # The equations are of the mode in which the output is not turned.
        points = tuple(
            p for p in points if pose_of(output_pose(mechanism, p.q)).quaternion[0] > 1 - _AGREE
        )
    if not any(locus.kind == "type 1" for locus in forms.loci):
        # What else is of type 1 the notes say.
        points = tuple(p for p in points if p.kind != "type 1")
    # Of passive joints that are dependent by themselves the pose does not tell.
    own = joint_forms(mechanism)
    alone = [x for x in own.loci if x.kind == "passive"]
    points = tuple(
        p for p in points if all(float(x.ratio(p.q, own.joints)) > _AGREE for x in alone)
    )
    if not points:
        return []
    worst = max(float(locus_distance(mechanism, forms, p.q)) for p in points)
    regular = locus_distance(mechanism, forms, home(mechanism))
    words = (
        f"{_lie(points)} on a locus over the pose (largest relative value {worst:.1e}; "
        f"{regular:.1e} at home)"
    )
    return [Check(words, worst <= 1e-7)]


def _lie(points: Sequence[SingularPoint]) -> str:
    which = "the one point" if len(points) == 1 else f"each of the {len(points)} points"
    return f"{which} of the sweep lies"
