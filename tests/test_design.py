"""Lengths as symbols: the families, what was assumed, and where the design changes the answer."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from tiers import tiered

import pinsing
from pinsing.cli.app import command
from pinsing.description.dh_table import read_dh
from pinsing.description.dh_urdf import dh_to_urdf
from pinsing.errors import OptionError, UnknownNameError

ROOT = Path(__file__).parent.parent
TABLES = {
    "ur": ROOT / "docs" / "design" / "ur.dh.yaml",
    **{
        name: ROOT / "urdf" / f"{name}.dh.yaml"
        for name in ("puma560", "stanford", "irb1400", "scara", "planar3r", "iiwa14", "surgical7")
    },
}
LONG = 200.0  # a second at most, on a machine that is not busy
OFFSET = "a1,a2,a3,d4,a5,d6"
ARMS = {**{name: (name, True) for name in TABLES}, "irb1400 with a5": ("irb1400", OFFSET)}
made: dict[str, pinsing.DesignForm] = {}


def form_of(name):
    if name not in made:
        table, symbols = ARMS[name]
        made[name] = pinsing.closed_form(TABLES[table], symbols=symbols, seconds=LONG)
    return made[name]


def with_numbers(table, lengths):
    """The arm of a table whose lengths are those given."""
    rows = [
        replace(row, a=lengths.get(f"a{i}", row.a), d=lengths.get(f"d{i}", row.d))
        for i, row in enumerate(table.rows, 1)
    ]
    return pinsing.load(dh_to_urdf(replace(table, rows=tuple(rows))))


def random_lengths(form, rng):
    values = rng.integers(100, 999, len(form.symbols)) / 1000
    return dict(zip(form.symbols, (float(v) for v in values), strict=True))


@pytest.mark.parametrize("name", tiered(ARMS, ("stanford",)))
def test_with_numbers_put_in_it_is_the_numeric_answer(name, rng):
    form = form_of(name)
    assert form.complete
    table = read_dh(TABLES[ARMS[name][0]])
    lengths = random_lengths(form, rng)
    arm = with_numbers(table, lengths)
    numeric = pinsing.closed_form(arm, seconds=LONG)
    assert numeric.complete
    assert numeric.generic_rank == form.generic_rank
    met = set()
    for family in numeric.families:
        for q in family.sample(4, rng):
            on = {
                f.name
                for f in form.families
                if np.abs(form.residuals(f.name, q, lengths)).max() < 1e-9
            }
            assert on, (family.text, lengths)
            met |= on
    assert met == {f.name for f in form.families}
    for q in arm.space.sample(10, rng):
        assert all(np.abs(form.residuals(f.name, q, lengths)).max() > 1e-9 for f in form.families)


@pytest.mark.slow
def test_the_textbook_says_the_same():
    assert [f.text for f in form_of("puma560").families] == [
        "sin q5 = 0",
        "d4 cos q3 + a3 sin q3 = 0",
        "a2 cos q2 + a3 cos(q2+q3) - d4 sin(q2+q3) = 0",
    ]
    assert form_of("puma560").assumed == ("a2 ≠ 0",)
    assert [f.text for f in form_of("ur").families][-1] == (
        "a2 cos q2 + a3 cos(q2+q3) + d5 sin(q2+q3+q4) = 0"
    )
    assert {f.text for f in form_of("stanford").families} == {"sin q5 = 0", "sin q2 = 0", "d3 = 0"}


def test_a_wrist_offset_of_zero_splits_one_family_into_wrist_elbow_and_shoulder(rng):
    form = form_of("irb1400 with a5")
    assert len(form.families) == 1
    split = next(c for c in form.changes if c.condition == "a5 = 0")
    assert split.kind == "splits"
    assert set(split.into) == {f.text for f in form_of("irb1400").families}
    table = read_dh(TABLES["irb1400"])
    lengths = random_lengths(form, rng)
    for a5, count in ((lengths["a5"], 1), (0.0, 3)):
        arm = with_numbers(table, {**lengths, "a5": a5})
        assert len(pinsing.closed_form(arm, seconds=LONG).families) == count


@pytest.mark.parametrize("name", tiered(["puma560", "ur", "scara"], ()))
def test_what_is_singular_everywhere_is_so(name, rng):
    """Each design that is told, and each length that may be zero, with numbers."""
    form = form_of(name)
    table = read_dh(TABLES[name])
    told = {c.condition for c in form.changes if c.kind == "singular everywhere"}
    assert told
    for symbol in form.symbols:
        lengths = {**random_lengths(form, rng), symbol: 0.0}
        rank = pinsing.generic_rank(with_numbers(table, lengths))
        assert (rank < form.generic_rank) == (f"{symbol} = 0" in told), symbol
    for condition in told:
        zero = dict.fromkeys(condition.removesuffix(" = 0").split(" = "), 0.0)
        arm = with_numbers(table, {**random_lengths(form, rng), **zero})
        assert pinsing.generic_rank(arm) < form.generic_rank


MODIFIED = """name: modified
convention: modified
units: {angle: deg, length: m}
rows:
  - {alpha: 0, a: 0, d: 0.4, theta: 0, type: revolute, limits: [-170, 170]}
  - {alpha: -90, a: 0.1, d: 0, theta: -90, type: revolute, limits: [-170, 170]}
  - {alpha: 0, a: 0.5, d: 0.07, theta: 0, type: revolute, limits: [-170, 170]}
  - {alpha: -90, a: 0.05, d: 0.45, theta: 0, type: revolute, limits: [-170, 170]}
  - {alpha: 60, a: 0, d: 0, theta: 0, type: revolute, limits: [-170, 170]}
  - {alpha: -60, a: 0, d: 0.1, theta: 30, type: revolute, limits: [-170, 170]}
