from functools import partial

import numpy as np
import pytest
from arms import differences
from mechanisms import (
    R1,
    R2,
    R3,
    analyzed,
    assembled,
    circles,
    four_bar,
    linkage,
    planar_chains,
    shipped,
)
from tiers import tiered
from urdf_text import five_bar

from pinsing import loops
from pinsing.errors import OptionError, PinsingError
from pinsing.loops.closure import Loops, gauss_newton, random_closed
from pinsing.robot.mechanism import Mechanism

THIRD = np.pi / 3


def welded() -> Mechanism:
    """A four-bar as one chain whose last link is welded to the ground: kind 6d, two spare rows."""
    joints = planar_chains({"one": ((0.0, 0.0), [("a", 0.15), ("b", 0.4), ("c", 0.3), ("d", 0.0)])})
    return linkage(joints, [("one_end", "ground")], ["a"], "one_end", "wz", "6d")


def two_cranks(feet, links) -> Mechanism:
    """A five-bar: pivots (2, 2), and lengths of crank 1, rod 1, crank 2, rod 2."""
    l1, d1, l2, d2 = links
    chains = {
        "one": (feet[0], [("q1", l1), ("b1", d1)]),
        "two": (feet[1], [("q2", l2), ("b2", d2)]),
    }
    closing = [("one_end", "two_end")]
    return linkage(planar_chains(chains), closing, ["q1", "q2"], "one_end", "vx,vy")


def test_jacobians_equal_finite_differences_of_closure_and_position(rng):
    names = ("five_bar", "four_bar", "planar_3rrr", "delta", "rps3")
    for mechanism in (*map(shipped, names), welded(), four_bar(0.4, 0.1, 0.35, 0.3)):
        closing = Loops(mechanism)
        for q in random_closed(mechanism, 4, rng):
            G = closing.at(q)[1]
            numeric = differences(lambda x, m=mechanism: loops.residual(m, x), q)
            np.testing.assert_allclose(G, numeric, atol=1e-8)
            assert np.abs(G).max() > 0.1
            if mechanism.task.rows[:2] == (0, 1):
                numeric = differences(lambda x, o=closing.output: np.array(o(x)[0].translation), q)
                np.testing.assert_allclose(closing.output(q)[1][:2], numeric[:2], atol=1e-8)


def test_input_output_relation_holds_along_real_motions(rng):
    for mechanism in (shipped("five_bar"), shipped("planar_3rrr")):
        q = random_closed(mechanism, 4, rng)[-1]
        state = loops.mechanism_at(mechanism, q)
        for relation in (loops.input_output, loops.leg_form):
            A, B = relation(mechanism, q)
            np.testing.assert_allclose(A @ state.velocity, B, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(A, axis=1), 1)


def test_feasible_ends_are_type_2_and_motions_stop_there():
    """At home, both cranks at 60 degrees; the checks hold all points against roots of loci."""
    points = analyzed("five_bar").points
    for k, pivot in ((0, -R3), (1, R3)):  # the crank that moves, and where
        held = np.array([-pivot + R1 * np.cos(THIRD), R1 * np.sin(THIRD)])
        ends = [np.arctan2(B[1], B[0] - pivot) for B in circles([pivot, 0], R1, held, 2 * R2)]
        found = [p for p in points if (p.moving, p.kind) == (f"q{k + 1}", "type 2")]
        assert all(p.range_end for p in found)
        np.testing.assert_allclose(sorted(p.inputs[k] for p in found), sorted(ends), atol=1e-9)
    for p in found:
        state = loops.mechanism_at(shipped("five_bar"), p.q)
        assert state.kind == "type 2"
        assert state.velocity is None
        assert state.uncontrolled.shape == (2, 1)
    stopped = loops.solve(shipped("five_bar"), [THIRD, 0.1])
    assert not stopped.converged
    assert 0 < stopped.reached < 1
    assert "type 2" in stopped.note
    assert np.abs(stopped.q[2] - ends).min() < 1e-4
    said = ("2 degrees of freedom", "assembly +, elbows -+", "2.245665314", "end of the range")
    assert [x for x in said if x not in str(analyzed("five_bar"))] == []
    assert all(c.passed for c in analyzed("five_bar").checks)


