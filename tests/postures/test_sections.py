"""Sections across a joint: the same components as boxes find, and as a flood fill."""

import math

import numpy as np
import pytest
from dh_arms import along, dh_arm
from tiers import tiered

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.equation import Equation
from pinsing.algebra.trig_sum import TrigSum
from pinsing.postures.boxes import Ground, is_regular, on_boxes, sum_of
from pinsing.postures.joint_map import Arc, Part, Surface, across, divided


def random_part(rng, d, low, high):
    """A box and R cos(q1 - phi) with random lengths: q1 once in every term."""
    rows, sizes = [], rng.normal(size=2 + 2 * d)
    for k in range(2 + 2 * d):
        row = np.zeros(d, dtype=np.int64)
        row[0] = 2
        if k > 1:
            row[1 + int(rng.integers(d - 1))] = 2 * rng.integers(-1, 2)
        rows.append(row)
    f = np.array(rows)
    phase = rng.uniform(0, 2 * math.pi, len(f))
    names = tuple(f"q{j + 1}" for j in range(d))
    zero = np.zeros(d)
    e = Equation(names, f, f * 0, sizes * np.cos(phase), sizes * np.sin(phase), zero)
    arcs = tuple(Arc(float(low[j]), float(high[j])) for j in range(d))
    return Part(tuple(range(d)), tuple((a,) for a in arcs), (Surface("F1", e, True),)), arcs


def flood(terms, low, high, n):
    """Components of equal sign on a grid, joined over faces."""
    grid = np.stack(
        np.meshgrid(*(np.linspace(a, b, n) for a, b in zip(low, high, strict=True)), indexing="ij"),
        axis=-1,
    )
    kind = np.sign(terms(grid))
    label = np.arange(kind.size).reshape(kind.shape)
    while True:
        new = label.copy()
        for axis in range(kind.ndim):
            one, two = (np.moveaxis(new, axis, 0)[s] for s in (slice(None, -1), slice(1, None)))
            same = np.moveaxis(np.diff(kind, axis=axis) == 0, axis, 0)
            least = np.where(same, np.minimum(one, two), -1)
            for side in (one, two):
                side[...] = np.where(least >= 0, np.minimum(least, side), side)
        new = new.ravel()[new]
        if np.array_equal(new, label):
            break
        label = new
    sizes = np.unique(label, return_counts=True)[1]
    return sizes


@pytest.mark.parametrize("seed", tiered(range(6), (0, 4)))
def test_the_components_are_those_of_boxes_and_of_a_flood_fill(seed):
    rng = np.random.default_rng(seed)
    low = np.array([-rng.uniform(0.5, 6.2), -rng.uniform(1, 3)])
    high = np.array([rng.uniform(0.5, 6.2), rng.uniform(1, 3)])
    part, box = random_part(rng, 2, low, high)
    hub = across(part, box)
    assert hub is not None
    found = divided(part, box, hub, np.ones(2), Budget(5.0)).found
    terms = sum_of(part.surfaces[0].equation, part.joints)
    whole = divided(part, box, None, np.ones(2), Budget(5.0)).found
    assert found.proven
    assert whole.proven
    assert found.lower == whole.lower
    sizes = flood(terms, low, high, 241)
    # A grid may miss a sliver, or tear one; it holds every piece that is larger.
    assert (sizes > 40).sum() <= found.lower <= len(sizes)


def test_a_component_has_points_of_its_sign_and_ways_between_them():
    rng = np.random.default_rng(5)
    low, high = np.array([-4.0, -3.0, -2.0]), np.array([5.0, 3.0, 2.5])
    part, box = random_part(rng, 3, low, high)
    hub = across(part, box)
    piece = divided(part, box, hub, np.ones(3), Budget(5.0))
    assert piece.found.proven
    terms = sum_of(part.surfaces[0].equation, part.joints)

    def clear(X):
        signs = np.sign(terms(along(X, 60)))
        return bool((signs == signs[0]).all())

    assert piece.found.lower > 1
    for c in range(piece.found.upper):
        x = piece.examples(c)
        assert (np.sign(terms(x)) == piece.signs(c)[0]).all()
        assert ((low <= x) & (x <= high)).all()
        for a, b in zip(x[:8], x[::-1][:8], strict=False):
            assert piece.locate(a, clear) == c
            way = piece.route(a, b, clear)
            assert clear(way)
            assert np.array_equal(way[0], a)
            assert np.allclose(way[-1], b)
            assert ((low - 1e-9 <= way) & (way <= high + 1e-9)).all()


def test_a_saddle_on_a_limit_has_no_largest_value_and_a_hill_has_one():
    """sin q1 sin q2 at its crossing bends both ways; cos q1 cos q2 is largest at 0."""
    f = np.array([[1.0, -1.0], [1.0, 1.0]])
    power = np.zeros((2, 2), dtype=np.int64)
    crossing = TrigSum([0.5, 0.5], [0.0, math.pi], f, power, 1e-12)
    hill = TrigSum([0.5, 0.5], np.zeros(2), f, power, 1e-12)
    x, h = np.zeros((1, 2)), np.full((1, 2), 0.05)
    # Where both joints are at their ends there is no line left to bend along.
    for terms, side, regular in ((crossing, 0.0, True), (hill, 0.0, False), (crossing, 1.0, False)):
        ground = Ground((terms,), x[0], x[0], np.zeros(2, dtype=bool), np.ones(2))
        known, sides = [on_boxes(terms, x, h)], np.full((1, 2), side)
        assert is_regular(ground, known, [0], x, h, sides).all() == regular


@pytest.mark.slow
def test_every_regular_configuration_has_an_aspect_though_a_section_lies_on_a_family():
    """The elbow of this arm is singular at joint values of its own, where boxes end."""
    arm = dh_arm([(-90, 0.971, 0), (90, 0.798, 0.84), (0, 1.372, 0)], "position")
    form = pinsing.closed_form(arm)
    found = pinsing.aspects(form)
    assert (found.lower, found.upper) == (9, 9)
    Q = np.random.default_rng(5).uniform(-3.1, 3.1, (40, 3))
    clear = Q[np.asarray(pinsing.clearance(form, Q).lower) > 0.02]
    assert len(clear) > 20
    numbers = [found.of(q) for q in clear]
    assert None not in numbers
    signs = np.sign([np.linalg.det(pinsing.kinematics.task_jacobian(arm, q)) for q in clear])
    for a, b, m, n in zip(signs, signs[1:], numbers, numbers[1:], strict=False):
        assert m != n or a == b
    joined = pinsing.connect(form, clear[0], clear[0], of=found)
    assert joined.answer == "same"
