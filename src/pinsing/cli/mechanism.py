"""``--loops``: what ``analyze``, ``map``, ``families`` and ``view`` do with a mechanism."""

from __future__ import annotations

import dataclasses
import math
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pinsing.cli import STOPPED
from pinsing.cli.options import JointValues, in_degrees, loops_at_hand
from pinsing.cli.output import emit, emit_json, emit_lines, read_result, say, show_page
from pinsing.errors import ConfigurationError, OptionError, ResultError
from pinsing.prose import Page

if TYPE_CHECKING:
    from pinsing.families.solve import Prove
    from pinsing.loops import MechanismAnalysis
    from pinsing.loops.joint_loci import LegProof
    from pinsing.measures import Array
    from pinsing.robot.mechanism import Mechanism
    from pinsing.view.mechanism_viewer import MechanismViewer


def map_loops(
    mechanism: Mechanism,
    over: str | None = None,
    count: int | None = None,
    seed: int = 0,
    worst: int | None = None,
    ignore_limits: bool = False,
    deg: bool = False,
    json_target: str | Path | None = None,
    fail_if_singular: bool = False,
) -> int:
    """``map --loops``: how near to singular a mechanism is, over inputs or poses."""
    from pinsing.loops.map import map_text, mechanism_map

    if not ignore_limits:
        tell_of_limits(mechanism)
    number = 10_000 if count is None else count
    found = mechanism_map(
        mechanism, over or "inputs", number, seed, worst=worst or 5, ignore_limits=ignore_limits
    )
    if not emit_json(found, json_target):
        emit(map_text(found, Page.of(), deg))
    singular = sum(found.kinds[k] for k in ("type 1", "type 2", "type 3", "constraint"))
    return int(fail_if_singular and singular > 0)


def analyze_loops(
    mechanism: Mechanism,
    robot: str,
    json_target: str | Path | None = None,
    fail_if_singular: bool = False,
    deg: bool = False,
    ignore_limits: bool = False,
    all_joints: bool = False,
    seconds: float | None = None,
) -> int:
    """``analyze --loops``: modes, ranges, singular points and loci of a mechanism."""
    from pinsing.loops import analyze_mechanism
    from pinsing.loops.analysis import analysis_answer, analysis_text

    analysis = analyze_mechanism(mechanism, ignore_limits=ignore_limits, seconds=seconds)
    if not emit_json(analysis, json_target):
        sliding = [
            n for n, slides in zip(mechanism.joints, mechanism.prismatic, strict=True) if slides
        ]
        degrees = in_degrees(deg)
        emit_lines(analysis_answer(analysis, degrees, sliding, _named(mechanism, robot)))
        emit("\n" + analysis_text(analysis, Page.of(), degrees, sliding, all_joints or None))
    for check in analysis.checks:
        if not check.passed:
            say(f"WARNING: {check.words}")
    return STOPPED if analysis.missing else int(fail_if_singular and bool(analysis.points))


def families_loops(
    mechanism: Mechanism,
    robot: str,
    json_target: str | Path | None = None,
    fail_if_singular: bool = False,
    deg: bool = False,
    verbose: bool = False,
    exact: bool = False,
    prove: Prove = "auto",
    certificate: Path | None = None,
    system: Path | None = None,
    seconds: float | None = None,
) -> int:
    """``families --loops``: the loci as equations, over inputs or pose, and in all joint angles."""
    from pinsing.loops import joint_forms, loop_forms, pose_forms
    from pinsing.loops.analysis import forms_text
    from pinsing.loops.legs import why_no_rods

    OptionError.refuse_if(
        system is not None,
        "equations of a mechanism go to -o FILE.json only, all families together",
    )
    forms = loop_forms(mechanism)
    found = pose_forms(mechanism) if forms is None else forms
    joints = joint_forms(mechanism)
    tell_of_limits(mechanism)
    proven: tuple[LegProof, ...] = ()
    if prove is True or certificate is not None:
        from pinsing.loops.joint_loci import leg_proofs

        proven = leg_proofs(mechanism, **({} if seconds is None else {"seconds": seconds}))
    elif seconds is not None:
        say("note: with --loops --seconds bounds the proofs of the legs only (--prove)")
    if found is None and not joints.complete:
        say(
            f"{mechanism.name}: no closed form: no planar dyad closes the loops, and "
            f"{why_no_rods(mechanism)}; in the joint angles {'; '.join(joints.notes)}; analyze "
            "--loops finds singular points by numbers"
        )
        emit_json(joints, json_target)
        return 0
    whole = joints if found is None else dataclasses.replace(found, joint_forms=joints)
    if found is None:
        say(f"note: no closed forms over the pose: {why_no_rods(mechanism)}")
    if not emit_json(whole, json_target):
        named = _named(mechanism, robot)
        emit_lines(_loci_answer(mechanism, joints if found is None else found, named))
        if verbose or exact:
            emit("\n" + forms_text(mechanism.inputs, found, Page.of(), deg, exact, joints))
    if proven:
        _tell_legs(proven, certificate, json_target is None)
    architecture = getattr(found, "architecture", "")
    loci = joints.loci if found is None else found.loci
    return int(fail_if_singular and bool(loci or architecture))


