"""Slices over small finite fields, where nothing is proven; components that lie in others."""

import itertools
import random
from copy import copy
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from arms import planar
from flint import nmod_mat
from public import script
from tiers import tiered

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import Component, inside, settled
from pinsing.algebra.ring import make_ring
from pinsing.families import slices
from pinsing.families.form import families_html, families_text
from pinsing.families.slices import ModularChain, joints_that_matter, without_inner
from pinsing.families.solve import ComponentSearch
from pinsing.robot.mimic import own_jacobian_modulo
from pinsing.robot.nominal import nominal

field = script("oracle.field")


@pytest.fixture(scope="module")
def panda():
    return pinsing.load("panda", tip="panda_hand_tcp")


@pytest.fixture(scope="module")
def kept(panda):
    """What a search of the Panda's families comes to."""
    found = ComponentSearch(nominal(panda), Budget(120), 0.002).run()
    assert not found.gaps
    return found


@pytest.fixture
def given(kept, panda):
    return kept.maker.geometry, panda.task, kept.maker.ring


def every_point(chain, n, chosen):
    """Singular points that are met of a slice, in a set, and all its points, x and y (n, N)."""
    met = np.concatenate(chain.singular(chosen, random.Random(3)))
    draw, values = random.Random(3), [chain.every(j) for j in range(n)]
    at = [draw.randrange(len(v[0])) for v in values]
    axes = [range(len(v[0])) if j in chosen else [at[j]] for j, v in enumerate(values)]
    index = np.stack([i.ravel() for i in np.meshgrid(*axes, indexing="ij")])
    x, y = (np.stack([v[k][i] for v, i in zip(values, index, strict=True)]) for k in (0, 1))
    return {tuple(p) for p in met.T.tolist()}, x, y


# In a field of 13 minus one is a square: where x^2 + y^2 is zero there is no angle.
@pytest.mark.parametrize("prime", [13, 23, 47])
@pytest.mark.parametrize("chosen", [(3,), (1, 3), (4, 5), (1, 5), (1, 2, 5)])
def test_all_singular_points_of_a_slice_are_met_and_no_others(kept, prime, chosen):
    if len(chosen) == 3 and prime > 23:
        chosen = chosen[:2]
    met, x, y = every_point(ModularChain(kept.maker.geometry, kept.task, prime), 7, chosen)
    assert ((x * x + y * y) % prime).all()
    points = field.Points(prime, x.astype(np.int32), y.astype(np.int32))
    ranks = field.ranks(field.jacobians(kept.maker.geometry, range(6), points), prime)
    assert met == {tuple(p) for p in np.concatenate([x, y])[:, ranks < 6].T.tolist()}
    assert met or (prime, chosen) != (13, (1, 5))


def test_all_points_lie_on_complete_families_and_one_less_is_noticed(kept, given):
    whole = slices.count_on_slices(*given, kept.components, 2, Budget(60))
    assert (whole.joints, whole.slices, whole.choices, whole.off) == (2, 10, 10, 0)
    assert whole.points > 10
    less = (
        slices.count_on_slices(*given, [c for c in kept.components if c is not out], 2, Budget(60))
        for out in kept.components
    )
    assert any(count.off for count in less)


def test_what_is_missing_is_a_gap_and_what_is_not_is_evidence(panda, kept, monkeypatch):
    monkeypatch.setattr(ComponentSearch, "run", lambda self: kept)
    assert pinsing.closed_form(panda, prove=False).slice_count is None  # nothing is open
    open_end = copy(kept)
    open_end.gaps = ["one branch was left"]
    monkeypatch.setattr(ComponentSearch, "run", lambda self: open_end)
    form = pinsing.closed_form(panda, seconds=60, prove=False)
    said = form.slice_count.sentence()
    assert said.startswith("all ")
    assert "10 random slices of 2 joints" in said
    assert form.word == "not complete"
    assert f"evidence, no proof: {said}" in " ".join(families_text(form).split())
    assert "evidence, no proof" in families_html(form)
    assert pinsing.ClosedForm.from_json(form.to_json()).slice_count == form.slice_count
    less = copy(open_end)
    less.components = []
    monkeypatch.setattr(ComponentSearch, "run", lambda self: less)
    form = pinsing.closed_form(panda, seconds=60)
    assert form.slice_count.off == form.slice_count.points > 0
    assert any("lie on no family" in gap and "something is missing" in gap for gap in form.gaps)
    assert "evidence" not in families_text(form)


