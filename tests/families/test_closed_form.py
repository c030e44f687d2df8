"""Closed forms: agreement with the known ones, and arms made to be awkward."""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from singular_sets import (
    RIGHT,
    Array,
    Joint,
    build,
    check_families,
    check_search,
    closed,
    moves,
    random_arm,
)
from tiers import tiered

from pinsing.families import ClosedForm, Family, closed_form
from pinsing.families.family import latex_lines
from pinsing.families.solve import STEPS

ZERO = (0.0, np.pi)
PI, R = np.pi, RIGHT
Values = dict[int, tuple[float, ...]]


def value_sets(family: Family) -> set[tuple[tuple[int, float], ...]]:
    """Fixed joints (counted from 1) and values of all branches, angles modulo half of noise."""
    return {tuple((j + 1, round(v, 9) + 0.0) for j, v in b.items()) for b in family.values}


def product(values: Values) -> set[tuple[tuple[int, float], ...]]:
    choices = [[(j, round(float(v), 9) + 0.0) for v in vs] for j, vs in sorted(values.items())]
    return set(itertools.product(*choices))


def locus(constant: float, *terms: tuple[float, Any, tuple[int, ...]]) -> Callable[[Array], Array]:
    """A constant plus factors times the sine or cosine of sums of joints."""
    return lambda q: constant + sum(a * f(q[:, list(js)].sum(axis=1)) for a, f, js in terms)


def by_values(form: ClosedForm, *known: Values) -> list[Family]:
    """Check that the families of joint values are exactly these; return the others."""
    left = list(form.families)
    for values in known:
        match = [f for f in left if not f.equations and value_sets(f) == product(values)]
        assert len(match) == 1, f"{values} is not among {[str(f) for f in left]}"
        left.remove(match[0])
    return left


cos, sin = np.cos, np.sin
PUMA, IRB = np.arctan2(-0.4318, 0.0203), np.arctan2(-0.72, 0.12)
KNOWN: dict[str, tuple[tuple[Values, ...], Callable[[Array], Array] | None]] = {
    "stanford": (({2: ZERO}, {3: (0.0,)}, {5: ZERO}), None),
    "puma560": (
        ({5: ZERO}, {3: (PUMA, PUMA + np.pi)}),
        locus(0, (0.4318, cos, (1,)), (0.0203, cos, (1, 2)), (-0.4318, sin, (1, 2))),
    ),
    "irb1400": (
        ({5: ZERO}, {3: (IRB, IRB + np.pi)}),
        locus(0.15, (0.6, sin, (1,)), (0.12, sin, (1, 2)), (0.72, cos, (1, 2))),
    ),
    "ur5": (
        ({3: ZERO}, {5: ZERO}),
        locus(0, (0.425, cos, (1,)), (0.39225, cos, (1, 2)), (-0.09465, sin, (1, 2, 3))),
    ),
    "ur10": (
        ({3: ZERO}, {5: ZERO}),
        locus(0, (0.612, cos, (1,)), (0.5723, cos, (1, 2)), (-0.1157, sin, (1, 2, 3))),
    ),
    "planar3r": (({2: ZERO, 3: ZERO},), None),
    "scara": (({2: ZERO},), None),
    "wrist alone": (({2: ZERO},), None),
    "four parallel joints": (({2: ZERO, 3: ZERO},), None),
    "two joints, position": (({2: ZERO},), None),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_forms(name: str) -> None:
    values, equation = KNOWN[name]
    form = closed_form(AWKWARD[name]) if name in AWKWARD else closed(name)
    others = by_values(form, *values)
    assert len(others) == (equation is not None)
    for family in others:
        q = np.random.default_rng(1).uniform(-3, 3, (50, len(form.symbols)))
        both = np.stack([family.equations[0](q), equation(q)])
        assert np.linalg.matrix_rank(both, tol=1e-9) == 1


def test_steps_are_named_as_in_the_documentation() -> None:
    assert closed("ur5").steps == ("all minors",)
    page = (Path(__file__).parents[2] / "docs/explain/complete.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| ")]
    assert rows[1:] == list(STEPS)


