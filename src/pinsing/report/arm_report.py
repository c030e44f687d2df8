"""The report of an arm, as one HTML text."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import numpy as np

from pinsing._types import Array
from pinsing._version import __version__
from pinsing.families import ClosedForm
from pinsing.proof.produce import text_of
from pinsing.report import arm_report as verdict
from pinsing.report import arm_sections as part
from pinsing.report.arm_sections import Section, sentence, status_badge
from pinsing.report.content import Content, Made, gather
from pinsing.report.document import (
    badge,
    bullets,
    computed,
    data,
    document,
    download,
    model,
    name,
    paragraph,
    result,
    section,
    table,
    text,
)
from pinsing.report.pictures import quiet_backend
from pinsing.robot.arm import Arm, ArmSummary


def special(c: Content) -> Section:
    """Verdicts at zero, mid-range and named configurations."""
    rows = []
    for s in c.special:
        near = "none"
        if s.near is not None and np.isfinite(s.near.upper):
            near = _distance(float(s.near.lower), float(s.near.upper), str(s.near.nearest))
        outside = f"{status_badge(s.state)}"
        if s.state.outside:
            outside += (
                f"<br>{text('outside the limits of')} {', '.join(map(name, s.state.outside))}"
            )
        lost = "<br>".join(text(sentence(m.words)) for m in s.state.lost)
        rows.append(
            (
                name(s.name),
                name(values(s.state.q, c.info.arm)),
                outside,
                text(f"{s.state.sigma_ratio:.2g}" if s.state.sigma_ratio > 1e-15 else "0"),
                text(near),
                lost or text("nothing"),
            )
        )
    header = ("", "joints (deg, m)", "verdict", "σ_min/σ_max", "nearest family", "lost there")
    named = [
        s.name
        for s in c.special
        if not s.name.startswith(("zero", "mid-range", "given", "clearest"))
    ]
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
    """What to take in place of usual poses that are singular."""
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


def _distance(lower: float, upper: float, family: str) -> str:
    low, high = math.degrees(lower), math.degrees(upper)
    if high <= 1e-6:
        return f"on {family}"
    if high - low <= 0.02 * high:
        return f"{high:.3g}° from {family}"
    return f"{low:.3g}° to {high:.3g}° from {family}"


def values(q: Array, arm: ArmSummary) -> str:
    """Joint values in degrees and metres."""
    return ", ".join(
        f"{v:.4g} m" if slides else f"{math.degrees(v) + 0.0:.4g}°"
        for v, slides in zip(q, arm.prismatic, strict=True)
    )


def proof(c: Content, certificate: str | None) -> Section:
    """How sure it is that no family is missing."""
    forms = c.forms
    said = badge(forms.word, {"proven": "good", "not complete": "caution"}.get(forms.word, ""))
    parts = []
    if forms.proof is not None and forms.proof.accepted and certificate is not None:
        parts.append(
            paragraph(
                said,
                text(
                    "A certificate was found and accepted by a checker that rebuilds the Jacobian "
                    "by itself and shares no code with the search: every configuration at which "
                    "the rank drops lies on one of the families above. It took "
                    f"{1e3 * forms.proof.check_seconds:.0f} ms to check."
                ),
            )
        )
        parts.append(
            paragraph(
                download("Save the certificate", "certificate.json", certificate),
                text(f"({len(certificate) / 1e3:.1f} kB); check it with"),
                name("pinsing verify certificate.json"),
                text("or with the checker alone, pinsing/proof/checker.py."),
            )
        )
    elif forms.complete:
        reason = forms.proof.reason if forms.proof is not None else "none was looked for"
        parts.append(
            paragraph(
                said,
                text(
                    "The search ended and nothing is known to be missing, but steps of it were "
                    f"decided at random points of finite fields. There is no certificate: {reason}."
                ),
            )
        )
        if forms.slice_count is not None:
            parts.append(paragraph(text(f"It rests on a count: {forms.slice_count.sentence()}.")))
    else:
        parts.append(paragraph(said, text("What is missing:")))
        parts.append(bullets(text(gap) for gap in forms.gaps))
        if forms.slice_count is not None and not forms.slice_count.off:
            parts.append(paragraph(text(f"{forms.slice_count.evidence().capitalize()}.")))
    rounded = [f for f in forms.families if f.raw_ratio is not None]
    if rounded:
        rows = [(name(f.name), text(f"{f.raw_ratio:.1e}")) for f in rounded]
        parts.append(
            paragraph(
                text(
                    "The numbers of the file are rounded. On the geometry as it stands there, the "
                    "σ_min/σ_max on each family is no larger than:"
                )
            )
        )
        parts.append(table("σ_min/σ_max on the file's own numbers", ("", "at most"), rows, (1,)))
    return section("proof", "How sure this is", *parts)


SCHEMA = "pinsing/report/1"


def arm_report(
    arm: Arm,
    forms: ClosedForm | None,
    poses: Mapping[str, Array],
    page: bool,
    beside: str | None,
    skeleton: bool,
) -> tuple[str, str | None]:
    """The report of an arm, and the interactive page that belongs beside it.

    Parameters
    ----------
    arm : Arm
        The arm.
    forms : ClosedForm or None
        Its families; None to find them.
    poses : mapping of str to (n,) array
        More configurations to judge.
    page : bool
        Whether the interactive page stands inside.
    beside : str or None
        The name of the file that it stands in, if beside.
    skeleton : bool
        The page without meshes.
    """
    quiet_backend()
    started = time.monotonic()
    content = gather(arm, forms, poses)
    shown = _page(content, skeleton) if page or beside is not None else None
    certificate = content.forms.certificate
    written = None if certificate is None else text_of(certificate) + "\n"
    sections = [
        part.summary(content),
        part.robot(content),
        part.assumed(content),
        part.maps(content),
        part.families(content),
        verdict.special(content),
        verdict.proof(content, written),
        model(shown if page else None, beside),
    ]
    made = Made.since(started)
    algebra = f"{content.forms.seconds:.2g} s of it for the families"
    sections += [
        computed(made, content.info.engine, [("", algebra)]),
        part.words(),
        data(SCHEMA),
    ]
    html = document(
        title=f"Singular configurations of {arm.name}",
        subtitle=f"{arm.base} to {arm.tip}, task {arm.task.name}; {made.when}",
        sections=[s for s in sections if s is not None],
        data=_data(content, made),
        page=shown if page else None,
        foot=f"Made by pinsing {__version__}.",
    )
    return html, shown


def _page(content: Content, skeleton: bool) -> str:
    from pinsing.families.certainty import coverage_words
    from pinsing.view.viewer import Viewer

    forms, clearest = content.forms, content.clearest
    said = coverage_words(forms)
    with Viewer(
        content.arm, forms.families, skeleton=skeleton, coverage=said, clearest=clearest
    ) as viewer:
        return viewer.html()


def _data(content: Content, made: Made) -> dict[str, object]:
    return {
        "schema": SCHEMA,
        "made": made.when,
        "seconds": made.seconds,
        "versions": dict(made.versions),
        "robot": result(content.info),
        "families": result(content.forms),
        "certificate": content.forms.certificate,
        "clearest": None if content.clearest is None else result(content.clearest),
        "special": [
            {
                "name": s.name,
                "state": result(s.state),
                "clearance": None if s.near is None else result(s.near),
            }
            for s in content.special
        ],
    }
