"""Lengths as symbols: the families, what was assumed, and where the design changes the answer."""

import functools
import itertools
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from dh_arms import dh_text
from singular_sets import terms
from tiers import tiered

import pinsing
from pinsing.description.dh_table import bare_urdf, read_dh
from pinsing.errors import OptionError, UnknownNameError
from pinsing.families.design import unreal
from pinsing.kinematics.jacobian import generic_rank, ratios

ROOT = Path(__file__).parents[2]
TABLES = {
    "ur": ROOT / "docs" / "design" / "ur.dh.yaml",
    **{
        name: ROOT / "urdf" / f"{name}.dh.yaml"
        for name in ("puma560", "stanford", "irb1400", "scara", "planar3r", "iiwa14", "surgical7")
    },
}
LONG = 200.0  # a second at most, on a machine that is not busy
ARMS = {
    **{name: (name, True) for name in TABLES},
    "irb1400 with a5": ("irb1400", "a1,a2,a3,d4,a5,d6"),
    "ur, twist of its wrist": ("ur", "a2,a3,d5,alpha4"),
    "stanford, twist of its shoulder": ("stanford", "d2,alpha2"),
    "scara, one axis tilted": ("scara", "a1,a2,alpha1"),
}


@functools.cache
def form_of(name):
    table, symbols = ARMS[name]
    return pinsing.closed_form(TABLES[table], symbols=symbols, seconds=LONG)


def on(form, q, lengths=None):
    """Families that a configuration is on."""
    off = {f.name: np.abs(form.residuals(f.name, q, lengths)).max() for f in form.families}
    return {name for name, size in off.items() if size < 1e-9}


def zeros(change):
    """Lengths that are zero where it happens."""
    return frozenset(change.condition.removesuffix(" = 0").split(" = "))


def with_numbers(table, lengths, task="pose"):
    """The arm of a table whose lengths and twists are those given; what slides has room."""
    rows = [
        replace(
            row,
            a=lengths.get(f"a{i}", row.a),
            d=lengths.get(f"d{i}", row.d),
            alpha=lengths.get(f"alpha{i}", row.alpha),
            **({"lower": -9.0, "upper": 9.0} if row.type == "prismatic" else {}),
        )
        for i, row in enumerate(table.rows, 1)
    ]
    return pinsing.load(bare_urdf(replace(table, rows=tuple(rows))), tip="tool0", task=task)


def random_lengths(form, rng):
    """Lengths in metres, and twists near half of a right angle."""
    values = rng.integers(100, 999, len(form.symbols)) / 1000
    values[list(form.angles)] += 0.25
    return dict(zip(form.symbols, (float(v) for v in values), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(ARMS, ("stanford",)))
def test_with_numbers_put_in_it_is_the_numeric_answer(name, rng):
    form = form_of(name)
    lengths = random_lengths(form, rng)
    arm = with_numbers(read_dh(TABLES[ARMS[name][0]]), lengths)
    numeric = pinsing.closed_form(arm, seconds=LONG)
    assert form.complete
    assert (numeric.complete, numeric.generic_rank) == (True, form.generic_rank)
    met = set()
    for family in numeric.families:
        for q in family.sample(4, rng):
            assert on(form, q, lengths), (family.text, lengths)
            met |= on(form, q, lengths)
    assert met == {f.name for f in form.families}
    assert not any(on(form, q, lengths) for q in arm.space.sample(10, rng))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", tiered(["planar 4R", "stanford", "puma560", "ur", "scara"], {"stanford"})
)
def test_what_is_singular_everywhere_is_so_and_nothing_else(name, tmp_path, rng):
    """Lengths that are zero, up to three at once."""
    path, task = tmp_path / "planar4.dh.yaml", "vx,vy"
    path.write_text(dh_text([(0, a, 0) for a in (0.4, 0.3, 0.2, 0.1)]))
    if name != "planar 4R":
        path, task = TABLES[name], "pose"
    form = pinsing.closed_form(pinsing.load(path, task=task), symbols=True, seconds=LONG)
    told = [zeros(c) for c in form.changes if c.kind == "singular everywhere"]
    assert len(told) == len(set(told)) > 0 or name == "stanford"
    assert all(len(some) < 4 for some in told)
    assert len(told) == 4 or name != "planar 4R"
    table, lengths = read_dh(path), random_lengths(form, rng)
    for size in (1, 2, 3):
        for some in itertools.combinations(form.symbols, size):
            arm = with_numbers(table, {**lengths, **dict.fromkeys(some, 0.0)}, task)
            less = generic_rank(arm) < form.generic_rank
            assert less == any(t <= set(some) for t in told), some