def test_a_long_statement_in_latex_has_lines_that_fit_a_page() -> None:
    terms = [rf"{k}.5 \cos (2 q_{{{k}}}) \sin q_{{{k}}}" for k in range(1, 8)]
    long = rf"R \cos (q_{{2}} - \varphi) = 0,\ R \cos \varphi = a ({' + '.join(terms)} - 2) - 1"
    lines = latex_lines(long)
    assert lines[0] == r"R \cos (q_{2} - \varphi) = 0"
    assert " ".join(lines[1:]) == long.split(r",\ ")[1]
    assert max(map(len, lines)) < 130
    assert all(line.count("{") == line.count("}") for line in lines)
    together = r"\text{" + 100 * "a" + " + b}"  # braces are never torn
    assert latex_lines(together) == [together]


AWKWARD = {
    "one joint": build([Joint()]),
    "two parallel joints": build([Joint(), Joint(a=0.3)], (0.2, 0.0, 0.0)),
    "two joints, position": build([Joint(), Joint(a=0.3)], (0.2, 0.0, 0.0), "position"),
    "sliders only": build([Joint(slides=True), Joint(R, slides=True), Joint(R, slides=True)]),
    "slider twice": build([Joint(slides=True), Joint(slides=True, d=0.2), Joint(R)]),
    "wrist alone": build([Joint(), Joint(R), Joint(-R)]),
    "wrist, orientation": build([Joint(), Joint(R), Joint(-R)], task="orientation"),
    "four parallel joints": build([Joint(a=0.3)] * 4, (0.2, 0.0, 0.0)),
    "the same axis twice": build([Joint(), Joint(d=0.1), Joint(R, 0.2), Joint(R, 0.3)]),
    "five in two parallel groups": build(
        [Joint(), Joint(a=0.3), Joint(a=0.2), Joint(R, 0.1), Joint(a=0.25)], (0.1, 0.0, 0.0)
    ),
    "links turned by 45 degrees": build(
        [Joint(theta=PI / 4), Joint(R, 0.1, theta=PI / 4), Joint(a=0.4, theta=-PI / 4),
         Joint(R, 0.02, 0.4, theta=PI / 4), Joint(-R, theta=PI / 4), Joint(R)]
    ),
    "no elbow singularity": build(  # the reach of the second link exceeds what the first has
        [Joint(), Joint(R, 0.1), Joint(R, 0.5, 0.1)], (0.1, 0.02, 0.3), "position"
    ),
    # Where a row of the Jacobian, or all of it, vanishes.
    "all of the task lost": build([Joint(-R, 0.02), Joint(-R, d=-0.18)], task="vx,vy,wz"),
    "a column vanishes": build(
        [Joint(PI), Joint(R), Joint(R, 0.32)], (-0.16, -0.09, -0.2), "vx,vy"
    ),
    "one minor entry": build(
        [Joint(-R), Joint(-R), Joint(PI, 0.2, 0.1, slides=True), Joint(-R, -0.29, 0.39)],
        (0.09, -0.11, 0.18), "position",
    ),
    "RPR, position": build(
        [Joint(), Joint(R, slides=True), Joint(-R, 0.3)], (0.5, 0.1, 0), "vx,vy"
    ),
    "columns vanish, seven joints": build(
        [Joint(-R, d=0.4), Joint(R), Joint(R, -0.35, -0.17), Joint(-R), Joint(-R, d=-0.02),
         Joint(R, slides=True), Joint(-R, 0.35, -0.15)]
    ),
    "rows used up": build(
        [Joint(R, -0.09, -0.28), Joint(0, -0.14, -0.42), Joint(-R, d=-0.09), Joint(R, 0.3),
         Joint(R, -0.35, -0.46), Joint()]
    ),
    # Where roots are double, or three equations meet in points.
    "double roots": build(
        [Joint(R, d=0.01), Joint(PI, -0.47, 0.13, slides=True), Joint(R, d=-0.4),
         Joint(-R, d=-0.21), Joint(-R, d=0.35), Joint(R), Joint(R, d=0.48)],
        (-0.04, -0.21, 0.19),
    ),
    "three equations in two joints": build(
        [Joint(-R, 0.42, -0.06), Joint(R, 0.26, 0.08), Joint(R, -0.44, -0.07),
         Joint(-R, -0.37, slides=True), Joint(), Joint(R, 0.2)]
    ),
}  # fmt: skip
OPEN = {"five in two parallel groups", "rows used up"}
"""Arms for which an honest "not complete" will do."""


