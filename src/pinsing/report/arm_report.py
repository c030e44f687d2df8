"""What pinsing makes of an arm before it analyses anything, and its report as one HTML text."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from pinsing.algebra.equation import symbol_text
from pinsing.atomic_write import check_writable, write_bytes, write_text
from pinsing.errors import OptionError, OutputError, PinsingError
from pinsing.families import ClosedForm, Family, closed_form
from pinsing.families.certificate import text_of
from pinsing.families.describe import ORDER, missing_everywhere, telling_poses
from pinsing.families.form import PLACE, coverage_words
from pinsing.interface import JsonResult, checked, typed
from pinsing.kinematics.at import SINGULAR, State, at
from pinsing.kinematics.jacobian import SINGULAR_RTOL, engine_name, generic_rank, ratios
from pinsing.measures import ROUNDING, Array, ArrayLike, Bool, Reachability
from pinsing.prose import PLAIN, Page, Table, escaped as text
from pinsing.proximity.clearance import Clearance, Suggestion, clearance, suggest
from pinsing.proximity.trajectory import (
    TrajectoryCheck,
    check_trajectory,
    details,
    summary as said_of,
)
from pinsing.proximity.zones import Zones, require_zones_of
from pinsing.report.document import (
    Section,
    badge,
    bullets,
    counted,
    document,
    download,
    figure,
    limit_text,
    map_picture,
    map_planes,
    math as formula,
    name,
    paragraph,
    png,
    pose_pictures,
    quiet_backend,
    section,
    table,
    terms,
    workspace_pictures,
)
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.mechanism import Mechanism
from pinsing.robot.nominal import (
    AxisDifference,
    Snap,
    assumptions,
    design_of,
    deviation_of,
    differences,
    flatten,
    jacobian_change,
    nominal,
)
from pinsing.robot.second_reader import SecondReading

_SECONDS = 2.0
"""Time for the closed form; where it needs more, the command that takes it is named."""


@dataclass(frozen=True, eq=False)
class SingularPose:
    """A pose that people begin with and that is singular."""

    name: str  # "zero", "neutral" (zero, moved into the limits) or the model's
    q: Array  # (n,), radians and metres
    within_limits: bool
    families: tuple[str, ...]  # those that it is on, if found in short time
    instead: Array | None  # (n,), a clear configuration near it, unless that would take long
    clearance: float  # proven, of ``instead``; 0 without it

    def text(
        self, robot: str, prismatic: Bool, degrees: bool = False, room: int | None = None
    ) -> str:
        """One line: what is singular, and a configuration to paste or the command for one."""
        outside = "" if self.within_limits else ", which is outside the limits,"
        on = f" (on {', '.join(self.families)})" if self.families else ""
        said = f"the {self.name} pose{outside} is singular{on}"
        if self.instead is None:
            return f"{said}; pinsing at --suggest {robot} finds one that is not"
        far = f"{np.floor(np.degrees(self.clearance) * 100) / 100:g}°"
        pose = typed(self.instead, prismatic, degrees, digits=8, room=room)
        return (
            f"{said}; the next is near it, {far} or more from every singular one (proven): {pose}"
        )


def singular_poses(arm: Arm) -> tuple[SingularPose, ...]:
    """Zero, neutral and named poses of an arm that are singular."""
    exact = nominal(arm).arm
    named: list[tuple[str, Array]] = []
    for key, q in (("zero", np.zeros(arm.n)), *_named_poses(arm, neutral=arm.source.reference)):
        known = any(np.array_equal(q, other) for _, other in named)
        if not known and min(float(ratios(a, q)[0]) for a in (exact, arm)) <= SINGULAR_RTOL:
            named.append((key, q))
    if not named:
        return ()
    form = closed_form(arm, seconds=_SECONDS, prove=False)
    out = []
    for key, q in named:
        instead, far = None, 0.0
        if form.complete and form.families:
            with contextlib.suppress(PinsingError):  # too far outside the limits
                found = suggest(arm, near=q, forms=form, work=1.5)
                if found.lower > 0:
                    instead, far = found.q, found.lower
        on = tuple(f.name for f in form.families if f.real and bool(f.contains(q)))
        out.append(SingularPose(key, q, bool(arm.within_limits(q)), on, instead, far))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class ArmInfo(JsonResult):
    """An arm, its generic rank, and how exact its geometry is.

    Attributes
    ----------
    arm : ArmSummary
        Chain, joints, limits, tip, base, task, length scale, notes.
    kinds : tuple of str
        ``revolute``, ``continuous`` or ``prismatic``, one a joint.
    file : str
        The description file; empty for a model in memory.
    generic_rank : int
        Rank of the task Jacobian at almost every configuration.
    task_rows : int
        Rows of the task.
    snaps : tuple of Snap
        Numbers that the nominal geometry moves.
    jacobian_change : float
        Bound of what that changes in any column of the scaled task Jacobian.
    engine : str
        What computes batches of Jacobians for this arm on this machine.
    singular_poses : tuple of SingularPose
        Zero, neutral and named poses that are singular, each with a clear one near it.
    assumed : tuple of AxisDifference
        How far each axis is from that of the design that families are of; empty without one.
    second_reading : SecondReading or None
        What yourdfpy reads in the same URDF; None where it was not asked, or the arm is from none.
    """

    schema: ClassVar[str] = "pinsing/info/2"

    arm: ArmSummary
    kinds: tuple[str, ...]
    file: str
    generic_rank: int
    task_rows: int
    snaps: tuple[Snap, ...]
    jacobian_change: float
    engine: str
    singular_poses: tuple[SingularPose, ...]
    assumed: tuple[AxisDifference, ...] = field(default=(), metadata={"optional": True})
    second_reading: SecondReading | None = field(default=None, metadata={"optional": True})

    def head(self, page: Page = PLAIN) -> str:
        """Lines above the table of joints."""
        arm = self.arm
        rank = f"{self.generic_rank} ({arm.n} joints, {self.task_rows} task rows)"
        if self.generic_rank < min(arm.n, self.task_rows):
            rank += "; the joints are never independent in this task"
        elif arm.n > self.generic_rank:
            rank += f"; redundant by {arm.n - self.generic_rank}"
        rows = [
            ("robot", arm.name),
            ("file", replace(arm, source=self.file).described),
            ("base", arm.base),
            ("tip", arm.tip),
            ("task", arm.task),
            ("length scale", f"{arm.length_scale:g} m"),
            ("generic rank", rank),
            ("geometry", self.geometry()),
            ("engine", self.engine),
            ("second reader", str(self.second_reading or "")),
        ]
        return page.fields([row for row in rows if row[1]])

    def geometry(self) -> str:
        """One sentence on raw and nominal geometry, or on the design that is assumed."""
        if self.assumed:
            return f"families are of {deviation_of(self.assumed)}; {assumptions(self.assumed)}"
        if not any(snap.size > 1e-12 for snap in self.snaps):
            return "exact: every number of the file is taken as it is"
        sizes = {
            what: [snap.size for snap in self.snaps if snap.what == what]
            for what in ("angle", "length", "twist")
        }
        said = [
            f"{len(each)} {what}{'s' if len(each) > 1 else ''} "
            f"(at most {max(each):.1e} {'m' if what == 'length' else 'rad'})"
            for what, each in sizes.items()
            if each
        ]
        return (
            f"rounded in the file; made exact for closed forms by moving {', '.join(said)}; "
            f"this changes no Jacobian column by more than {self.jacobian_change:.1e}"
        )

    def joints(self, degrees: bool = False) -> Table:
        """Table of the joints."""
        arm = self.arm
        rows = []
        for i, joint in enumerate(arm.joints):
            slides = bool(arm.prismatic[i])
            unit = "m" if slides else "deg" if degrees else "rad"
            factor = 180 / np.pi if degrees and not slides else 1.0
            low, high = (
                f"{limit * factor:.6g}" if np.isfinite(limit) else "none"
                for limit in (arm.lower[i], arm.upper[i])
            )
            rows.append((str(i + 1), joint, self.kinds[i], low, high, unit))
        header = ("#", "joint", "type", "lower", "upper", "unit")
        return Table(header, tuple(rows), frozenset({0, 3, 4}))

    def poses(self, degrees: bool = False, room: int | None = None) -> list[str]:
        """A line for each pose that people begin with and that is singular."""
        arm = self.arm
        return [p.text(arm.source, arm.prismatic, degrees, room) for p in self.singular_poses]

    def __str__(self) -> str:
        return f"{self.head()}\n\n{PLAIN.table(self.joints())}"


def describe(arm: Arm) -> ArmInfo:
    """Gather what `ArmInfo` holds; among its notes are meshes that are not there."""
    exact = nominal(arm)
    made = arm if arm.design is None else design_of(arm, arm.design)
    off = made is not arm and jacobian_change(flatten(arm), flatten(made), arm) > ROUNDING
    # Without any limit a turning joint is continuous, as a URDF would call it.
    free = ~(np.isfinite(arm.lower) | np.isfinite(arm.upper))
    kinds = np.where(arm.prismatic, "prismatic", np.where(free, "continuous", "revolute"))
    return ArmInfo(
        arm=replace(summarize(arm), notes=(*arm.notes, *arm.source.mesh_notes)),
        kinds=tuple(str(k) for k in kinds),
        file="" if arm.source.path is None else str(arm.source.path),
        generic_rank=generic_rank(arm),
        task_rows=len(arm.task.rows),
        snaps=exact.snaps,
        jacobian_change=exact.jacobian_change,
        engine=engine_name(arm),
        singular_poses=singular_poses(arm),
        assumed=differences(arm, made) if off else (),
    )


def _named_poses(arm: Arm, **more: Array) -> Iterator[tuple[str, Array]]:
    """Configurations of the whole robot: ``more``, and those that the description names."""
    named = arm.source.full_model.referenceConfigurations
    for key, full in (*more.items(), *((str(e.key()), np.array(e.data())) for e in named)):
        with contextlib.suppress(PinsingError):  # locked joints stand elsewhere in it
            yield key, arm.q_of(full)


@dataclass(frozen=True, eq=False)
class Content:
    """All that a report of an arm says."""

    arm: Arm
    info: ArmInfo
    forms: ClosedForm  # with what became of the search for a certificate
    # one a family that shows it well, where it is singular; within limits if possible
    poses: tuple[tuple[Arm, State] | None, ...]
    # configurations that people ask about first, by name: ``zero``, ``mid-range``, the
    # description's, ``given 1``; without a clearance where no family has a real point
    special: dict[str, tuple[State, Clearance | None]]
    clearest: Suggestion | None  # None without families


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A trajectory that a report judges."""

    check: TrajectoryCheck
    Q: Array  # (N, n), radians and metres
    t: Array | None  # (N,)
    name: str = "path"
    robot: str = "ROBOT"  # how commands name it
    notes: tuple[str, ...] = ()  # how its file was read

    @property
    def answer(self) -> tuple[str, str]:
        """What it meets, and what to do, a line each."""
        first, *_, last = said_of(self.check, True, self.name, self.robot).splitlines()
        return first, last.strip()