def _loci_answer(mechanism: Mechanism, found: Any, robot: str) -> str:
    """Return what the loci mean, each once and without equations."""
    said = list(dict.fromkeys(f"{locus.kind}: {locus.words}" for locus in found.loci))
    word = "complete" if found.complete else "NOT complete"
    rows = [f"  {words}" for words in said[:5]]
    if len(said) > len(rows):
        rows.append(f"  and {len(said) - len(rows)} more")
    count = f"{len(said)} kind{'s' * (len(said) != 1)} of singular configurations ({word})"
    following = [f"  Next: pinsing view {robot}", f"        pinsing families {robot} -v"]
    return "\n".join([f"{mechanism.name}: {count}", "", *rows, *following])


def _named(mechanism: Mechanism, robot: str) -> str:
    """The mechanism as it is typed: its loops too, where they are not found beside it."""
    loops, beside = mechanism.loop_file, loops_at_hand(robot)
    same = loops is None or (beside is not None and beside.samefile(loops))
    return shlex.join([robot, *([] if same else ["--loops", str(loops)])])


def _tell_legs(found: Sequence[LegProof], certificate: Path | None, shown: bool) -> None:
    """The legs as arms, each with its certificate, and a file for each."""
    from pinsing.atomic_write import write_text
    from pinsing.families.certificate import text_of

    write = emit if shown else say
    write(
        "\nThe legs as arms, each by itself: type 1, and passive joints that move by themselves. "
        "Type 2 has\nno certificate: its equation is the rank condition of all legs together."
    )
    for leg in found:
        write(f"  {leg}")
    if certificate is None:
        return
    for leg in found:
        stem = certificate.name.removesuffix(".cert.json")
        path = certificate.with_name(f"{stem}_leg{leg.leg}.cert.json")
        if leg.form.certificate is None:
            reason = leg.form.proof.reason if leg.form.proof else "none was found"
            say(f"note: no certificate of leg {leg.leg}: {reason}")
            continue
        write_text(path, text_of(leg.form.certificate) + "\n")
        say(f"wrote {path}")


def view_loops(
    mechanism: Mechanism,
    poses: Sequence[JointValues] = (),
    analysis: Path | None = None,
    family: str | None = None,
    html: Path | None = None,
    png: Path | None = None,
    scale: float = 1.0,
    skeleton: bool = False,
    size: tuple[int, int] = (1200, 900),
    panel: bool = False,
    host: str = "127.0.0.1",
    port: int | None = None,
    no_open: bool = False,
) -> None:
    """Open or write a page in which inputs are dragged, or a picture (``panel``: of the page)."""
    inputs = typed_inputs(mechanism, poses)
    saved = None if analysis is None else _saved(analysis, mechanism)
    # What is typed and can still be refused is judged before a browser opens.
    late = bool(poses) or family is not None or not 0 < scale < math.inf

    def made(at: Callable[[str], None]) -> MechanismViewer:
        # Imports that the browser does not wait for.
        from pinsing.loops import analyze_mechanism
        from pinsing.view.mechanism_viewer import MechanismViewer

        at("finding the singular configurations")
        found = saved or analyze_mechanism(mechanism, inputs if poses else None)
        if found.missing:  # Ctrl-C
            raise KeyboardInterrupt
        at("preparing the page")
        viewer = MechanismViewer(mechanism, found, scale=scale, skeleton=skeleton)
        if poses:
            viewer.show_inputs(inputs)
        if family is not None:
            viewer.show_group(family)
        return viewer

    show_page(
        mechanism.name, made, html is None and png is None, late=late, html=html, png=png,
        size=size, panel=panel, host=host, port=port, no_open=no_open,
    )  # fmt: skip


def _saved(path: Path, mechanism: Mechanism) -> MechanismAnalysis:
    """Return what ``analyze --loops -o FILE.json`` wrote, of the same mechanism."""
    from pinsing.loops import MechanismAnalysis

    saved: MechanismAnalysis = read_result(path, MechanismAnalysis)
    ResultError.refuse_if(
        saved.joints != mechanism.joints or saved.inputs != mechanism.inputs,
        f"{path} is of {saved.name} with joints {', '.join(saved.joints)} driven by "
        f"{', '.join(saved.inputs)}, not of this mechanism",
    )
    return saved


def tell_of_limits(mechanism: Mechanism) -> None:
    """Say that home breaks limits where nothing else that is printed would."""
    from pinsing.loops.motion import home_outside

    if beyond := home_outside(mechanism):
        say(f"note: {beyond}")


def typed_inputs(mechanism: Mechanism, typed: Sequence[JointValues]) -> Array:
    """Inputs that were typed, or those of home."""
    import numpy as np

    from pinsing.loops import home

    if not typed:
        return home(mechanism)[list(mechanism.actuated)]
    OptionError.refuse_if(len(typed) > 1, "give --q once: the values of the actuated joints")
    values = np.array(typed[0].numbers)
    ConfigurationError.refuse_if(
        values.shape != (len(mechanism.inputs),),
        f"--q needs {len(mechanism.inputs)} values for the actuated joints "
        f"{', '.join(mechanism.inputs)}; got {len(values)}",
    )
    sliding = mechanism.prismatic[list(mechanism.actuated)]
    return np.where(sliding | (not typed[0].degrees), values, np.radians(values))
