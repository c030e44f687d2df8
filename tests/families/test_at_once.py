"""Long equations solved for joints, one or several at once: as read, and against Pinocchio."""

import functools
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run as pinsing_command
from dh_arms import CRX, GOFA, dh_arm
from node import ask, needs_node
from printed import value_of
from singular_sets import terms
from tiers import sampled, tiered

import pinsing
from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import Equation
from pinsing.families.at_once import SolvedFor, at_once, coefficients, solved, terms_text
from pinsing.families.describe import statement
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
def form_of(name: str) -> pinsing.ClosedForm:
    return pinsing.closed_form(dh_arm(DH[name]) if name in DH else pinsing.load(name))


def long_ones(form: pinsing.ClosedForm) -> list[tuple[pinsing.Family, Equation, SolvedFor]]:
    found = []
    for family in form.families:
        for branch in family.branches:
            one = solved(branch.equations[0]) if len(branch.equations) == 1 else None
            if one is not None and family.solved:
                found.append((family, branch.equations[0], one))
    return found


def values_of(equation: Equation, one: SolvedFor, Q: np.ndarray, exact: bool = True) -> np.ndarray:
    """What is printed of a joint (..., values), given the others of Q (..., n); NaN: nothing."""
    joints = dict(zip(equation.joints, np.moveaxis(Q, -1, 0), strict=True))
    part = {name: value_of(text, joints) for name, text in (one.exact if exact else one.where)}
    if "A" in part:
        return (part["c"] / part["A"])[..., None]
    cos, sin, c = part["R cos φ"], part["R sin φ"], part.get("c", 0.0)
    phi = np.arctan2(sin, cos)
    if "/2" in one.condition:
        found = (2 * phi + np.pi)[..., None]
    else:
        with np.errstate(invalid="ignore", divide="ignore"):
            turn = np.arccos(c / np.hypot(cos, sin))
        found = np.stack([phi + turn, phi - turn], axis=-1)
    return found - equation.shift[equation.joints.index(one.joint)]


ARMS = ["odd", "crx", "gofa", "panda", "xarm7"]


@pytest.mark.parametrize("name", tiered(ARMS, ("odd", "crx", "panda")))
def test_printed_values_are_singular_and_all_zeros_of_the_equation(name: str) -> None:
    form = form_of(name)
    arm = form.geometry.arm
    rng = np.random.default_rng(5)
    found = long_ones(form)
    assert found
    for family, equation, one in found:
        assert family.solved == (one,)
        rest = ["c"] * (name == "odd")
        assert one.condition == f"R cos({one.joint} - φ) = {'c' if rest else '0'}"
        assert ("φ ± arccos(c/R)" if rest else "φ ± 90°") in one.solution
        for parts in (one.where, one.exact):
            assert [part for part, _ in parts] == ["R cos φ", "R sin φ", *rest]
        Q = rng.uniform(-np.pi, np.pi, (300, arm.n))
        for value in next(b for b in family.branches if equation in b.equations).values:
            Q[:, value.joint] = value.value
        joint = equation.joints.index(one.joint)
        for exact, tol in ((False, 1e-4), (True, 1e-12)):
            full = np.repeat(Q, one.values, axis=0)
            full[:, joint] = values_of(equation, one, Q, exact).ravel()
            full = full[np.isfinite(full).all(axis=1)]
            assert len(full) >= 300  # these arms always have a value
            assert ratios(arm, full).max() < tol
        # And there are no other values.
        grid = np.linspace(-np.pi, np.pi, 721)
        for q in Q[:: 60 if name == "odd" else 8]:
            whole = np.tile(q, (len(grid), 1))
            whole[:, joint] = grid
            f = equation(whole)
            crossed = grid[:-1][f[:-1] * f[1:] < 0]
            off = values_of(equation, one, q) - crossed[:, None]
            assert len(crossed) == 2
            assert (np.abs(np.sin(off / 2)).min(axis=1) < np.sin(0.01)).all()


@pytest.mark.parametrize("name", sampled(["crx", "gofa", "odd", "panda", "ur5", "z1"]))
@pytest.mark.parametrize("exact", [False, True])
def test_grouping_changes_nothing(name: str, exact: bool) -> None:
    rng = np.random.default_rng(2)
    for equation in {e for f in form_of(name).families for e in f.equations}:
        Q = rng.uniform(-3, 3, (50, len(equation.joints)))
        for joint in equation.involved:
            parts = coefficients(equation, joint, exact)
            joints = dict(zip(equation.joints, Q.T, strict=True))
            angle = Q[:, joint] + equation.shift[joint]
            total = 0.0
            for (f, k), part in parts.items():
                times = {
                    "cos": np.cos(k * angle), "cos/2": np.cos(k * angle / 2), "one": 1.0,
                    "sin": np.sin(k * angle), "sin/2": np.sin(k * angle / 2), "pow": Q[:, joint]**k,
                }  # fmt: skip
                total = total + value_of(terms_text(part, equation), joints) * times[f]
            value = equation(Q)
            factor = float(total @ value / (value @ value))
            assert factor == pytest.approx(1, abs=1e-5) or exact
            assert factor > 0
            off = (1e-11 if exact else 2e-5) * factor * equation.size
            np.testing.assert_allclose(total, factor * value, atol=off)
            assert not any(j == joint for part in parts.values() for p in part for j, *_ in p)