def gather(
    arm: Arm, forms: ClosedForm | None = None, poses: Mapping[str, Array] | None = None
) -> Content:
    """Compute what a report says; families, unless given, with a certificate if that is quick."""
    forms = closed_form(arm) if forms is None else forms
    # Where to go, and how far it is, if there are any that a configuration can be on.
    real = any(f.real for f in forms.families)
    clearest = None
    if real:
        with contextlib.suppress(PinsingError):  # nothing clear within the limits
            clearest = suggest(arm, forms=forms, work=2.0)
    asked = {**special_poses(arm), **(poses or {})}
    if clearest is not None:
        asked["clearest found"] = clearest.q
    return Content(
        arm=arm,
        info=describe(arm),
        forms=forms,
        poses=tuple(_pose(arm, f, forms.families) for f in forms.families),
        special={
            name: (at(arm, q), clearance(forms, q, certify=True) if real else None)
            for name, q in asked.items()
        },
        clearest=clearest,
    )


def special_poses(arm: Arm) -> dict[str, Array]:
    """Zero, the middle of the limits, and what the description gives a name to."""
    lower, upper = arm.span
    ends = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    zero, middle = np.zeros(arm.n), np.where(ends, (lower + upper) / 2, 0.0)
    same = np.array_equal(zero, middle)
    found = {"zero, which is mid-range": zero} if same else {"zero": zero, "mid-range": middle}
    return found | dict(sorted(_named_poses(arm)))


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


