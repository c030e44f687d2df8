"""Tables 5 and 6, and what Section 5 says cannot be found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from paper import printed
from paper.rows import AGREES, DIFFERS, EXTENDED, Row, Section, Table
from pinsing.families import ClosedForm, closed_form
from pinsing.kinematics.jacobian import frame_jacobian
from pinsing.loops import loop_forms
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.robot.mechanism import load_mechanism
from pinsing.robot.nominal import nominal

ARMS = ("stanford", "puma560", "irb1400", "ur5", "surgical7", "iiwa14", "panda", "xarm7")
_SMALL = 1e-9

BY_ALGEBRA = "As equations, by exact algebra of which no branch was given up (complete)."


def make(folder: Path) -> list[Section]:
    del folder
    forms = {arm.name: (arm, closed_form(arm)) for arm in arms()}
    seconds = int(np.ceil(max(form.seconds for _, form in forms.values())))
    table = tuple(
        (
            arm.name,
            str(arm.n),
            pieper(arm) or "not met",
            str(len(form.families)),
            "yes" if form.complete else "no",
        )
        for arm, form in forms.values()
    )
    without = [form for arm, form in forms.values() if not pieper(arm)]
    loops = {name: loop_forms(load_mechanism(name)) for name in ("five_bar", "four_bar")}
    return [
        Section(
            "Tables 5 and 6, and the limits stated in Section 5",
            text=(
                "Table 6 says that the analytical method does not obtain the singular "
                "configurations of arms that miss Pieper's criterion, nor of parallel "
                "manipulators. Pieper's criterion: three consecutive axes meet in a point or are "
                "parallel.",
            ),
            rows=(
                _special_row([forms[name][1] for name in ("stanford", "surgical7")], loops),
                *_tables(without, loops),
                _locus(
                    forms["puma560"][1],
                    "PUMA 560: d4 sin(q2+q3) + a2 cos q2 + a3 cos(q2+q3) = 0",
                    lambda a, b: printed.puma_locus(a, b, 0.4318, 0.0203, 0.4318),
                ),
                _locus(
                    forms["irb1400"][1],
                    "ABB IRB 1400: a3 sin(q2+q3) - d4 cos(q2+q3) + a2 sin q2 - a1 = 0",
                    lambda a, b: printed.irb_locus(a, b, 0.15, 0.6, 0.12, 0.72),
                ),
            ),
            tables=(
                Table(
                    ("Arm", "Joints", "Pieper's criterion", "Families", "Complete"),
                    table,
                    "Closed forms of the full pose, by exact algebra on the rational geometry, "
                    f"each within {seconds} s:",
                ),
            ),
        )
    ]


def arms() -> list[Arm]:
    """Arms of the table: those that have a name, and two six-joint ones that miss the criterion."""
    out = [load(name) for name in ARMS]
    six = load("surgical7", joints=("q2", "q3", "q4", "q5", "q6", "q7"))
    out.append(replace(six, name="surgical7 without d1"))
    model = out[ARMS.index("irb1400")].source.full_model.copy()
    model.name = "irb1400, wrist offset 50 mm"
    wrist = model.jointPlacements[6]
    wrist.translation = wrist.translation + np.array([0.05, 0, 0])
    model.jointPlacements[6] = wrist
    return [*out, load(model, tip="tool0")]


def pieper(arm: Arm) -> str:
    """Which three consecutive axes meet or are parallel; empty if none do."""
    arm = nominal(arm).arm
    rng = np.random.default_rng(17)
    J = frame_jacobian(arm, rng.uniform(-1, 1, arm.n))
    tip = np.zeros(3)
    for i in range(arm.n - 2):
        if arm.prismatic[i : i + 3].any():
            continue
        w = [J[3:, k] for k in (i, i + 1, i + 2)]
        v = [J[:3, k] for k in (i, i + 1, i + 2)]
        names = ", ".join(arm.joints[i : i + 3])
        if all(np.linalg.norm(np.cross(w[0], x)) < _SMALL for x in w[1:]):
            return f"{names} parallel"
        # A point x on all axes: v + w x x = 0, seen from the tip.
        M = np.vstack([_cross(x) for x in w])
        x, *_ = np.linalg.lstsq(M, -np.concatenate(v), rcond=None)
        if np.abs(M @ (x - tip) + np.concatenate(v)).max() < _SMALL:
            return f"{names} meet"
    return ""


def _cross(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def special(form: ClosedForm) -> list[str]:
    """Families that are joints at multiples of 90 degrees and nothing else."""
    return [
        f.text
        for f in form.families
        if all(
            not b.equations
            and all(abs(np.sin(2 * v.value)) < _SMALL for v in b.values if v.value != 0)
            for b in f.branches
        )
    ]


def _special_row(forms: list[ClosedForm], loops: dict) -> Row:
    counts = [f"{f.arm.name} {len(special(f))} of {len(f.families)}" for f in forms]
    angles = [0.0, np.pi / 2, -np.pi / 2, np.pi]
    five_bar = loops["five_bar"]
    hits = sum(
        abs(float(x.equation([a, b]))) < _SMALL * x.equation.size
        for x in five_bar.loci
        for a in angles
        for b in angles
    )
    found = [len(special(f)) for f in forms]
    return Row(
        "Table 5 (the paper's method): obtains singular configurations",
        "; ".join(f"{kind}: {obtains}" for kind, _, _, obtains in printed.TABLE_5),
        f"families at special angles: {', '.join(counts)}; 5R: {hits} configurations with both "
        f"inputs at special angles on its {len(five_bar.loci)} loci",
        AGREES if min(found[:2]) > 0 else DIFFERS,
        "Some of them, as Section 5 says itself. For the 5R the paper reads the zeros off its "
        "curves instead.",
    )


def _tables(without: list[ClosedForm], loops: dict) -> list[Row]:
    rows: list[Row] = []
    kinds = {
        "serial, not satisfying it": (
            all(f.complete for f in without) and len(without) >= 2,
            "; ".join(f"{f.arm.name}: families {len(f.families)}" for f in without),
        ),
        "parallel": (
            all(f is not None and f.complete for f in loops.values()),
            "; ".join(f"{name}: loci {len(f.loci)}" for name, f in loops.items() if f is not None),
        ),
    }
    for kind, _, solves, obtains in printed.TABLE_6:
        done, words = kinds.get(kind, (True, "closed forms, as printed"))
        rows.append(
            Row(
                f"Table 6 (analytical method): {kind}",
                f"solves det(J) = 0: {solves}; obtains configurations: {obtains}",
                f"{'Yes' if done else 'No'} — {words}",
                AGREES if obtains == "Yes" else EXTENDED if done else DIFFERS,
                "" if obtains == "Yes" else BY_ALGEBRA,
            )
        )
    return rows


def _locus(form: ClosedForm, words: str, locus) -> Row:
    """Whether a family of an arm is the printed equation, up to the sense of the joints."""
    rng = np.random.default_rng(23)
    Q = rng.uniform(-np.pi, np.pi, (60, form.arm.n))
    for family in form.families:
        for branch in family.branches:
            if branch.values or len(branch.equations) != 1:
                continue
            value = branch.equations[0](Q)
            for sense in (1, -1):
                other = locus(sense * Q[:, 1], sense * Q[:, 2])
                ratio = value / other
                if np.ptp(ratio) < 1e-9 * abs(ratio[0]):
                    turned = "" if sense > 0 else " (with q2 and q3 counted the other way)"
                    return Row(
                        f"Section 5, {words}",
                        "“the proposed method fails”",
                        f"family {family.name}: {family.text}",
                        EXTENDED,
                        f"The same equation{turned}, found with its numbers.",
                    )
    return Row(f"Section 5, {words}", "the proposed method fails", "not found", DIFFERS)
