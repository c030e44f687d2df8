"""Long equations solved for a joint: against Pinocchio, against themselves, as they are read."""

import functools
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run as pinsing_command
from dh_arms import CRX, GOFA, dh_arm
from node import needs_node, run
from printed import value_of
from singular_sets import terms
from tiers import sampled, tiered

import pinsing
from pinsing.algebra.equation import Equation
from pinsing.families.at_once import JointForm, expressions, joint_form
from pinsing.kinematics.jacobian import ratios
from pinsing.notebook import mathml
from pinsing.robot.surd import exact_of, exact_text, surd
from pinsing.view.scene import sizes
from pinsing.view.viewer import engine_data, family_entries

DH = {
    "crx": CRX, "gofa": GOFA,
    # Offsets everywhere, and zeros that are no quarter turns.
    "odd": [
        (-90, 0.1, 0.2, 15), (0, 0.5, 0.03), (-90, 0.07, 0), (90, 0.02, 0.4, 10), (-90, 0.05, 0.06),
        (0, 0, 0.1),
    ],
}  # fmt: skip
"""Arms with offset wrists, and others by their names."""


@functools.cache
def arm_of(name: str) -> pinsing.Arm:
    return dh_arm(DH[name]) if name in DH else pinsing.load(name)


@functools.cache
def form_of(name: str) -> pinsing.ClosedForm:
    return pinsing.closed_form(arm_of(name))


def long_ones(form: pinsing.ClosedForm) -> list[tuple[pinsing.Family, JointForm]]:
    found = []
    for family in form.families:
        for branch in family.branches:
            solved = joint_form(branch.equations[0]) if len(branch.equations) == 1 else None
            if solved is not None and family.solved:
                found.append((family, solved))
    return found


ARMS = ["crx", "gofa", "odd", "panda", "xarm7"]


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(ARMS, {"odd"}))
def test_solved_values_are_singular_and_others_are_not(name: str) -> None:
    form = form_of(name)
    arm = form.geometry.arm
    rng = np.random.default_rng(5)
    found = long_ones(form)
    assert found
    for family, solved in found:
        branch = next(b for b in family.branches if solved.equation in b.equations)
        Q = rng.uniform(-np.pi, np.pi, (300, arm.n))
        for value in branch.values:
            Q[:, value.joint] = value.value
        values = solved.solve(Q)
        assert values.shape == (300, solved.solutions)
        full = np.repeat(Q[:, None], solved.solutions, axis=1)
        full[..., solved.joint] = values
        full = full.reshape(-1, arm.n)
        full = full[np.isfinite(full).all(axis=1)]
        assert len(full) >= 300  # these arms always have a value
        assert ratios(arm, full).max() < 1e-12
        beside = full.copy()
        beside[:, solved.joint] += rng.choice([-0.3, 0.3], len(full))
        other = [f for f in form.families if f is not family]
        clear = ~np.any([f.contains(beside, 1e-3) for f in other], axis=0) if other else True
        left = ratios(arm, beside)[clear]
        assert np.median(left) > 1e-3
        assert left.min() > 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crx", "panda"])
def test_there_are_no_other_values(name: str) -> None:
    _, solved = long_ones(form_of(name))[0]
    n = len(solved.equation.joints)
    rng = np.random.default_rng(8)
    for q in rng.uniform(-np.pi, np.pi, (40, n)):
        grid = np.linspace(-np.pi, np.pi, 721)
        Q = np.tile(q, (len(grid), 1))
        Q[:, solved.joint] = grid
        f = solved.equation(Q)
        crossed = grid[:-1][f[:-1] * f[1:] < 0]
        assert len(crossed) == 2
        for x in crossed:
            near = np.abs(np.sin((solved.solve(q) - x) / 2)).min()
            assert near < np.sin(0.01)