@checked
def write_report(
    robot: Arm | Mechanism,
    path: str | os.PathLike[str] | None,
    *,
    forms: ClosedForm | None = None,
    poses: Mapping[str, ArrayLike] | None = None,
    trajectory: ArrayLike | Trajectory | None = None,
    zones: Zones | None = None,
    page: Literal["inside", "beside", "none"] = "inside",
    skeleton: bool = False,
    pdf: str | os.PathLike[str] | None = None,
) -> tuple[Path, ...]:
    """Write a report of the singular configurations of an arm, or of a mechanism, as HTML.

    One file that needs no network: summary, joints, what was assumed, each family with its
    equation, in words and in a picture, maps, verdicts at special configurations, how sure it is
    that nothing is missing (with the certificate), versions, and all of it as JSON.

    Parameters
    ----------
    robot : Arm or Mechanism
        What it is about.
    path : path-like or None
        The HTML file; None, or a name that ends in .pdf, for PDF alone.
    forms : ClosedForm, optional
        Of the arm, as `closed_form` gave it; found by default.
    poses : mapping of str to (n,) array_like, optional
        More configurations to judge, by name; radians and metres. Of a mechanism: values of its
        inputs.
    trajectory : (N, n) array_like or Trajectory, optional
        Of an arm: a motion to judge as `check_trajectory` does, radians and metres; the page
        shows it.
    zones : Zones, optional
        Those of the arm, from `pinsing.zones`: how near is too near.
    page : str
        Where the interactive page of `Viewer` goes: "inside" the file, "beside" it (as
        ``NAME-model.html``), or "none".
    skeleton : bool
        That page without meshes: under 3 MB in all.
    pdf : path-like, optional
        Print it to this file as well. Needs Chromium or Chrome.

    Returns
    -------
    tuple of Path
        The files that were written: the page beside, the HTML, the PDF, those there are.

    Raises
    ------
    OutputError
        If a file cannot be written, or there is no browser to print with; then none is written.
    OptionError
        If neither ``path`` nor ``pdf`` is given, or ``forms`` or ``zones`` are those of
        another arm.
    ConfigurationError
        If a pose has the wrong length or is not finite.

    Examples
    --------
    >>> import pathlib, pinsing
    >>> files = pinsing.write_report(pinsing.load("planar3r"), "arm.html", page="none")
    >>> "Family F1" in pathlib.Path("arm.html").read_text()
    True
    """
    from pinsing.view.picture import check_browser, printed

    if path is not None and Path(path).suffix.lower() == ".pdf" and pdf is None:
        path, pdf = None, path
    OptionError.refuse_if(
        path is None and pdf is None, "path is None and pdf is None: there is nothing to write"
    )
    OutputError.refuse_if(
        path is not None and Path(path).suffix.lower() not in ("", ".html", ".htm"),
        f"cannot write {path}: a report is .html or .pdf",
    )
    html_file = None if path is None else check_writable(path)
    pdf_file = None if pdf is None else check_writable(pdf)
    OutputError.refuse_if(
        html_file is not None
        and pdf_file is not None
        and html_file.resolve() == pdf_file.resolve(),
        f"cannot write {pdf_file}: the HTML goes there",
    )
    if pdf_file is not None:
        check_browser(pdf_file)
    beside = None
    if page == "beside":
        if html_file is None:
            raise OptionError("page='beside' needs path: the HTML file that it stands beside")
        beside = check_writable(html_file.with_name(f"{html_file.stem}-model.html"))
    where: dict[str, Any] = {
        "page": page == "inside",
        "beside": None if beside is None else beside.name,
        "skeleton": skeleton,
    }
    poses = poses or {}
    if isinstance(robot, Arm):
        if forms is not None and forms.arm.joints != robot.joints:
            raise OptionError(
                f"forms are of {forms.arm.name} with joints {', '.join(forms.arm.joints)}, "
                f"not of {robot.name} with {', '.join(robot.joints)}"
            )
        judged = {key: robot.check_one(q, f"pose {key}") for key, q in poses.items()}
        if trajectory is not None and not isinstance(trajectory, Trajectory):
            Q = robot.check(trajectory)
            trajectory = Trajectory(check_trajectory(robot, Q, forms=forms), Q, None)
        html, shown = arm_report(robot, forms, judged, **where, way=trajectory, zones=zones)
    else:
        OptionError.refuse_if(
            trajectory is not None or zones is not None, "a trajectory and zones are of arms only"
        )
        OptionError.refuse_if(forms is not None, "forms are of arms: a mechanism has none to give")
        quiet_backend()  # before anything draws
        from pinsing.report.mechanism_report import mechanism_report

        given = {key: robot.check_inputs(x) for key, x in poses.items()}
        html, shown = mechanism_report(robot, given, **where)
    on_paper = None if pdf_file is None else printed(html, pdf_file)
    made = ((beside, shown), (html_file, html), (pdf_file, on_paper))
    written = [(file, content) for file, content in made if file is not None and content]
    for file, content in written:
        if isinstance(content, bytes):
            write_bytes(file, content)
        else:
            write_text(file, content)
    return tuple(file for file, _ in written)