TOOL = "tool: {xyz: [0.1, 0, 0.2], rpy: [0, 0, 0]}\n"
MODIFIED = [(0, 0, 0.4), (-90, 0.1, 0, -90), (0, 0.5, 0.07), (-90, 0.05, 0.45), (60, 0, 0)]
MODIFIED.append((-60, 0, 0.1, 30))
TOOLED = [
    (90, 0.1, 0.4, 0, "continuous"), (90, 0.3, 0, 90, "continuous"),
    (-90, 0, 0.1, 0, "prismatic", (-0.5, 0.5)), (0, 0, 0.1, 0, "continuous"),
]  # fmt: skip
# A tool and what is added to a slider are no lengths.
WITH_TOOLS = {
    "modified, twists with square roots": (
        dh_text(MODIFIED, (-170, 170), "modified"), "a2,a3,d3,a4,d4", "tool0", "pose",
    ),
    "tool": (dh_text(TOOLED), "a2", "tool0", "position"),
    "flange": (dh_text(TOOLED), "a2", "flange", "position"),
}  # fmt: skip


@pytest.mark.parametrize("name", tiered(WITH_TOOLS, ("tool", "flange")))
def test_tables_with_a_tool(name, tmp_path, rng):
    text, symbols, tip, task = WITH_TOOLS[name]
    path = tmp_path / "tooled.dh.yaml"
    path.write_text(text + TOOL)
    arm = pinsing.load(path, tip=tip, task=task)
    form = pinsing.closed_form(arm, symbols=symbols, seconds=LONG)
    assert form.complete
    numeric = pinsing.closed_form(arm, seconds=LONG)
    assert numeric.families
    for q in np.concatenate([f.sample(3, rng) for f in numeric.families]):
        assert on(form, q)


def test_a_family_of_more_equations_than_joints_is_one_of_special_lengths(tmp_path, rng):
    path = tmp_path / "elbow.dh.yaml"
    rows = [(90, 0, 0.3), (-90, 0, 0), (90, 0.05, 0.4), (-90, -0.05, 0), (90, 0, 0.4)]
    rows += [(90, 0.08, 0), (0, 0, 0.1)]
    path.write_text(dh_text([(*row, 0, "continuous") for row in rows]))
    form = pinsing.closed_form(path, symbols="a3,a4,a6", seconds=LONG)
    assert form.complete
    for family in form.families:
        moved = {j for e in family.equations for j in e.joints if j.startswith("q")}
        assert len(moved) >= len(family.equations)
    (change,) = [c for c in form.changes if c.condition == "a3 + a4 = 0"]
    assert change.kind == "appears"
    assert "2 cos(q4/2) - 5 a3 sin(q4/2) = 0" in change.into[0]
    # In numbers: there at a4 = -a3, whatever the other joints do; not at lengths nearby.
    for a3, a4, singular in [(0.07, -0.07, True), (0.07, -0.071, False), (0.07, 0.07, False)]:
        arm = with_numbers(read_dh(path), {"a3": a3, "a4": a4, "a6": 0.03})
        Q = rng.uniform(-3, 3, (50, 7))
        Q[:, 3] = 2 * math.atan(0.4 / a3)
        assert ratios(arm, Q).max() < 1e-12 if singular else ratios(arm, Q).max() > 1e-5


