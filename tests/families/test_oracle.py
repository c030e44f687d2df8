"""Closed forms against finite fields: an oracle that knows nothing of the search.

scripts/oracle runs thousands of chains; here are sixty, the one that once was answered
wrongly, and proof that a wrong answer is noticed.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pinocchio as pin
import pytest
from public import script

from pinsing.algebra.budget import Budget
from pinsing.algebra.components import decompose
from pinsing.algebra.ring import make_ring
from pinsing.families import closed_form
from pinsing.postures import aspects
from pinsing.robot.load import load
from pinsing.robot.task import parse_task

GROUPS, CHAINS = 30, 2
oracle, field, chains = (script(f"oracle.{name}") for name in ("run", "field", "chains"))


@pytest.mark.parametrize(
    "group", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, GROUPS))]
)
def test_random_structured_chains_have_no_false_claim(group):
    for seed in range(group, GROUPS * CHAINS, GROUPS):
        outcome = oracle.judged(chains.random_spec(seed), seed, seconds=1.0, points=2_000)
        assert outcome.verdict in ("complete", "not complete", "unconfirmed", "no motion"), outcome


def test_a_family_that_no_order_of_its_equations_divides_is_proven():
    """Three equations in the same joints: linear algebra finds what sums of these minors are."""
    assert closed_form(chains.arm_of(chains.random_spec(26))).word == "proven"


def test_what_no_box_shows_is_one_aspect_at_least():
    found = aspects(closed_form(chains.arm_of(chains.random_spec(287)), prove=False), work=0.01)
    assert (found.lower, found.upper) == (1, None)
    assert str(found).startswith("chain: at least 1 aspect within")


def test_the_oracle_of_real_points_moves_as_pinocchio_does():
    """Its Jacobians, of every task, and singular points of a chain with a known family."""
    points = script("oracle.points")
    rng = np.random.default_rng(0)
    for seed in range(30):
        spec = chains.strange_spec(seed)
        model = chains.arm_of(replace(spec, task="pose")).model
        data, frame = model.createData(), model.getFrameId("tip")
        q = rng.uniform(-3, 3, len(spec.rows))
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        pin.updateFramePlacements(model, data)
        turned = data.oMf[frame].rotation[:, :2].T @ J[3:]
        if spec.task == "tool-axis":
            J = np.concatenate([J[:3], turned])
        else:
            J = J[list(parse_task(spec.task).rows)]
        assert points.jacobians(spec, q[None])[0] == pytest.approx(J, abs=1e-12)


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 20))]
)
def test_singular_points_that_newton_finds_are_on_families(seed):
    outcome = oracle.judged(chains.strange_spec(seed), seed, seconds=2.0, real=True)
    assert outcome.verdict in ("complete", "not complete", "no motion"), outcome


@pytest.mark.slow
def test_a_family_that_is_dropped_is_noticed_by_real_points():
    rows = [chains.Row(0, 0, 0.2, 0), chains.Row(0, 0, 0.3, 90), chains.Row(0, 0, 0.2, 0)]
    spec = chains.Spec(tuple(rows), "position")
    form = closed_form(chains.arm_of(spec))
    assert oracle.by_points(form, spec, 1, 0)[0] == "complete"
    for i in range(len(form.families)):
        less = replace(form, families=form.families[:i] + form.families[i + 1 :])
        assert oracle.by_points(less, spec, 1, 0)[0] == "missed"


@pytest.mark.slow
def test_a_chain_once_answered_with_four_components_missing():
    """Each of two systems was dropped for the other's sake: q4 = -q3, q6 = q5 was on neither."""
    rows = [
        (90, 0.25, 0.07, 0), (180, 0.12, 0, 90), (0, 0, 0.07, 0), (180, 0, 0, 90),
        (0, 0, 0.3, 180), (0, 0.1, 0, 90), (0, 0, 0.2, 0),
    ]  # fmt: skip
    spec = chains.Spec(tuple(chains.Row(*row) for row in rows), "pose")
    form = closed_form(chains.arm_of(spec), seconds=60.0)
    assert form.complete, form.gaps
    parts, by_rank = oracle.components(form)
    assert field.contradictions(form.geometry, range(6), 6, parts, 4_000, 1, by_rank=by_rank) == {}
    rng = np.random.default_rng(3)
    for turn in (0.0, np.pi):
        q = rng.uniform(-np.pi, np.pi, 7)
        q[3], q[5] = -q[2], q[4] + turn
        assert form.family_of(q) is not None


@pytest.mark.parametrize("name", ["puma560", pytest.param("iiwa14", marks=pytest.mark.slow)])
def test_a_family_that_is_dropped_or_too_large_is_noticed(name):
    arm = load(name)
    form = closed_form(arm)
    parts, by_rank = oracle.components(form)
    rows, rank = arm.task.rows, form.generic_rank

    def against(parts, rank=rank):
        return field.contradictions(form.geometry, rows, rank, parts, 3_000, 0, by_rank=by_rank)

    assert against(parts) == {}
    for i, part in enumerate(parts):
        if part.codimension > 2:  # too few points to be sure of
            continue
        others = [p for k, p in enumerate(parts) if k != i]
        assert "missed" in against(others)
        if part.values:
            joint = next(iter(part.values))
            less = {j: v for j, v in part.values.items() if j != joint}
            wider = [*others, replace(part, values=less)]
        else:
            wider = [*others, replace(part, relations=part.relations[1:])]
        assert "false" in against(wider)
    assert "rank" in against(parts, rank - 1)


def test_a_place_that_is_singular_without_a_zero_matrix_is_found():
    """Where nothing more may be fixed, the minors say whether all of the place is singular."""
    ring = make_ring((False,) * 4)
    x1, y1, x2, y2, x3, y3, x4, y4 = ring.context.gens()
    a, b, c = x3, y3 + 2 * x3, (x3 + 5 * y3) * (x3 + 6 * y3)
    k = (x1 * x2 + 2 * y1 * y2) * (x4 + 9 * y4)
    p, g = y1 * x2 + y2 * x1, x2 * x4 + 2 * y2 * y4
    second = k * b + p * (x3 + 7 * y3) * (x4 + 4 * y4)
    third = k * c + y1 * g * (x3 + 11 * y3) * (x3 + 12 * y3)
    matrix = [[a, b, c], [k * a, second, third]]
    found = decompose(lambda: matrix, 2, ring, Budget(60.0))
    assert not found.gaps
    zero = (Fraction(1), Fraction(0))
    assert any(part.values == {0: zero, 1: zero} for part in found.components)


def test_rank_modulo_a_prime():
    rng = np.random.default_rng(1)
    for m, n in ((6, 6), (6, 8), (3, 5), (5, 3)):
        for rank in range(min(m, n) + 1):
            left = rng.integers(0, 47, (200, m, rank))
            right = rng.integers(0, 47, (200, rank, n))
            matrices = (left @ right % 47).transpose(1, 2, 0).astype(np.int32)
            found = field.ranks(matrices, 47)
            assert found.max() == rank
            assert (found < rank).mean() < 0.1