_TONE = {"singular": "alarm", "near-singular": "caution", "regular": "good"}
_REACHED = {
    Reachability.INSIDE: "alarm",
    Reachability.AT_LIMIT: "caution",
    Reachability.OUTSIDE: "good",
    Reachability.UNKNOWN: "",
}
_MOST_PICTURES = 12


def summary(c: Content, way: Trajectory | None) -> Section:
    """Page one: what a trajectory meets, the robot, what to avoid, and where that is."""
    arm, forms = c.info.arm, c.forms
    families = sorted(forms.families, key=lambda f: ORDER.index(f.title))
    count = counted(len(families), "family", "families")
    none = "no singular configuration" + ("" if forms.complete else " that is known")
    lead = paragraph(
        name(arm.name),
        text(f"has {counted(arm.n, 'joint', 'joints')} between"),
        name(arm.base),
        text("and"),
        name(arm.tip) + text(". For the task"),
        name(arm.task),
        text(f"it has {f'{count} of singular configurations' if families else none}."),
        kind="lead",
    )
    meaning = (
        "At a singular configuration the tool cannot move in every direction, whatever the joints "
        "do. Near one, joints move very fast for a slow motion of the tool."
    )
    rows = [
        (
            f'<a href="#{f.name}">{text(f.title or f.name)}</a>',
            text(f.where()),
            text(PLACE.get(f.kind, _kind(f))),
            badge(f.reach, _REACHED[f.reachability]),
        )
        for f in families
    ]
    header = ("", "avoid", "where it lies", "reachable")
    at_once = [
        f"{text('At')} {name(key)} {text('the arm is')} {status_badge(state)}."
        for key, (state, _) in c.special.items()
        if not key.startswith("clearest")
    ]
    if c.clearest is not None:
        at_once.append(
            f"{text('Farthest from all of them that was found:')} "
            f"{name(c.clearest.text(degrees=True).splitlines()[0])}."
        )
    slices = [
        figure(one, f"Slice {k} of the workspace, coloured by the smallest singular value.", "")
        for k, one in enumerate(workspace_pictures(c.arm), 1)
    ]
    caption = (
        "The workspace in three slices (metres; square: base). Bright: the tool moves well in the "
        "best of the postures drawn at random there. Dark: even that one is near a singular "
        "configuration. Blank: none came there."
    )
    met = []
    if way is not None:
        verdict, advice = way.answer
        met.append(
            paragraph(f'<strong><a href="#trajectory">{text(verdict)}</a></strong>', kind="lead")
        )
        met.append(paragraph(text(advice)))
    return section(
        "summary",
        "Summary",
        *met,
        lead,
        paragraph(word_badge(c), text(coverage_words(forms))),
        paragraph(text(meaning)),
        table("The families", header, rows) if rows else "",
        bullets(at_once),
        side_by_side(slices, "maps slices"),
        paragraph(text(caption), kind="sub"),
    )