def test_the_statement_is_short_and_says_what_it_means() -> None:
    form = form_of("crx")
    (family,) = form.families
    assert family.text == "R cos(q2 - φ) = 0, with φ given by q3, q4 and q5"
    assert "linear complex" in family.reason
    pitch = re.search(r"pitch (\S+) m/rad", family.reason)
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
    file.write_text(dh_arm(CRX).source.xml)

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
    return terms(*rows, joints=("q1", "q2", "d3"), shift=(np.radians(9.5), 0, 0))


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
    assert equation.enters(joint) == kind
    one = solved(equation, joint)
    Q = np.random.default_rng(1).uniform(-1, 1, (200, 3))
    values = values_of(equation, one, Q, exact=False)
    assert values.shape == (200, one.values)
    found = 0
    for k in range(one.values):
        there = Q.copy()
        there[:, joint] = values[:, k]
        there = there[np.isfinite(there).all(axis=1)]
        found += len(there)
        size = 1 + np.abs(there).max(axis=1)
        assert (np.abs(equation(there)) < 1e-12 * size).all()
    assert found > 100
    assert equation.joints[joint] in one.condition
    assert ("one value" if one.values == 1 else "one of two values") in one.solution
    assert "<code" not in mathml(one.latex)


def test_what_enters_twice_is_not_solved() -> None:
    equation = made([((4, 2, 0), (0, 0, 2), 1.0, 0.5), ((2, 4, 0), (0, 0, 0), 0.3, 0.2)])
    assert all(solved(equation, *joint) is None for joint in ((), (0,), (1,), (2,)))
    nowhere = made([((2, 2, 0), (0, 0, 0), 0.1, 0.0), ((0, 0, 0), (0, 0, 0), 1.0, 0.0)])
    assert np.isnan(values_of(nowhere, solved(nowhere, 0), np.zeros(3), exact=False)).all()


@pytest.mark.slow
@needs_node
def test_the_page_says_the_pitch_of_the_pose_shown() -> None:
    form = form_of("crx")
    arm = form.geometry.arm
    entries = family_entries(arm, form.families, 1)
    Q = form.families[0].sample(
        4, np.random.default_rng(6)
    )  # no pitch within rounding of a line's, zero
    data = engine_data(arm, entries, sizes(arm))
    shown = ask("Q.map((q) => m.frameAt(data, q))", data=data, Q=Q)
    pitches = set()
    for q, here in zip(Q, shown, strict=True):
        (said,), (told,) = here["why"], [d.reason for d in pinsing.at(arm, q).dependences]
        mine, yours = (re.split(r"pitch (\S+) m/rad", words) for words in (said, told))
        assert mine[::2] == yours[::2]  # a complex here, a common line there
        if mine[1:]:
            assert float(mine[1]) == pytest.approx(float(yours[1]), rel=2e-3)
            pitches.add(mine[1])
    assert len(pitches) > 1


SYMBOLS = ("q1", "q2", "q3", "q4", "q5")
POINT = np.random.default_rng(8).uniform(-1, 1, 5)


def long_equation(seed, once, others):
    """A random equation of 16 terms through a point; ``once`` enters once, the others twice."""
    rng = np.random.default_rng(seed)
    frequencies = np.zeros((15, 5), dtype=np.int64)
    frequencies[:, others] = rng.choice([-4, -2, 0, 2, 4], (15, len(others)))
    if once is not None:
        frequencies[:, once] = rng.choice([-2, 0, 2], 15)
        frequencies[0, once] = 2
    frequencies[1, others[0]], frequencies[2, others[-1]] = 4, 4
    return through(frequencies, *rng.normal(size=(2, 15)))


def through(frequencies, cos, sin):
    """An equation of these terms and the constant that makes it zero at a point."""
    none = [0] * 5
    rows = [(f, none, c, s) for f, c, s in zip(frequencies, cos, sin, strict=True)]
    return terms(*rows, (none, none, -float(terms(*rows)(POINT)), 0.0))


FIRST, SECOND = long_equation(1, 1, (2, 3)), long_equation(6, 2, (3,))


def test_more_equations_than_conditions_choose_among_the_values() -> None:
    cos, sin = [*FIRST.cos, *SECOND.cos / 2], [*FIRST.sin, *SECOND.sin / 2]
    third = through([*FIRST.frequencies, *SECOND.frequencies], cos, sin)
    found = at_once(Branch((), (FIRST, SECOND, third)), POINT, SYMBOLS)
    assert (found.follow, found.left) == (("q3", "q2"), 1)
    assert found.lines()[-1] == "the other equation says which of these values hold"


def test_other_sets_of_equations() -> None:
    """Where each joint enters with its double angle, too; one equation, and none; in one line."""
    pair = tuple(long_equation(k, None, (1, 2, 3)) for k in (5, 6))
    found = at_once(Branch((), pair), POINT, SYMBOLS)
    assert (found.steps, len(found.follow)) == ((), 2)
    assert "by solving the equations together" in found.lines()[1]
    for few in ((FIRST,), ()):
        assert at_once(Branch((), few), POINT, SYMBOLS) is None
    both = [Branch((), (FIRST, SECOND))], (), SYMBOLS, [False] * 5
    assert len(statement(*both, True)) < 70
    assert statement(*both) == "2 equations at once in q2, q3 and q4 [16 terms]"


def test_a_joint_that_an_equation_names_alone_is_given_nothing() -> None:
    """Of four equations one is about q5 only: a list of no joints was written, which failed."""

    def simple(*joints: int) -> Equation:
        return through([[2 * (j in joints) for j in range(5)]], [1.0], [0.5])

    four = (simple(4), simple(3, 4), simple(2, 3), FIRST)
    found = at_once(Branch((), four), POINT, SYMBOLS)
    assert found.follow == ("q5", "q4", "q3", "q2")
    assert found.steps[:2] == (
        "q5 has two solutions [2 terms]", "q4 has two solutions given q5 [2 terms]",
    )  # fmt: skip
