"""The report of an arm, as one HTML text."""

from __future__ import annotations

import time
from collections.abc import Mapping

from pinsing._types import Array
from pinsing._version import __version__
from pinsing.families import ClosedForm
from pinsing.proof.produce import text_of
from pinsing.report import arm_sections as part
from pinsing.report import verdict_sections as verdict
from pinsing.report.closing import computed, data, model, result
from pinsing.report.content import Content, Made, gather
from pinsing.report.document import document
from pinsing.report.pictures import quiet_backend
from pinsing.robot.arm import Arm

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