@pytest.mark.parametrize("name", sampled(["crx", "gofa", "odd", "panda", "ur5", "z1"]))
@pytest.mark.parametrize("exact", [False, True])
def test_grouping_changes_nothing(name: str, exact: bool) -> None:
    rng = np.random.default_rng(2)
    for equation in {e for f in form_of(name).families for e in f.equations}:
        Q = rng.uniform(-3, 3, (50, len(equation.joints)))
        for joint in equation.involved:
            parts = expressions(equation, joint, exact)
            angle = Q[:, joint] + equation.shift[joint]
            times = {
                "cos": lambda k, x=angle: np.cos(k * x), "sin": lambda k, x=angle: np.sin(k * x),
                "cos/2": lambda k, x=angle: np.cos(k * x / 2),
                "sin/2": lambda k, x=angle: np.sin(k * x / 2), "pow": lambda k, x=Q[:, joint]: x**k,
                "one": lambda k: 1.0,
            }  # fmt: skip
            total = sum(part(Q) * times[f](k) for (f, k), part in parts.items())
            value = equation(Q)
            factor = float(total @ value / (value @ value))
            assert factor == pytest.approx(1, abs=1e-9) or exact
            assert factor > 0
            np.testing.assert_allclose(total, factor * value, atol=1e-11 * factor * equation.size)
            assert all(joint not in part.involved for part in parts.values())


@pytest.mark.parametrize(
    "name", tiered(["crx", "gofa", "panda", "xarm7"], ("crx", "gofa", "panda"))
)
def test_what_is_printed_can_be_typed_in(name: str) -> None:
    form = form_of(name)
    rng = np.random.default_rng(3)
    for family, solved in long_ones(form):
        (one,) = family.solved
        assert one.condition == f"R cos({one.joint} - φ) = 0"
        assert "φ ± 90°" in one.solution
        for parts, tol in ((one.where, 1e-4), (one.exact, 1e-12)):
            assert [name for name, _ in parts] == ["R cos φ", "R sin φ"]
            for q in rng.uniform(-np.pi, np.pi, (5, form.geometry.arm.n)):
                branch = next(b for b in family.branches if solved.equation in b.equations)
                for value in branch.values:
                    q[value.joint] = value.value
                values = dict(zip(form.symbols, q, strict=True))
                a, b = (value_of(text, values) for _, text in parts)
                q[solved.joint] = math.atan2(b, a) + math.pi / 2
                assert ratios(form.geometry.arm, q)[0] < tol


def test_the_statement_is_short_and_says_what_it_means() -> None:
    form = form_of("crx")
    (family,) = form.families
    assert family.text == "R cos(q2 - φ) = 0, with φ given by q3, q4 and q5"
    assert "linear complex" in family.reason
    pitch = re.search(r"pitch (\S+) m/rad", family.reason)
    assert pitch
    state = pinsing.at(form.geometry.arm, family.generic)
    assert float(pitch[1]) == pytest.approx(state.lost[0].pitch, rel=1e-2)
    assert state.lost[0].kind == "screw"
    # 32 terms have become 8, and no line is longer than three of a terminal.
    assert max(len(text) for _, text in family.solved[0].where) < 240


def test_exact_numbers_survive_json() -> None:
    form = form_of("gofa")
    data = json.loads(form.to_json())
    equation = data["families"][0]["branches"][0]["equations"][0]
    assert all(re.fullmatch(r"-?\d+", x) for pair in equation["exact"] for x in pair)
    assert data["families"][0]["solved"][0]["joint"] == "q2"
    again = pinsing.ClosedForm.from_dict(data)
    assert again.families[0].solved == form.families[0].solved
    assert again.families[0].equations[0].exact == form.families[0].equations[0].exact
    # What was written before there were any is read as it was.
    del equation["exact"], data["families"][0]["solved"]
    older = pinsing.ClosedForm.from_dict(data)
    assert older.families[0].equations[0].exact == ()
    equation["exact"] = [["1", "2"]]
    with pytest.raises(pinsing.PinsingError, match="damaged"):
        pinsing.ClosedForm.from_dict(data)


def test_exact_coefficients_are_those_that_are_proven():
    """UR5: the lengths of its table, in units of 0.05 mm."""
    (equation,) = pinsing.closed_form(pinsing.load("ur5")).families[2].equations
    assert equation.exact_text() == "8500 cos q2 + 7845 cos(q2+q3) - 1893 sin(q2+q3+q4) = 0"
    assert "8500 \\cos q_{2}" in equation.exact_text(latex=True)
    number = surd(*(exact_of("1/2"), exact_of("0"), exact_of("-3"), exact_of("0")))
    assert exact_text(number) == "1/2 - 3 sqrt(3)"
    assert exact_of(exact_text(number)) == number
    for text in ("", "x", "1 2", "sqrt(2)", "1/2 3 sqrt(2)", "--1"):
        with pytest.raises(ValueError, match="exact number"):
            exact_of(text)


