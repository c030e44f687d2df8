"""Find, state, prove and show the singular configurations of robot arms, on Pinocchio."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pinsing._package import public
from pinsing._version import __version__ as __version__

if TYPE_CHECKING:
    from pinsing import (
        errors as errors,
        families as families,
        kinematics as kinematics,
        loops as loops,
        plot as plot,
        postures as postures,
        proof as proof,
        proximity as proximity,
        report as report,
        robot as robot,
        sampling as sampling,
        view as view,
    )
    from pinsing.errors import PinsingError as PinsingError
    from pinsing.families import (
        ClosedForm as ClosedForm,
        Family as Family,
        closed_form as closed_form,
    )
    from pinsing.kinematics import (
        State as State,
        at as at,
        frame_jacobian as frame_jacobian,
        inverse as inverse,
        inverse_velocity as inverse_velocity,
        singular_values as singular_values,
    )
    from pinsing.postures import (
        aspects as aspects,
        connect as connect,
        cuspidality as cuspidality,
        plan_path as plan_path,
        posture_changes as posture_changes,
        zones as zones,
    )
    from pinsing.proximity import (
        Clearance as Clearance,
        Monitor as Monitor,
        check_line as check_line,
        check_trajectory as check_trajectory,
        clearance as clearance,
        crossings as crossings,
        export_guard as export_guard,
        is_clear as is_clear,
        suggest as suggest,
    )
    from pinsing.report import write_report as write_report
    from pinsing.robot import Arm as Arm, load as load, load_mechanism as load_mechanism
    from pinsing.sampling import Analysis as Analysis, analyze as analyze
    from pinsing.view import Viewer as Viewer

_HOMES = {
    "pinsing.errors": "PinsingError",
    "pinsing.families": "ClosedForm Family closed_form",
    "pinsing.kinematics": "State at frame_jacobian inverse inverse_velocity singular_values",
    "pinsing.postures": "aspects connect cuspidality plan_path posture_changes zones",
    "pinsing.proximity": "Clearance Monitor check_line check_trajectory clearance crossings "
    "export_guard is_clear suggest",
    "pinsing.report": "write_report",
    "pinsing.robot": "Arm load load_mechanism",
    "pinsing.sampling": "Analysis analyze",
    "pinsing.view": "Viewer",
}
"""What a user needs daily. Whatever else is public stands in its package alone."""

_ADVICE = {
    "check": "pinsing.check_trajectory(arm, Q) for a path, pinsing.at(arm, q) for one q",
    "check_path": "pinsing.check_trajectory(arm, Q)",
    "check_certificate": "pinsing.proof.verify(text)",
    "verify": "pinsing.proof.verify(text)",
    "singularities": "pinsing.closed_form(arm) for all, pinsing.at(arm, q) for one q",
    "find_singularities": "pinsing.closed_form(arm) for all, pinsing.at(arm, q) for one q",
    "is_singular": "pinsing.at(arm, q).status",
    "status": "pinsing.at(arm, q).status",
    "from_urdf": "pinsing.load(path)",
    "from_file": "pinsing.load(path)",
    "buildModelFromUrdf": "pinsing.load(path)",
    "from_model": "pinsing.load(model)",
    "from_json": "pinsing.ClosedForm.from_json(text): every class of results has it",
    "open": "pinsing.load(path)",
    "Robot": "pinsing.load(robot)",
    "load_robot": "pinsing.load(robot)",
    "jacobian": "pinsing.frame_jacobian(arm, q), or pinsing.kinematics.task_jacobian(arm, q)",
    "manipulability": "pinsing.at(arm, q).manipulability",
    "condition_number": "pinsing.at(arm, q).condition_number",
    "svd": "pinsing.singular_values(arm, Q)",
    "rank": "pinsing.at(arm, q).rank",
    "distance": "pinsing.clearance(form, q), or form['F1'].distance(q)",
    "ik": "pinsing.inverse(arm, pose)",
    "solve_ik": "pinsing.inverse(arm, pose)",
    "fk": "pinsing.at(arm, q).tip_position",
    "forward": "pinsing.at(arm, q).tip_position",
    "branches": "pinsing.inverse(arm, pose)",
    "forward_kinematics": "pinsing.at(arm, q).tip_position",
    "line": "pinsing.check_line(arm, q, pose)",
    "path": "pinsing.check_trajectory(arm, Q), or pinsing.plan_path(form, poses) for a toolpath",
    "trajectory": "pinsing.check_trajectory(arm, Q)",
    "guard": "pinsing.export_guard(form)",
    "export": "pinsing.export_guard(form)",
    "monitor": "pinsing.Monitor(form)",
    "map": "pinsing.sampling.sigma_map(arm)",
    "show": "pinsing.Viewer(arm)",
    "browse": "pinsing.Viewer(arm)",
    "list": "`pinsing list` in a terminal",
    "list_robots": "`pinsing list` in a terminal",
    "robots": "`pinsing list` in a terminal",
}
"""Names that people guess, and what to use instead."""

public(
    __name__,
    _HOMES,
    packages=(
        "errors",
        "families",
        "kinematics",
        "plot",
        "postures",
        "proof",
        "proximity",
        "report",
        "robot",
        "sampling",
        "view",
        "loops",
    ),
    advice=_ADVICE,
    called="pinsing.load(robot)",
)