@pytest.mark.parametrize(
    ("gap", "links", "lost", "at"),
    [
        # base + both cranks = both rods: stretched at the one point where the cranks point outward
        ((0.2, 0.0), (0.2, 0.3, 0.2, 0.3), "B1, P, B2 in line, stretched", (np.pi, 0.0)),
        ((-0.3, 0.4), (0.1, 0.45, 0.2, 0.35), "B1, P, B2 in line, stretched", None),
        # crank 1 = base + crank 2 + the rods' difference: folded
        ((0.0, 0.2), (0.9, 0.8, 0.3, 0.4), "B1, P, B2 in line, folded", (np.pi / 2, np.pi / 2)),
        # leg 1 folded inward to 0.1 with base and crank 2 is as long as rod 2
        ((0.3, -0.4), (0.4, 0.3, 0.2, 0.8), "A1, B1, P in line, folded", None),
    ],
)
@pytest.mark.parametrize("off", tiered([0.0, 1e-6, -1e-6], [0.0]))
def test_loci_that_shrink_to_a_point_are_stated(gap, links, lost, at, off):
    """A reach just met is one isolated point of the inputs; a little more a small loop; less none.

    The equation of each locus is that of a quadrilateral of base, crank (or leg in line), crank
    and reach: real if and only if its longest side is no longer than the others together.
    """
    l1, d1, l2, d2 = links
    grown = d2 + off
    mechanism = two_cranks([(0.1, 0.0), (0.1 + gap[0], gap[1])], [l1, d1, l2, grown])
    forms = loops.loop_forms(mechanism)
    assert forms.complete
    base = float(np.hypot(*gap))
    sides = {
        "B1, P, B2 in line, stretched": (base, l1, l2, d1 + grown),
        "B1, P, B2 in line, folded": (base, l1, l2, abs(d1 - grown)),
        "A1, B1, P in line, stretched": (base, l1 + d1, l2, grown),
        "A1, B1, P in line, folded": (base, abs(l1 - d1), l2, grown),
        "A2, B2, P in line, stretched": (base, l1, l2 + grown, d1),
        "A2, B2, P in line, folded": (base, l1, abs(l2 - grown), d1),
    }
    slack = {words: sum(x) - 2 * max(x) for words, x in sides.items()}
    assert abs(slack[lost]) <= 1.1e-6
    single = {w for w, s in slack.items() if abs(s) < 1e-9 and "coincide" not in w}
    assert (lost in single) == (off == 0)
    found = {x.words: x for x in forms.loci if "coincide" not in x.words}
    assert set(found) == {w for w, s in slack.items() if s > -1e-9 and sides[w][-1] > 0}
    for words, locus in found.items():
        assert locus.points_only == (words in single)
        assert locus.witness.converged
    if off == 0:
        assert "isolated points" in str(found[lost])
        if at is not None:
            turned = np.array(found[lost].witness.inputs) - at
            np.testing.assert_allclose(np.sin(turned / 2), 0, atol=1e-9)


def test_follow_keeps_the_mode_and_arrives():
    mechanism = shipped("five_bar")
    path = np.linspace([THIRD, THIRD], [0.9, 1.9], 7)
    found = loops.follow(mechanism, path)
    assert all(s.converged for s in found)
    assert {s.mode[:10] for s in found} == {"assembly +"}
    for s in found:
        one, two = R1 * np.stack([np.cos(s.inputs), np.sin(s.inputs)], axis=1) + [[-R3, 0], [R3, 0]]
        (P,) = (x for x in circles(one, R2, two, R2) if x[1] > 1)
        np.testing.assert_allclose(loops.mechanism_at(mechanism, s.q).position[:2], P, atol=1e-12)


@pytest.mark.slow
def test_feasible_range_equals_the_reach_of_the_rods_and_is_said(rng):
    mechanism = shipped("five_bar")
    for q1 in (THIRD, *rng.uniform(-np.pi, np.pi, 3)):
        found = loops.feasible(mechanism, [q1, 0.0])["q2"]
        for q2 in np.linspace(-np.pi, np.pi, 61):
            gap = abs(2 * R3 + R1 * (np.exp(1j * q2) - np.exp(1j * q1)))
            if abs(gap - 2 * R2) > 1e-3:
                assert any(q2 in i for i in found) == (gap < 2 * R2)
    with pytest.raises(
        loops.InfeasibleError, match=r"do not close at q1 = 1\.0472, q2 = 0\.1"
    ) as caught:
        loops.assemblies(mechanism, [THIRD, 0.1])
    (interval,) = caught.value.feasible["q2"]
    ends = 0.6270392383, 2 * np.pi - 2.2363065934
    assert (interval.lower, interval.upper) == pytest.approx(ends, abs=1e-9)
    assert "q1 in [" in str(caught.value)