def test_slices_lead_to_what_is_missing(kept, given):
    at_values = next(c for c in kept.components if len(c.values) > 1)
    some = [c for c in kept.components if c is not at_values]
    found = slices.SliceSearch(*given, some, 2, Budget(60))
    found.run()
    assert found.enough
    assert found.count.off == 0
    assert found.count.met >= 0.8 * found.count.known
    assert len(found.count.primes) >= 3
    assert at_values.values in [c.values for c in found.components]
    assert len(found.components) == len(kept.components)


def test_what_contradicts_and_is_not_followed_for_want_of_time_is_no_answer(
    kept, given, monkeypatch
):
    out = next(c for c in kept.components if len(c.values) > 1)
    known = [c for c in kept.components if c is not out]
    turn, turns, time = slices.Slices.turn, [], Budget(60)

    def told(self, prime, budget):
        points = turn(self, prime, budget)
        turns.append(prime)
        if len(turns) < 9:
            return points.at(points.on(known).any(axis=0))
        time.spend(1e12 * bool(len(points.left(known))))
        return points

    monkeypatch.setattr(slices.Slices, "turn", told)
    found = slices.SliceSearch(*given, known, 2, time)
    monkeypatch.setattr(found, "_done", lambda: False)
    found.run()
    assert (found.count.off, found.count.met) == (0, len(known))
    assert not found.enough


def test_with_little_known_and_no_time_nothing_is_said(given):
    found = slices.SliceSearch(*given, [], 2, Budget(1e-6))
    found.run()
    assert (found.enough, found.components) == (False, [])
    count = slices.SliceCount(4, 1, 35, 0, 0, 23, 31)
    assert count.sentence().startswith("no singular point was met on one random slice of 4 joints")
    assert replace(count, points=2_000, off=1).sentence().startswith("1 of 2,000 singular points")


@pytest.mark.slow
def test_real_points_lead_where_no_slice_does(kept, given, monkeypatch):
    real = slices.RandomSingular.of(kept.maker)
    assert not real.off(kept.components).any()

    def none(self, prime, time):
        raise ValueError

    monkeypatch.setattr(slices.Slices, "turn", none)
    tried = 0
    for out in kept.components:
        others = [c for c in kept.components if c is not out]
        if not out.values or not real.off(others).any():
            continue
        tried += 1
        found = slices.SliceSearch(*given, others, 2, Budget(60), real=real)
        found.run()
        assert not real.off(found.components).any()
        assert not found.enough  # no slice was asked
    assert tried


class Told(slices.SlicePoints):
    """Points of which it is told which of them each component has."""

    def held(self, component):
        return np.array(self.of["small" if component.values[0] == (0, 1) else "large"][self.prime])


def test_values_that_are_the_same_over_one_field_alone_stay_apart():
    """q3 = 180°, sin q4 = 0.536 has, modulo 7, only points at q4 = 90°: it was dropped."""
    small, large = (Component({0: v}, (), True, 1) for v in ((0, 1), (1, 0)))
    known = [small, large]
    every, some, none = [True] * 20, [True] * 10 + [False] * 10, [False] * 20

    def left(small, large, off=None):
        both = {"small": small, "large": large}
        of = {name: dict(zip((7, 11), held, strict=True)) for name, held in both.items()}
        return slices.without_parts([Told(of, p, 1, None, None) for p in (7, 11)], known, off)

    for second in (none, some):  # ten points are too few to tell
        assert left((every, second), (every, every)) == known
    assert len(left((every, every), (every, every))) == 1
    assert left((every, every), (every, [True] * 15 + [False] * 5)) == [small]

    def off(components):  # one real point on each alone
        return ~np.array([small in components, large in components])

    assert left((every, every), (every, every), off) == known


def test_no_points_are_on_no_component():
    """Slices of a KUKA with a tool have none of some kind, before any component is known."""
    empty = np.zeros((0, 4), dtype=int), np.zeros((2, 6, 0), dtype=int)
    none = slices.SlicePoints(None, 7, 1, *empty)
    assert none.on([]).shape == (0, 0)
    assert len(none.left([])) == 0


TASKS = [
    ("ur5", "vx,vy,vz,wz"), ("stanford", "position"), ("kinova", "tool-axis"),
    ("irb1400", "vx@tip,vy@tip,wz"), ("panda", "vz,wx@tip"), ("xarm7", "orientation"),
]  # fmt: skip