def test_the_command_writes_exact_coefficients(tmp_path: Path) -> None:
    file = tmp_path / "crx.urdf"
    file.write_text(arm_of("crx").source.xml)

    def said(*words: str) -> str:
        done = pinsing_command("families", file, "--no-prove", *words)
        assert done.exit_code == 0, repr(done.exception)
        return done.output

    assert "15552 cos q3" in " ".join(said("--exact").split())
    assert "15552" not in said()
    latex = said("--exact", "--latex")
    assert r"15552 \cos q_{3}" in latex
    assert latex.count(r"\quad &") == 2  # as stated, and exactly
    for row in re.findall(r"& (?:\\qquad )?(.*?)(?: \\\\)?$", latex, re.MULTILINE):
        assert "<math>" in mathml(row)
        assert "<code" not in mathml(row)


def made(rows: list[tuple[tuple[int, ...], tuple[int, ...], float, float]]) -> Equation:
    return terms(*rows, joints=("q1", "q2", "d3"), shift=(0.2, 0, 0))


@pytest.mark.parametrize(
    ("joint", "kind", "rows"),
    [
        (2, "length", [((2, 2, 0), (0, 0, 1), 1.0, 0.5), ((0, 4, 0), (0, 0, 0), 0.3, 0.0)]),
        (0, "half", [((1, 2, 0), (0, 0, 0), 1.0, 0.5), ((-1, 2, 0), (0, 0, 1), 0.3, -2.0)]),
        (1, "two", [((2, 2, 0), (0, 0, 0), 1.0, 0.5), ((0, 0, 0), (0, 0, 1), 0.3, 0.0)]),
        (1, "opposite", [((2, 2, 0), (0, 0, 0), 1.0, 0.5), ((4, -2, 0), (0, 0, 1), 0.3, 0.4)]),
    ],
)
def test_every_way_that_a_joint_can_enter_once(joint: int, kind: str, rows: Any) -> None:
    equation = made(rows)
    solved = joint_form(equation, joint)
    assert solved.kind == kind
    Q = np.random.default_rng(1).uniform(-1, 1, (200, 3))
    values = solved.solve(Q)
    assert values.shape == (200, solved.solutions)
    found = 0
    for k in range(solved.solutions):
        there = Q.copy()
        there[:, joint] = values[:, k]
        there = there[np.isfinite(there).all(axis=1)]
        found += len(there)
        size = 1 + np.abs(there).max(axis=1)
        assert (np.abs(equation(there)) < 1e-12 * size).all()
    assert found > 100
    name = equation.joints[joint]
    assert name in solved.condition()
    assert f"{'one value' if solved.solutions == 1 else 'one of two values'}" in solved.solution()
    assert "<code" not in mathml(solved.latex())


def test_what_enters_twice_is_not_solved() -> None:
    rows = [((4, 2, 0), (0, 0, 2), 1.0, 0.5), ((2, 4, 0), (0, 0, 0), 0.3, 0.2)]
    equation = made(rows)
    assert all(joint_form(equation, j) is None for j in range(3))
    assert joint_form(equation) is None
    nowhere = made([((2, 2, 0), (0, 0, 0), 0.1, 0.0), ((0, 0, 0), (0, 0, 0), 1.0, 0.0)])
    solved = joint_form(nowhere, 0)
    assert np.isnan(solved.solve(np.zeros(3))).all()


@pytest.mark.slow
@needs_node
def test_the_page_says_the_pitch_of_the_pose_shown() -> None:
    form = form_of("crx")
    arm = form.geometry.arm
    (family,) = form.families
    entries = family_entries(arm, form.families, 1)
    Q = family.sample(4, np.random.default_rng(6))  # no pitch within rounding of a line's, zero
    data = engine_data(arm, entries, sizes(arm))
    shown = run(
        "(m, {data, Q}) => Q.map((q) => m.frameAt(data, q))", {"data": data, "Q": Q.tolist()}
    )
    pitches = set()
    for q, here in zip(Q, shown, strict=True):
        (said,), (told,) = here["why"], [d.reason for d in pinsing.at(arm, q).dependences]
        mine, yours = (re.split(r"pitch (\S+) m/rad", words) for words in (said, told))
        assert mine[::2] == yours[::2]  # a complex here, a common line there
        if mine[1:]:
            assert float(mine[1]) == pytest.approx(float(yours[1]), rel=2e-3)
            pitches.add(mine[1])
    assert len(pitches) > 1