def test_3rrr_assemblies_close_and_differ():
    mechanism = shipped("planar_3rrr")
    inputs = loops.home(mechanism)[list(mechanism.actuated)]
    one, other = loops.assemblies(mechanism, inputs)
    assert np.abs(mechanism.fold(one.q - other.q)).max() > 1e-3
    with pytest.raises(loops.InfeasibleError, match="the loops do not close"):
        loops.assemblies(mechanism, [np.pi, 0, np.pi / 2 + 0.3])


def test_dead_points_of_the_shipped_four_bar():
    """Cosine rule: coupler and rocker in line (type 2), crank and coupler in line (type 1)."""
    g, a, b, c = 0.5, 0.3, 0.2, 0.35
    dead = np.arccos((g**2 + a**2 - (b + c) ** 2) / (2 * g * a))
    limit = np.arccos((g**2 + (a + b) ** 2 - c**2) / (2 * g * (a + b)))
    analysis = analyzed("four_bar")
    for kind, angle in (("type 2", dead), ("type 1", limit)):
        values = sorted(p.inputs[0] for p in analysis.points if p.kind == kind)
        np.testing.assert_allclose(values, [-angle, angle], atol=1e-9)
    (interval,) = analysis.ranges["crank"]
    np.testing.assert_allclose((interval.lower, interval.upper), (-dead, dead), atol=1e-9)
    assert all(c.passed for c in analysis.checks)


@pytest.mark.slow
def test_change_points_of_a_parallelogram_are_constraint_singularities():
    """All links in line: the linkage may fold or stay a parallelogram."""
    mechanism = four_bar(0.4, 0.2, 0.4, 0.2)
    found = loops.find_singular(mechanism, loops.curves(mechanism, [0.5], 0))
    values = {round(abs(p.inputs[0]), 6) for p in found if p.kind == "constraint"}
    assert values == {0.0, round(np.pi, 6)}
    q = np.zeros(3)
    assert np.abs(loops.residual(mechanism, q)).max() < 1e-12
    assert loops.mechanism_at(mechanism, q).kind == "constraint"
    assert loops.motions(mechanism, q).basis.shape == (3, 2)
    # One length changed by a little, and the change point is gone.
    other = four_bar(0.4, 0.2, 0.41, 0.2)
    kinds = {p.kind for p in loops.find_singular(other, loops.curves(other, [0.5], 0))}
    assert "constraint" not in kinds


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_the_size_of_a_linkage_changes_no_finding(size, tmp_path):
    """The lengths of the file alone, not the length scale."""
    found = []
    for unit in (1.0, size):
        joints = five_bar((-0.5 * unit, 0.5 * unit), unit, 1.2 * unit)
        said = [("P1", "P2")], ["q1", "q2"], "P1", "vx, vy", "planar", {"q1": 2, "q2": 1}
        found.append(loops.analyze_mechanism(assembled(tmp_path, joints, *said)))
        assert all(check.passed for check in found[-1].checks)
    small, large = (np.array([p.inputs for p in x.points]) for x in found)
    assert small.shape == (12, 2)
    np.testing.assert_allclose(small, large, atol=1e-9)


def test_a_locus_has_a_witness_where_its_inputs_are_off_by_rounding():
    """Folded rods that differ by a hundredth: the circles of the rods touch, but for rounding."""
    feet = ((-0.6314748361103559, 0.0), (0.7315639030651457, 0.0))
    links = (0.8525098255639625, 0.34190520854799633, 0.584868873023281, 0.3523842598444218)
    assert [
        x.words for x in loops.loop_forms(two_cranks(feet, links)).loci if x.witness is None
    ] == []