def word_badge(c: Content) -> str:
    """Return how sure it is that no family is missing, coloured."""
    word = c.forms.word
    return badge(word, {"proven": "good", "not complete": "caution"}.get(word, ""))


def trajectory(c: Content, way: Trajectory) -> Section:
    """Return what a trajectory meets: the first lines of `pinsing check`, then the rest of them."""
    verdict, *lines = said_of(way.check, True, way.name, way.robot).splitlines()
    from pinsing.plot.curves import clearance_along

    drawn: Any = clearance_along(c.forms, way.Q, way.t)
    return section(
        "trajectory",
        "The trajectory",
        paragraph(f"<strong>{text(verdict)}</strong>", kind="lead"),
        bullets(text(line.strip()) for line in lines if line.strip()),
        figure(
            png(drawn.figure),
            "Clearance over time, one line for each family.",
            text("Proven clearance of each family along the trajectory."),
        ),
        f"<pre>{text(details(way.check))}</pre>",
        bullets(text(note) for note in way.notes),
    )


def too_near(zones: Zones) -> Section:
    """Return what `pinsing zones` says."""
    first, _, *lines = zones.text().removeprefix(f"{zones.arm.name}: ").splitlines()
    return section(
        "zones",
        "How near is too near",
        paragraph(f"<strong>{text(sentence(first))}</strong>", kind="lead"),
        bullets(text(line.strip().removeprefix("note: ")) for line in lines),
    )


def status_badge(state: State) -> str:
    """The verdict of a configuration, coloured."""
    return badge(state.status, _TONE[state.status])


def legend(c: Content) -> str:
    """Return which joint each symbol stands for, where the names differ."""
    pairs = [
        f"{formula(symbol_text(symbol))} {text('is')} {name(joint)}"
        for symbol, joint in c.forms.legend
        if symbol != joint
    ]
    return paragraph(text("Symbols:"), ", ".join(pairs) + ".", kind="sub") if pairs else ""


def robot(c: Content) -> Section:
    """The chain and its joints."""
    info, arm = c.info, c.info.arm
    rank = f"{info.generic_rank} of {info.task_rows}"
    if arm.n > info.generic_rank:
        rank += f", redundant by {arm.n - info.generic_rank}"
    pairs = [
        ("robot", name(arm.name)),
        ("described by", name(arm.described)),
        ("chain", f"{name(arm.base)} {text('to')} {name(arm.tip)}"),
        ("task", name(arm.task)),
        ("independent motions of the tool, in general", text(rank)),
        ("length scale", text(f"{arm.length_scale:g} m")),
    ]
    rows = [
        (
            formula(symbol_text(c.forms.symbols[i])),
            name(joint),
            text(info.kinds[i]),
            text(limit_text(arm.lower[i], bool(arm.prismatic[i]))),
            text(limit_text(arm.upper[i], bool(arm.prismatic[i]))),
        )
        for i, joint in enumerate(arm.joints)
    ]
    header = ("symbol", "joint", "type", "from", "to")
    return section(
        "robot",
        "The robot",
        terms(pairs),
        table("Joints, base to tip, with their limits", header, rows, (3, 4)),
        legend(c),
    )


def assumed(c: Content) -> Section:
    """Return what the answer stands on besides the file."""
    rows = (
        *c.info.arm.notes,
        f"Geometry: {c.info.geometry()}.",
        *c.forms.hints,
        "Singular means: the rank of the Jacobian of the task is below its generic rank. In "
        "numbers: sigma_r / sigma_1 at or below 1e-9, with r the generic rank; near-singular: "
        "at or below 0.01. Families hold exactly, on the geometry with exact numbers, and on "
        "whole circles of the joints; limits are looked at afterwards.",
        "Collisions, cables, speeds, torques and masses are not looked at: a configuration "
        "that is called reachable is within the joint limits, no more.",
    )
    return section("assumed", "What was assumed", bullets(map(text, rows)))