def test_a_family_without_configurations_is_told(rng):
    """IRB 1400's third family needs a1 within the reach of the other two links."""
    form = form_of("irb1400")
    (change,) = (c for c in form.changes if c.kind == "vanishes")
    assert change.condition == "|a1| > sqrt(d4^2 + a3^2) + |a2|"
    lengths = dict(zip(form.symbols, form.values, strict=True))
    reach = math.hypot(lengths["d4"], lengths["a3"]) + lengths["a2"]
    table = read_dh(TABLES["irb1400"])
    for a1, count in ((0.99 * reach, 3), (1.01 * reach, 2)):
        found = pinsing.closed_form(with_numbers(table, {**lengths, "a1": round(a1, 4)}))
        assert len(found.families) == count


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([("cos", 1, 0, 1, 0), ("one", 1, 1, 0, 0)], "|a1| > |a2|"),
        ([("sin", 1, 0, 1, 1), ("one", 1, 1, 1, 0)], "|a1| > |a3|"),
        ([("cos", 2, 1, 1, 0), ("sin", 1, 1, 0, 1), ("one", 1, 2, 0, 0), ("one", -1, 0, 2, 0)],
         None),
        ([("cos", 1, 0, 1, 0)], ""),
    ],
)  # fmt: skip
def test_when_an_equation_has_no_solution(rows, said):
    """Terms of cos q1, sin q1 and 1 with powers of a1, a2, a3: against the values on a grid."""
    e = terms(
        *(((2 * (k != "one"), 0, 0, 0), (0, *p), c * (k != "sin"), c * (k == "sin"))
          for k, c, *p in rows),
        joints=("q1", "a1", "a2", "a3"),
    )  # fmt: skip
    exact = tuple((("0", str(c)) if k == "sin" else (str(c), "0")) for k, c, *_ in rows)
    e = replace(e, exact=exact)
    condition = unreal(e, 1)
    assert said is None or condition == said
    if not condition:
        return
    python = re.sub(r"\|([^|]*)\|", r"abs(\1)", condition).replace("^", "**")
    python = re.sub(r"(\d|a\d(?:\*\*\d)?) (?=[a\d])", r"\1*", python)
    q = np.linspace(-np.pi, np.pi, 2001)
    both = set()
    for lengths in np.random.default_rng(4).uniform(-2, 2, (40, 3)):
        values = e(np.column_stack([q, np.broadcast_to(lengths, (len(q), 3))]))
        named = dict(zip(("a1", "a2", "a3"), lengths, strict=True))
        empty = eval(python, {"sqrt": np.sqrt, "abs": abs}, named)
        both.add(empty)
        assert empty == (values.min() > 0 or values.max() < 0)
    assert both == {True, False}


def test_a_twist_that_makes_all_axes_parallel_brings_its_family_back():
    form = form_of("scara, one axis tilted")
    assert not form.families
    (more,) = (c for c in form.changes if c.kind == "appears")
    assert (more.condition, more.into) == ("sin alpha1 = 0", ("sin q2 = 0",))


def test_twists_are_angles_in_text_and_json():
    form = form_of("stanford, twist of its shoulder")
    assert "alpha2 = 90°" in str(form)
    assert form.families[-1].text == "d2 cos alpha2 + d3 = 0"
    merged = {c.condition for c in form.changes if c.kind == "merges"}
    assert merged == {"d2 = 0", "alpha2 = 90°", "alpha2 = -90°"}
    assert r"\alpha_{2}" in form.families[-1].latex
    again = pinsing.families.DesignForm.from_json(form.to_json())
    assert (again.angles, str(again)) == (form.angles, str(form))
    q = np.linspace(0.1, 0.6, 6)
    assert again.residuals("F3", q) == pytest.approx(form.residuals("F3", q))


def test_lengths_of_a_urdf_are_named_after_its_joints(rng):
    arm = pinsing.load("ur5")
    form = pinsing.closed_form(arm, symbols=True)
    assert "elbow_joint_x" in form.symbols
    assert "elbow_joint_x cos q2" in form.families[-1].text
    assert r"\mathrm{elbow\_joint\_x} \cos q_{2}" in form.families[-1].latex
    for family in pinsing.closed_form(arm).families:
        assert all(on(form, q) for q in family.sample(3, rng))


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"symbols": ["a9"]}, UnknownNameError, "unknown length 'a9'"),
        ({"symbols": ""}, OptionError, "no length"),
        ({"symbols": True, "prove": True}, OptionError, "do not go with"),
    ],
)
def test_what_makes_no_sense_is_refused(options, error, said):
    with pytest.raises(error, match=said):
        pinsing.closed_form(TABLES["ur"], **options)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a2,a3,d4"], "a2 cos q2 + a3 cos(q2+q3) - d4 sin(q2+q3) = 0"),
        (["--latex"], r"\sin q_{5} = 0"), (["a2", "--prove"], None),
    ],
)  # fmt: skip
def test_the_command_line_keeps_symbols(words, said):
    words = ["families", str(TABLES["puma560"]), "--symbolic", *words]
    done = run(*words)
    assert done.exit_code == (0 if said else 2)
    assert (said or "error: ") in done.output + done.stderr
    assert "Traceback" not in done.output