tool: {xyz: [0.1, 0, 0.2], rpy: [0, 0, 0]}
"""


@pytest.mark.slow
def test_modified_tables_and_twists_with_square_roots(tmp_path, rng):
    path = tmp_path / "modified.dh.yaml"
    path.write_text(MODIFIED)
    form = pinsing.closed_form(path, symbols="a2,a3,d3,a4,d4", seconds=LONG)
    assert form.complete
    lengths = random_lengths(form, rng)
    numeric = pinsing.closed_form(with_numbers(read_dh(path), lengths), seconds=LONG)
    for family in numeric.families:
        for q in family.sample(3, rng):
            assert any(
                np.abs(form.residuals(f.name, q, lengths)).max() < 1e-9 for f in form.families
            )


def test_lengths_of_a_urdf_are_named_after_its_joints(rng):
    arm = pinsing.load("ur5")
    form = pinsing.closed_form(arm, symbols=True)
    assert "elbow_joint_x" in form.symbols
    assert "elbow_joint_x cos q2" in form.families[-1].text
    for family in pinsing.closed_form(arm).families:
        for q in family.sample(3, rng):
            assert any(np.abs(form.residuals(f.name, q)).max() < 1e-9 for f in form.families)


def test_json_both_ways():
    form = form_of("puma560")
    again = pinsing.DesignForm.from_json(form.to_json())
    assert str(again) == str(form)
    q = np.linspace(0.1, 0.6, 6)
    assert again.residuals("F3", q) == pytest.approx(form.residuals("F3", q))


def test_what_makes_no_sense_is_refused():
    with pytest.raises(UnknownNameError, match="unknown length 'a9'"):
        pinsing.closed_form(TABLES["ur"], symbols=["a9"])
    with pytest.raises(OptionError, match="no length"):
        pinsing.closed_form(TABLES["ur"], symbols="")
    with pytest.raises(OptionError, match="do not go with"):
        pinsing.closed_form(TABLES["ur"], symbols=True, prove=True)
    with pytest.raises(OptionError, match="load it first"):
        pinsing.closed_form(str(TABLES["ur"]))


def test_the_command_line_keeps_symbols():
    call = CliRunner().invoke
    done = call(command, ["families", str(TABLES["puma560"]), "--symbolic", "a2,a3,d4"])
    assert done.exit_code == 0
    assert "a2 cos q2 + a3 cos(q2+q3) - d4 sin(q2+q3) = 0" in done.output
    assert "assumed: a2 ≠ 0" in done.output
    done = call(command, ["families", str(TABLES["puma560"]), "--symbolic", "--latex"])
    assert done.exit_code == 0
    assert r"\sin q_{5} = 0" in done.output
    for words in (["--symbolic", "a7"], ["--symbolic", "a2", "--prove"]):
        done = call(command, ["families", str(TABLES["puma560"]), *words])
        assert done.exit_code == 2
        assert "Traceback" not in done.output


DOC = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", tiered(ARMS, ("puma560", "iiwa14", "irb1400 with a5")))
def test_the_page_says_what_is_found(name):
    blocks = re.findall(r"```text\n(.*?)```", DOC, re.S)
    block = next(b for b in blocks if b.startswith(f"{name}\n"))
    form = form_of(name)
    said = [str(f) for f in form.families]
    said += [f"assumed: {', '.join(form.assumed)}"] if form.assumed else []
    said += [str(c) for c in form.changes]
    assert block.splitlines()[1:] == said