def maps(c: Content) -> Section:
    """sigma_min over two joints."""
    planes = map_planes(c.arm, c.forms.families)
    pictures = []
    for pair in planes:
        a, b = (c.forms.symbols[j] for j in pair)
        alt = (
            f"Map of the smallest singular value over {a} and {b}, the other joints held at the "
            "values below it; lines mark where families of singular configurations cross it."
        )
        picture, held = map_picture(c.arm, c.forms.families, pair)
        joints = f"{formula(symbol_text(a))} {text('and')} {formula(symbol_text(b))}"
        caption = (
            f"{text('Smallest singular value over')} {joints}{text(f' ({held}).')} "
            f"{text('Dark is near-singular; lines are the families.')}"
        )
        pictures.append(figure(picture, alt, caption))
    if not pictures:
        pictures = [
            paragraph(text("No family shows on a map over two joints with the others held."))
        ]
    return section("map", "Map of two joints", side_by_side(pictures))


def side_by_side(pictures: Iterable[str], kind: str = "maps") -> str:
    """Pictures in a row, as many as there is room for."""
    return f'<div class="{kind}">{"".join(pictures)}</div>'


def families(c: Content) -> Section:
    """Each family with its equation, words and a picture."""
    each = enumerate(zip(c.forms.families, c.poses, strict=True))
    parts = [part for k, pair in each for part in _family(c, *pair, k < _MOST_PICTURES)]
    said = (
        "Pictures show the arm at one configuration of the family, and how fast its tip moves and "
        "rotates at unit joint speed: the ellipsoid is flat where a motion is lost (dashed). Thin "
        "lines: the joint axes that depend on each other."
    )
    if not parts:
        said = "There are none." if c.forms.complete else "None is known."
    parts.insert(0, paragraph(text(said)))
    if len(c.forms.families) > _MOST_PICTURES:
        note = f"Pictures stand with the first {_MOST_PICTURES} families only."
        parts.append(paragraph(text(note), kind="sub"))
    return section("families", "The families", *parts)


def _family(
    c: Content, family: Family, pose: tuple[Arm, State] | None, drawn: bool
) -> Iterator[str]:
    yield f'<h3 id="{family.name}">{text(f"Family {family.label}")}</h3>'
    yield _equation(family)
    if drawn and pose is not None:
        alt = (
            f"The arm at that configuration, drawn as lines between its joints, with a velocity "
            f"ellipsoid at its tip. "
            f"{sentence('; '.join(m.words for m in pose[1].lost) or 'nothing is lost')}"
        )
        yield side_by_side(figure(picture, alt, "") for picture in pose_pictures(*pose))
    n, free = family.n, family.n - family.codimension
    few = {0: "single configurations", 1: "one joint motion stays free on it"}
    extent = few.get(free, f"{free} joint motions stay free on it")
    facts = [
        ("kind", text(_kind(family))),
        ("reachable", badge(family.reach, _REACHED[family.reachability])),
        ("size", text(f"codimension {family.codimension} of {n}: {extent}")),
        ("joints involved", ", ".join(name(j) for j in family.joints)),
    ]
    why, lost = _there(family, pose)
    facts += [("why", text(sentence(why)))] * bool(why)
    facts += [("what is lost", bullets(text(sentence(x)) for x in lost))] * bool(lost)
    facts += [("limit", text(met)) for met in family.limits_met]
    yield terms(facts)
    if pose is None:
        yield paragraph(text("No real configuration of it is known."))
        return
    shown, state = pose
    loose = set(range(n)).difference(*(b.involved for b in family.branches))
    exact = "--nominal " * (shown is not c.arm)
    q = exact + typed(state.q, family.prismatic, True, loose=loose)
    yield paragraph(text("A configuration of it, degrees and metres, for"), name("pinsing at"), ":")
    yield f"<pre>{text(q)}</pre>"


def _there(family: Family, pose: tuple[Arm, State] | None) -> tuple[str, tuple[str, ...]]:
    """Why it is singular and what is lost, at the configuration that stands below and is drawn."""
    if pose is None or pose[1].status != SINGULAR:
        return family.reason, family.lost
    state = pose[1]
    lost = (*(str(m) for m in state.lost), *missing_everywhere(state))
    return "; ".join(str(d) for d in state.dependences) or family.reason, lost


def _equation(family: Family) -> str:
    """The condition typeset; a long one line by line, with what follows for a joint."""
    if family.at_once:
        said = [text(sentence(line)) for one in family.at_once for line in one.lines()]
        return f'<div class="equation">{formula(family.latex)}{bullets(said)}</div>'
    if not family.solved:
        return f'<div class="equation">{formula(family.latex)}</div>'
    lines = []
    for one in family.solved:
        condition, *where = (one.exact_latex or one.latex).split(r",\ ")
        lines += [formula(condition), text(one.solution), *map(formula, where)]
    if any(b.values for b in family.branches) or len(family.equations) > len(family.solved):
        lines = [formula(family.latex), *lines]
    return f'<div class="equation">{"".join(map(paragraph, lines))}</div>'