@pytest.mark.slow
def test_a_kite_is_of_type_1_in_one_assembly_mode_throughout():
    """Crank and coupler alike: folded, the coupler's end stays on the crank's pivot."""
    mechanism = four_bar(1.0, 0.6, 0.6, 1.0)
    forms = loops.loop_forms(mechanism)
    found = [x for x in forms.loci if x.kind == "type 1"]
    # Stretched, crank and coupler are 1.2 long, and the rocker 1 about (1, 0).
    at = {round(float(np.degrees(x.witness.inputs[0])), 6) for x in found}
    stretched = round(float(np.degrees(np.arccos(1.2 / 2))), 6)
    assert at == {stretched, -stretched}
    assert not forms.complete
    (note,) = forms.notes
    assert "leg 1 is folded there with its end at rest" in note
    # So it is, by Pinocchio, at any crank angle.
    for crank in (0.3, 1.9, -2.5):
        modes = [loops.mechanism_at(mechanism, m.q) for m in loops.assemblies(mechanism, [crank])]
        assert "type 1" in {m.kind for m in modes}
    found = loops.analyze_mechanism(mechanism)
    assert all(check.passed for check in found.checks)
    assert "NOT complete" in str(found)


def test_a_type_3_configuration_that_is_not_flat():
    """Leg 1 stretched and B2 in line with B1 and P, leg 2 bent."""
    mechanism = two_cranks([(0.0, 0.0), (1.3, -0.4)], [0.5, 0.5, 0.4, 0.3])
    q = np.array([0.0, 0.0, np.pi / 2, np.pi / 2])
    assert np.abs(loops.residual(mechanism, q)).max() < 1e-12
    assert loops.mechanism_at(mechanism, q).kind == "type 3"
    free = np.ones(mechanism.n, dtype=bool)
    start, error = gauss_newton(Loops(mechanism), q + np.array([0.04, -0.03, 0.05, 0.02]), free)
    assert error < 1e-12
    assert loops.mechanism_at(mechanism, start).kind == "regular"
    point = loops.refine(mechanism, start, "type 3")
    assert (point.kind, point.converged) == ("type 3", True)


def test_refine_does_not_pretend():
    mechanism = four_bar(0.4, 0.1, 0.35, 0.3)
    point = loops.refine(mechanism, loops.home(mechanism), "type 2")
    assert not point.converged
    assert point.ratio > 1e-3
    with pytest.raises(OptionError, match="unknown kind 'type 4'"):
        loops.refine(mechanism, loops.home(mechanism), "type 4")


@pytest.mark.parametrize(
    ("compute", "given"),
    [
        (analyzed, "five_bar"), (loops.joint_forms, shipped("gough_stewart")),
        (loops.pose_forms, shipped("gough_stewart")), (loops.pose_forms, shipped("rus6")),
        (loops.loop_forms, shipped("five_bar")), (loops.working_modes, shipped("planar_3rrr")),
        (partial(loops.mechanism_map, count=100), shipped("planar_3rpr")),
    ],
    ids=["analysis", "joints", "pose", "determinants", "inputs", "modes", "map"],
)  # fmt: skip
def test_results_survive_json(compute, given, rng):
    found = compute(given)
    again = type(found).from_json(found.to_json())
    assert str(again) == str(found)
    assert again.to_json() == found.to_json()
    # Equations are kept as numbers, not as text alone.
    for one, other in zip(*(getattr(x, "loci", ()) for x in (found, again)), strict=True):
        if one.equation is not None:
            names = getattr(one.equation, "names", ()) or one.equation.joints
            x = rng.normal(size=(3, len(names)))
            np.testing.assert_array_equal(other.equation(x), one.equation(x))


def test_loops_that_never_close_are_said():
    mechanism = four_bar(2.0, 0.1, 0.2, 0.3)
    with pytest.raises(PinsingError, match="close nowhere"):
        loops.ranks(mechanism)


def test_results_do_not_depend_on_the_call_before():
    """Pinocchio's constraint Jacobian is stale without calc(): two evaluators must not mix."""
    mechanism = shipped("five_bar")
    one, two = (s.q for s in loops.assemblies(mechanism, [1.0, 1.9]))
    closing = Loops(mechanism)
    first = closing.at(one)[1].copy()
    closing.at(two)
    np.testing.assert_array_equal(closing.at(one)[1], first)
    assert np.abs(closing.at(two)[1] - first).max() > 0.1