@pytest.mark.parametrize(("robot", "task"), TASKS)
@pytest.mark.parametrize("chosen", tiered([(4,), (1, 3), (2, 5), (0, 4)], {(4,)}))
def test_rows_lose_rank_at_all_points_of_a_slice_that_are_met_and_no_others(robot, task, chosen):
    arm, prime = pinsing.load(robot, task=task), 23
    geometry = nominal(arm)
    met, *points = every_point(ModularChain(geometry, arm.task, prime), arm.n, chosen)
    expected = set()
    for x, y in zip(*(p.T.tolist() for p in points), strict=True):
        exact = {
            j: (Fraction(a),) if arm.prismatic[j] else (Fraction(a), Fraction(b))
            for j, (a, b) in enumerate(zip(x, y, strict=True))
        }
        rows = own_jacobian_modulo(geometry, arm.task, prime, random.Random(1), exact)
        if nmod_mat(len(rows), arm.n, [*itertools.chain(*rows)], prime).rank() < len(rows):
            expected.add((*x, *y))
    assert met == expected


def test_slices_with_singular_points_and_lengths_that_are_zero():
    arm = pinsing.load("ur5", task="vx,vy,vz,wz")
    chain = ModularChain(nominal(arm), arm.task, 19)
    draw = random.Random(1)
    assert sum(chain.singular((2, 3, 4), draw)[0].shape[1] for _ in range(3))
    arm = planar((0.19, 0.3), "vx,vy")
    geometry = nominal(arm)
    assert ModularChain(geometry, arm.task, 19).short_everywhere()
    assert not ModularChain(geometry, arm.task, 23).short_everywhere()


@pytest.mark.parametrize(
    ("task", "expected"),
    [
        ("pose", (1, 2, 4)), ("position", (1, 2)), ("vx,vy,vz,wz", (1, 2, 3, 4)),
        ("vx,wz", (0, 1, 2, 3, 4)), ("tool-axis", (1, 2, 4, 5)), ("vx@tip", (1, 2, 3, 4, 5)),
    ],
)  # fmt: skip
def test_joints_that_matter(task, expected):
    arm = pinsing.load("puma560", task=task)  # its tip is where the axes of its wrist meet
    if task == "tool-axis":  # about x: the last joint turns about z
        arm = pinsing.load("puma560", task=task, tool_axis="x")
    assert joints_that_matter(nominal(arm), arm.task) == expected


def test_a_value_that_another_one_leaves_is_a_value():
    ring = make_ring([False] * 3 + [True])
    x1, y1, x2, y2, x3, y3, d4 = ring.context.gens()
    c = Component({}, (x1 - y1, x1 * x2 + y1 * x2, x2 * d4 + 2 * y2 * d4 - y2, y3 - x3), False, 4)
    found = settled(c, ring)
    # 2 x2 = 0 once q1 is put in, and d4 once q2 is.
    assert found.values == {0: (1, 1), 1: (0, 1), 2: (1, 1), 3: (Fraction(1, 2),)}
    assert (found.relations, found.codimension) == ((), 4)
    # What fixes no joint stays: of the second two values, of which none is exact.
    for relation in (x1 * x2 - 3 * y1 * y2, x1 * x1 - 2 * y1 * y1):
        c = Component({}, (relation,), True, 1)
        assert settled(c, ring) == c


def test_points_tell_what_division_does_not():
    ring = make_ring([False] * 3)
    x1, y1, x2, y2, x3, y3 = ring.context.gens()
    small = 3 * x1**2 + x1 * y1 - 2 * y1**2
    tied = x1 * x2 - 5 * y1 * y2
    other = x1 * x2 - 7 * y1 * y2
    # Zero where both are, but a multiple of neither.
    mixed = small * (x2**2 + 2 * x2 * y2) * x3 + tied * x1 * (4 * x2 * y3 - y2 * x3)
    large = Component({}, (mixed,), True, 1)
    inner = Component({}, (small, tied), True, 2)
    apart = Component({}, (small, other), True, 2)
    assert not inside(inner, large, ring)
    every = [large, inner, apart]
    assert without_inner(every, [inner, apart], ring, Budget(5)) == [large, apart]
    # What is not doubted stays, and so does all without time.
    for doubted, seconds in (([], 5), ([inner, apart], 0)):
        assert without_inner(every, doubted, ring, Budget(seconds)) == every
    # Of two statements of one set one stays.
    twin = Component({}, (small, small * y2 + tied * y1), True, 2)
    assert without_inner([inner, twin], [inner, twin], ring, Budget(5)) in ([inner], [twin])


@pytest.mark.slow
@pytest.mark.parametrize("tip", ["left_hand_index_1_link", "right_hand_middle_1_link"])
def test_pieces_of_a_stopped_search_do_not_keep_an_answer_open(tip):
    """All minors of these nine joints have two seconds here, and leave isolated values behind."""
    arm = pinsing.load("g1_29dof_with_hand_rev_1_0", tip=tip, base="torso_link")
    form = pinsing.closed_form(arm, seconds=20)
    assert form.slice_count is not None
    assert form.complete
