"""write_report: one file that explains singular configurations to somebody who was not there."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy.typing as npt

from pinsing.arguments import checked
from pinsing.atomic_write import check_writable, write_bytes, write_text
from pinsing.errors import OptionError, OutputError
from pinsing.families import ClosedForm
from pinsing.proximity.trajectory import check_trajectory
from pinsing.report.info import Trajectory
from pinsing.robot.arm import Arm
from pinsing.robot.mechanism import Mechanism
from pinsing.view.picture import check_browser, printed


@checked
def write_report(
    robot: Arm | Mechanism,
    path: str | os.PathLike[str] | None,
    *,
    forms: ClosedForm | None = None,
    poses: Mapping[str, npt.ArrayLike] | None = None,
    trajectory: npt.ArrayLike | Trajectory | None = None,
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
        The HTML file; None for PDF alone.
    forms : ClosedForm, optional
        Of the arm, as `closed_form` gave it; found by default.
    poses : mapping of str to (n,) array_like, optional
        More configurations to judge, by name; radians and metres. Of a mechanism: values of its
        inputs.
    trajectory : (N, n) array_like or Trajectory, optional
        Of an arm: a motion to judge as `check_trajectory` does, radians and metres; the page
        shows it.
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
        If neither ``path`` nor ``pdf`` is given, or ``forms`` are those of another arm.
    ConfigurationError
        If a pose has the wrong length or is not finite.

    Examples
    --------
    >>> import pathlib, pinsing
    >>> files = pinsing.write_report(pinsing.load("planar3r"), "arm.html", page="none")
    >>> "Family F1" in pathlib.Path("arm.html").read_text()
    True
    """
    if path is None and pdf is None:
        raise OptionError("path is None and pdf is None: there is nothing to write")
    html_file = None if path is None else check_writable(path)
    pdf_file = None if pdf is None else check_writable(pdf)
    if html_file is not None and pdf_file is not None and html_file.resolve() == pdf_file.resolve():
        raise OutputError(f"cannot write {pdf_file}: the HTML goes there")
    if pdf_file is not None:
        check_browser(pdf_file)
    beside = None
    if page == "beside":
        if html_file is None:
            raise OptionError("page='beside' needs path: the HTML file that it stands beside")
        beside = check_writable(html_file.with_name(f"{html_file.stem}-model.html"))
    html, shown = _made(robot, forms, poses or {}, page, beside, skeleton, trajectory)
    on_paper = None if pdf_file is None else printed(html, pdf_file)
    written = []
    if beside is not None and shown is not None:
        write_text(beside, shown)
        written.append(beside)
    if html_file is not None:
        write_text(html_file, html)
        written.append(html_file)
    if pdf_file is not None and on_paper is not None:
        write_bytes(pdf_file, on_paper)
        written.append(pdf_file)
    return tuple(written)


def _made(
    robot: Arm | Mechanism,
    forms: ClosedForm | None,
    poses: Mapping[str, npt.ArrayLike],
    page: str,
    beside: Path | None,
    skeleton: bool,
    trajectory: Any,
) -> tuple[str, str | None]:
    inside, name = page == "inside", None if beside is None else beside.name
    if isinstance(robot, Arm):
        from pinsing.report.arm_report import arm_report

        if forms is not None and forms.arm.joints != robot.joints:
            raise OptionError(
                f"forms are of {forms.arm.name} with joints {', '.join(forms.arm.joints)}, "
                f"not of {robot.name} with {', '.join(robot.joints)}"
            )
        checked_poses = {key: robot.check_one(q, f"pose {key}") for key, q in poses.items()}
        if trajectory is not None and not isinstance(trajectory, Trajectory):
            Q = robot.check(trajectory)
            trajectory = Trajectory(check_trajectory(robot, Q, forms=forms), Q, None)
        return arm_report(robot, forms, checked_poses, inside, name, skeleton, trajectory)
    if trajectory is not None:
        raise OptionError("a trajectory is judged for arms only")
    if forms is not None:
        raise OptionError("forms are of arms: a mechanism has none to give")
    from pinsing.report.mechanism_report import mechanism_report

    given = {key: robot.check_inputs(x) for key, x in poses.items()}
    return mechanism_report(robot, given, inside, name, skeleton)