def _kind(family: Family) -> str:
    if not family.real:
        return "no real point known"
    return "; ".join(str(part) for part in family.kinds) if family.kind == "varies" else family.kind


def sentence(words: str) -> str:
    """Words with a capital first letter and a full stop."""
    return words[:1].upper() + words[1:] + ("" if words.endswith(".") else ".")


def words() -> Section:
    """The words that a reader needs."""
    pairs = [
        (
            "singular configuration",
            "The joints cannot produce every motion of the tool that they produce elsewhere: the "
            "Jacobian, which maps joint velocities to the tool's, loses rank.",
        ),
        (
            "family",
            "All singular configurations that one condition describes, with its mirror images.",
        ),
        (
            "codimension",
            "How many independent conditions a family needs. Those of codimension 1 are walls in "
            "the space of the joints, which a motion may have to cross; others can be passed by.",
        ),
        (
            "boundary, interior",
            "At a boundary singularity the tool stands at the edge of what it can reach in some "
            "direction, as with a stretched elbow. At an interior one it does not.",
        ),
        (
            "σ_min/σ_max",
            "The smallest singular value of the Jacobian that counts, over the largest: 0 where "
            "singular, near 1 where the tool moves as well in every direction.",
        ),
        (
            "velocity ellipsoid",
            "The velocities of the tool that joint speeds of total size 1 reach. Drawn are pure "
            "motions where the task is a pose: pure translations (ω = 0), and rotations that leave "
            "its tip at rest (v = 0).",
        ),
        (
            "proven, probable, not complete",
            "Proven: a small independent program has accepted a certificate that no family is "
            "missing. Probable: nothing is known to be missing, some steps rest on random points. "
            "Not complete: something is known to be missing, and said.",
        ),
    ]
    return section("words", "What the words mean", terms([(text(a), text(b)) for a, b in pairs]))


def special(c: Content) -> Section:
    """Verdicts at zero, mid-range and named configurations."""
    rows = []
    for key, (state, near) in c.special.items():
        outside = status_badge(state)
        if state.outside:
            outside += f"<br>{text('outside the limits of')} {', '.join(map(name, state.outside))}"
        lost = "<br>".join(text(sentence(m.words)) for m in state.lost)
        rows.append(
            (
                name(key),
                name(values(state.q, c.info.arm)),
                outside,
                text(f"{state.sigma_ratio:.2g}" if state.sigma_ratio > 1e-15 else "0"),
                text(_distance(near)),
                lost or text("nothing"),
            )
        )
    header = ("", "joints (deg, m)", "verdict", "σ_min/σ_max", "nearest family", "lost there")
    usual = ("zero", "mid-range", "given", "clearest")
    named = any(not key.startswith(usual) for key in c.special)
    none = "" if named else "The description names no home configuration."
    return section(
        "special",
        "Special configurations",
        table("Verdicts", header, rows, (3,)),
        _instead(c),
        _clearest(c),
        paragraph(
            text(
                "σ_min and σ_max are singular values of the Jacobian. The distance of the nearest "
                "family is Euclidean over the joints, whatever the limits; at least the first "
                "number is proven where two stand."
            ),
            text(none),
            kind="sub",
        ),
    )


def _instead(c: Content) -> str:
    """Return what to take in place of usual poses that are singular."""
    arm = c.info.arm
    said = [p.text(arm.source, arm.prismatic, True) for p in c.info.singular_poses]
    head = paragraph(text("What to take instead:")) if said else ""
    return head + bullets(text(sentence(line)) for line in said)


def _clearest(c: Content) -> str:
    """The configuration farthest from all families that was found, and how far that is."""
    if c.clearest is None:
        return ""
    q, *said = c.clearest.text(degrees=True).splitlines()
    head = paragraph(text("The clearest configuration that was found within the joint limits:"))
    return f"{head}<pre>{text(q)}</pre>{bullets(text(sentence(line)) for line in said)}"


def _distance(near: Clearance | None) -> str:
    if near is None or not np.isfinite(near.upper):
        return "none"
    low, high = math.degrees(float(near.lower)), math.degrees(float(near.upper))
    if high <= 1e-6:
        return f"on {near.nearest}"
    least = "" if high - low <= 0.02 * high else f"{low:.3g}° to "
    return f"{least}{high:.3g}° from {near.nearest}"


def values(q: Array, arm: ArmSummary) -> str:
    """Joint values in degrees and metres."""
    return ", ".join(
        f"{v:.4g} m" if slides else f"{math.degrees(v) + 0.0:.4g}°"
        for v, slides in zip(q, arm.prismatic, strict=True)
    )