@pytest.mark.parametrize("name", tiered(AWKWARD, {*AWKWARD} - {"rows used up", "double roots"}))
def test_awkward_arms(name: str) -> None:
    arm = AWKWARD[name]
    form = closed_form(arm)
    check_families(arm, form, 120)
    if name not in OPEN:
        assert form.complete, form.gaps
    if form.complete:
        check_search(arm, form, 60)


def test_no_singularity_at_all() -> None:
    for name in ("one joint", "two parallel joints", "sliders only", "slider twice"):
        form = closed_form(AWKWARD[name])
        assert form.complete, name
        assert not form.families, name
        assert "no singular configurations: the rank is the same everywhere" in str(form)
        assert "no singular configurations known" in form.latex()


def cylindrical(low: float, high: float) -> ClosedForm:
    """Turntable, radial slider, and a link of 0.3 m that swings up: d2 + 0.3 cos q3 = 0."""
    slide = Joint(R, theta=R, slides=True, limits=(low, high))
    return closed_form(build([Joint(), slide, Joint(-R, theta=R)], (0.3, 0.0, 0.0), "position"))


@pytest.mark.parametrize(
    ("low", "high", "word"),
    [
        (-1.0, 1.0, "reachable"),
        pytest.param(0.1, 0.2, "reachable", marks=pytest.mark.slow),
        pytest.param(2.0, 3.0, "not reachable", marks=pytest.mark.slow),
        pytest.param(-np.inf, np.inf, "reachable", marks=pytest.mark.slow),
        (0.5, np.inf, "none found"),
        pytest.param(-np.inf, 0.25, "reachable", marks=pytest.mark.slow),
    ],
)
def test_limits_of_a_slider_hide_no_family(low: float, high: float, word: str) -> None:
    form = cylindrical(low, high)
    assert form.complete
    assert form.dropped == 0
    (mixed,) = (f for f in form.families if f.equations)
    assert mixed.reachability == word
    Q = mixed.points(20, np.random.default_rng(1))
    assert len(Q) == 20
    inside = mixed.sample(20, np.random.default_rng(1))
    assert len(inside) == (20 if word == "reachable" else 0)
    assert (inside[:, 1] >= low - 1e-9).all()
    assert (inside[:, 1] <= high + 1e-9).all()


def test_lengths_snapped_away_may_lower_the_rank() -> None:
    arm = build([Joint(), Joint(a=0.001), Joint(R, 0.3)], (0.3, 0.0, 0.0))
    assert closed_form(arm).generic_rank == 3
    form = closed_form(arm, snap_length=0.01)
    assert form.generic_rank == 2
    assert form.snaps
    assert form.complete
    assert not form.families


TASKS = ("position", "orientation", "vx,vy", "vx,vy,wz", "vz", "vx,vy,vz,wx")


def check_random(seed: int, kind: str, task: str = "pose", joints: int | None = None) -> bool:
    """Whatever is said about an arm drawn at random is true; returns whether all was said."""
    arm = random_arm(seed, kind, task, joints)
    if not moves(arm):
        return True
    form = closed_form(arm, seconds=5.0)
    # Surfaces that touch each other tell their common points to half of the digits; and near
    # them sigma_r grows with the square of the distance.
    exact = task == "pose" and form.fully_decomposed
    check_families(arm, form, 60, tol=1e-9 if exact else 1e-5)
    if form.complete:
        check_search(arm, form, 40, tol=1e-5 if exact else 1e-3)
    return form.complete or form.generic_rank < 6


@pytest.mark.parametrize("seed", tiered(range(16), (0, 2, 5, 7)))
def test_random_arms(seed: int) -> None:
    assert check_random(500 + seed, ("right", "tilted", "turned", "right")[seed % 4])


@pytest.mark.parametrize("seed", tiered(range(8), {*range(8)} - {5}))
def test_random_tasks(seed: int) -> None:
    check_random(700 + seed, "right", TASKS[seed % len(TASKS)], joints=2 + seed % 3)