def proof(c: Content, certificate: str | None) -> Section:
    """Return how sure it is that no family is missing."""
    forms = c.forms
    said, count, parts = word_badge(c), forms.slice_count, []
    if forms.deviation is not None:
        parts.append(paragraph(text(coverage_words(forms))))
    if forms.proof is not None and forms.proof.accepted and certificate is not None:
        accepted = (
            "A certificate was found and accepted by a checker that rebuilds the Jacobian "
            "by itself and shares no code with the search: every configuration at which "
            "the rank drops lies on one of the families above. It took "
            f"{1e3 * forms.proof.check_seconds:.0f} ms to check."
        )
        file = (
            download("Save the certificate", "certificate.json", certificate),
            text(f"({len(certificate) / 1e3:.1f} kB); check it with"),
            name("pinsing verify certificate.json"),
            text("or with the checker alone, pinsing/proof/checker.py."),
        )
        parts += [paragraph(said, text(accepted)), paragraph(*file)]
    elif forms.complete:
        reason = forms.proof.reason if forms.proof is not None else "none was looked for"
        ended = (
            "The search ended and nothing is known to be missing, but steps of it were "
            f"decided at random points of finite fields. There is no certificate: {reason}."
        )
        parts.append(paragraph(said, text(ended)))
        if count is not None:
            parts.append(paragraph(text(f"It rests on a count: {count.sentence()}.")))
    else:
        gaps = bullets(text(gap) for gap in forms.gaps)
        parts += [paragraph(said, text("What is missing:")), gaps]
        if count is not None and not count.off:
            parts.append(paragraph(text(f"{count.evidence().capitalize()}.")))
    rounded = [f for f in forms.families if f.raw_ratio is not None]
    if rounded:
        rows = [(name(f.name), text(f"{f.raw_ratio:.1e}")) for f in rounded]
        why = (
            "The numbers of the file are rounded. On the geometry as it stands there, the "
            "σ_min/σ_max on each family is no larger than:"
        )
        caption = "σ_min/σ_max on the file's own numbers"
        parts += [paragraph(text(why)), table(caption, ("", "at most"), rows, (1,))]
    return section("proof", "How sure this is", *parts)


def arm_report(
    arm: Arm,
    forms: ClosedForm | None,
    poses: Mapping[str, Array],
    page: bool,
    beside: str | None,
    skeleton: bool,
    way: Trajectory | None = None,
    zones: Zones | None = None,
) -> tuple[str, str | None]:
    """Return the report of an arm, and the interactive page that belongs beside it."""
    # ``forms`` are found if None; ``poses`` (n,) are judged. The page stands inside if ``page``,
    # else in the file ``beside``; ``skeleton``: without meshes. ``zones``: how near is too near.
    quiet_backend()
    started = time.monotonic()
    content = gather(arm, forms, poses)
    if zones is not None:
        names = [f.name for f in content.forms.families]
        require_zones_of(zones, content.forms.arm, arm, names)
    shown = _page(content, skeleton, way, zones) if page or beside is not None else None
    certificate = content.forms.certificate
    written = None if certificate is None else text_of(certificate) + "\n"
    sections = [
        summary(content, way),
        None if way is None else trajectory(content, way),
        None if zones is None else too_near(zones),
        maps(content),
        families(content),
        special(content),
        proof(content, written),
        robot(content),
        assumed(content),
    ]
    html = document(
        arm.name,
        f"{arm.base} to {arm.tip}, task {arm.task.name}",
        sections,
        words(),
        {
            "robot": content.info.to_dict(),
            "families": content.forms.to_dict(),
            "certificate": certificate,
            "clearest": None if content.clearest is None else content.clearest.to_dict(),
            "special": [
                {
                    "name": key,
                    "state": state.to_dict(),
                    "clearance": None if near is None else near.to_dict(),
                }
                for key, (state, near) in content.special.items()
            ],
            "zones": None if zones is None else zones.to_dict(),
        },
        started=started,
        engine=content.info.engine,
        page=shown if page else None,
        beside=beside,
        more=[("", f"{content.forms.seconds:.2g} s of it for the families")],
    )
    return html, shown


def _page(content: Content, skeleton: bool, way: Trajectory | None, zones: Zones | None) -> str:
    from pinsing.view.trajectory import trajectory_data
    from pinsing.view.viewer import Viewer

    arm, forms = content.arm, content.forms
    shown = None if way is None else trajectory_data(
        arm, way.check, way.Q, way.t, name=way.name, robot=way.robot, notes=way.notes
    )  # fmt: skip
    with Viewer(
        arm,
        forms.families,
        skeleton=skeleton,
        coverage=coverage_words(forms),
        clearest=content.clearest,
        shown=shown,
        zones=None if zones is None or zones.posture else zones,
    ) as viewer:
        return viewer.html()
