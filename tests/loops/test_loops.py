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
    cross,
    four_bar,
    linkage,
    planar_chains,
    shipped,
)
from tiers import tiered
from urdf_text import five_bar

from pinsing.errors import OptionError, PinsingError
from pinsing.loops import (
    InfeasibleError,
    analyze_mechanism,
    assemblies,
    curves,
    feasible,
    find_singular,
    follow,
    home,
    input_output,
    joint_forms,
    leg_form,
    loop_forms,
    mechanism_at,
    mechanism_map,
    motions,
    pose_forms,
    ranks,
    refine,
    residual,
    solve,
    working_modes,
)
from pinsing.loops.closure import Loops, gauss_newton, planar_dyad, random_closed
from pinsing.loops.motion import elbow_sines
from pinsing.robot.mechanism import Mechanism

MODELS = ("five_bar", "four_bar", "planar_3rrr")
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
    loops = [("one_end", "two_end")]
    return linkage(planar_chains(chains), loops, ["q1", "q2"], "one_end", "vx,vy")


def every() -> list[Mechanism]:
    return [*(shipped(name) for name in MODELS), welded(), four_bar(0.4, 0.1, 0.35, 0.3)]


def test_jacobians_equal_finite_differences_of_closure_and_position(rng):
    for mechanism in (*every(), shipped("delta"), shipped("rps3")):
        loops = Loops(mechanism)
        for q in random_closed(mechanism, 4, rng):
            G = loops.at(q)[1]
            numeric = differences(lambda x, m=mechanism: residual(m, x), q)
            np.testing.assert_allclose(G, numeric, atol=1e-8)
            assert np.abs(G).max() > 0.1
            if mechanism.task.rows[:2] == (0, 1):
                numeric = differences(lambda x, o=loops.output: np.array(o(x)[0].translation), q)
                np.testing.assert_allclose(loops.output(q)[1][:2], numeric[:2], atol=1e-8)


def test_input_output_relation_holds_along_real_motions(rng):
    for mechanism in (shipped("five_bar"), shipped("planar_3rrr")):
        q = random_closed(mechanism, 4, rng)[-1]
        state = mechanism_at(mechanism, q)
        for relation in (input_output, leg_form):
            A, B = relation(mechanism, q)
            np.testing.assert_allclose(A @ state.velocity, B, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(A, axis=1), 1)


def singular_q2_by_hand(q1: float, assembly: int) -> list[float]:
    """Type 1 of the 5R at q1: P on the line of one leg; B2 where two circles meet."""
    A1, A2 = np.array([-R3, 0]), np.array([R3, 0])
    out = []
    for sign in (1, -1):
        P = A1 + (R1 + sign * R2) * np.array([np.cos(q1), np.sin(q1)])
        B1 = A1 + R1 * np.array([np.cos(q1), np.sin(q1)])
        found = [(P, B2) for B2 in circles(A2, R1, P, R2)]
        # Leg 2 in line: P at R1 +- R2 from A2, and at R2 from B1.
        ends = circles(A2, R1 + sign * R2, B1, R2)
        found += [(P, A2 + (P - A2) * R1 / (R1 + sign * R2)) for P in ends]
        here = [B2 for P, B2 in found if (cross(B2 - B1, P - B1) > 0) == (assembly > 0)]
        out += [float(np.arctan2(B2[1], B2[0] - R3)) for B2 in here]
    return sorted(out)


def five_bar_points(moving, kind):
    """At home, both cranks at 60 degrees."""
    points = analyzed("five_bar").points
    return [p for p in points if (p.moving, p.kind) == (f"q{moving + 1}", kind)]


def test_singular_q2_at_q1_of_60_degrees():
    found = five_bar_points(1, "type 1")
    for assembly, sign in ((1, "assembly +"), (-1, "assembly -")):
        here = sorted(p.inputs[1] for p in found if p.mode.startswith(sign))
        np.testing.assert_allclose(here, singular_q2_by_hand(THIRD, assembly), atol=1e-9)
    values = [p.inputs[1] for p in found]
    for printed in (1.4092167, 1.9685594, 2.2456653, 2.7053586):
        assert min(abs(v - printed) for v in values) < 1e-7


def test_feasible_ends_are_type_2():
    for k, pivot in ((1, R3), (0, -R3)):  # the crank that moves, and where
        held = np.array([-pivot + R1 * np.cos(THIRD), R1 * np.sin(THIRD)])
        ends = [np.arctan2(B[1], B[0] - pivot) for B in circles([pivot, 0], R1, held, 2 * R2)]
        found = five_bar_points(k, "type 2")
        assert all(p.range_end for p in found)
        np.testing.assert_allclose(sorted(p.inputs[k] for p in found), sorted(ends), atol=1e-9)
    for p in found:
        state = mechanism_at(shipped("five_bar"), p.q)
        assert state.kind == "type 2"
        assert state.velocity is None
        assert state.uncontrolled.shape == (2, 1)


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
    forms = loop_forms(mechanism)
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


def test_all_modes_of_the_5r(rng):
    mechanism = shipped("five_bar")
    dyad = planar_dyad(mechanism)
    drawn = random_closed(mechanism, 20, rng)
    assert len(drawn) > 9
    for q in drawn:
        state = mechanism_at(mechanism, q)
        found = assemblies(mechanism, state.inputs)
        assert [s.mode[:10] for s in found] == ["assembly +", "assembly -"]
        assert max(s.residual for s in found) < 1e-12
        assert min(np.abs(mechanism.fold(s.q - q)).max() for s in found) < 1e-9
        working = dyad.working_modes(complex(*state.position[:2]))
        assert len(working) == 4
        assert len({tuple(np.sign(elbow_sines(mechanism, x))) for x in working}) == 4
        for x in working:
            there = mechanism_at(mechanism, x)
            np.testing.assert_allclose(there.position, state.position, atol=1e-12)
        assert min(np.abs(mechanism.fold(x - q)).max() for x in working) < 1e-9


def test_follow_keeps_the_mode_and_arrives():
    mechanism = shipped("five_bar")
    path = np.linspace([THIRD, THIRD], [0.9, 1.9], 7)
    found = follow(mechanism, path)
    assert all(s.converged for s in found)
    assert {s.mode[:10] for s in found} == {"assembly +"}
    for s in found:
        one, two = R1 * np.stack([np.cos(s.inputs), np.sin(s.inputs)], axis=1) + [[-R3, 0], [R3, 0]]
        (P,) = (x for x in circles(one, R2, two, R2) if x[1] > 1)
        np.testing.assert_allclose(mechanism_at(mechanism, s.q).position[:2], P, atol=1e-12)


def test_solve_stops_at_the_type_2_singularity_where_the_mode_ends():
    mechanism = shipped("five_bar")
    found = solve(mechanism, [THIRD, 0.1])
    assert not found.converged
    assert 0 < found.reached < 1
    assert "type 2" in found.note
    assert found.q[2] == pytest.approx(0.6270392383, abs=1e-4)


@pytest.mark.slow
def test_feasible_range_equals_the_reach_of_the_rods_and_is_said(rng):
    mechanism = shipped("five_bar")
    for q1 in (THIRD, *rng.uniform(-np.pi, np.pi, 3)):
        found = feasible(mechanism, [q1, 0.0])["q2"]
        for q2 in np.linspace(-np.pi, np.pi, 61):
            gap = abs(2 * R3 + R1 * (np.exp(1j * q2) - np.exp(1j * q1)))
            if abs(gap - 2 * R2) > 1e-3:
                assert any(q2 in i for i in found) == (gap < 2 * R2)
    with pytest.raises(InfeasibleError, match=r"do not close at q1 = 1\.0472, q2 = 0\.1") as caught:
        assemblies(mechanism, [THIRD, 0.1])
    (interval,) = caught.value.feasible["q2"]
    ends = 0.6270392383, 2 * np.pi - 2.2363065934
    assert (interval.lower, interval.upper) == pytest.approx(ends, abs=1e-9)
    assert "q1 in [" in str(caught.value)


def test_3rrr_assemblies_close_and_differ():
    mechanism = shipped("planar_3rrr")
    inputs = home(mechanism)[list(mechanism.actuated)]
    one, other = assemblies(mechanism, inputs)
    assert np.abs(mechanism.fold(one.q - other.q)).max() > 1e-3
    with pytest.raises(InfeasibleError, match="the loops do not close"):
        assemblies(mechanism, [np.pi, 0, np.pi / 2 + 0.3])


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
    found = find_singular(mechanism, curves(mechanism, [0.5], 0))
    values = {round(abs(p.inputs[0]), 6) for p in found if p.kind == "constraint"}
    assert values == {0.0, round(np.pi, 6)}
    q = np.zeros(3)
    assert np.abs(residual(mechanism, q)).max() < 1e-12
    assert mechanism_at(mechanism, q).kind == "constraint"
    assert motions(mechanism, q).basis.shape == (3, 2)
    # One length changed by a little, and the change point is gone.
    other = four_bar(0.4, 0.2, 0.41, 0.2)
    kinds = {p.kind for p in find_singular(other, curves(other, [0.5], 0))}
    assert "constraint" not in kinds


@pytest.mark.slow
@pytest.mark.parametrize("size", tiered([1e-3, 1e3], {1e3}))
def test_the_size_of_a_linkage_changes_no_finding(size, tmp_path):
    """The lengths of the file alone, not the length scale."""
    found = []
    for unit in (1.0, size):
        joints = five_bar((-0.5 * unit, 0.5 * unit), unit, 1.2 * unit)
        said = [("P1", "P2")], ["q1", "q2"], "P1", "vx, vy", "planar", {"q1": 2, "q2": 1}
        found.append(analyze_mechanism(assembled(tmp_path, joints, *said)))
        assert all(check.passed for check in found[-1].checks)
    small, large = (np.array([p.inputs for p in x.points]) for x in found)
    assert small.shape == (12, 2)
    np.testing.assert_allclose(small, large, atol=1e-9)


def test_a_locus_has_a_witness_where_its_inputs_are_off_by_rounding():
    """Folded rods that differ by a hundredth: the circles of the rods touch, but for rounding."""
    feet = ((-0.6314748361103559, 0.0), (0.7315639030651457, 0.0))
    links = (0.8525098255639625, 0.34190520854799633, 0.584868873023281, 0.3523842598444218)
    assert [x.words for x in loop_forms(two_cranks(feet, links)).loci if x.witness is None] == []


@pytest.mark.slow
def test_a_kite_is_of_type_1_in_one_assembly_mode_throughout():
    """Crank and coupler alike: folded, the coupler's end stays on the crank's pivot."""
    mechanism = four_bar(1.0, 0.6, 0.6, 1.0)
    forms = loop_forms(mechanism)
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
        modes = [mechanism_at(mechanism, m.q) for m in assemblies(mechanism, [crank])]
        assert "type 1" in {m.kind for m in modes}
    found = analyze_mechanism(mechanism)
    assert all(check.passed for check in found.checks)
    assert "NOT complete" in str(found)


def test_a_type_3_configuration_that_is_not_flat():
    """Leg 1 stretched and B2 in line with B1 and P, leg 2 bent."""
    mechanism = two_cranks([(0.0, 0.0), (1.3, -0.4)], [0.5, 0.5, 0.4, 0.3])
    q = np.array([0.0, 0.0, np.pi / 2, np.pi / 2])
    assert np.abs(residual(mechanism, q)).max() < 1e-12
    assert mechanism_at(mechanism, q).kind == "type 3"
    free = np.ones(mechanism.n, dtype=bool)
    start, error = gauss_newton(Loops(mechanism), q + np.array([0.04, -0.03, 0.05, 0.02]), free)
    assert error < 1e-12
    assert mechanism_at(mechanism, start).kind == "regular"
    point = refine(mechanism, start, "type 3")
    assert (point.kind, point.converged) == ("type 3", True)


@pytest.mark.slow
def test_refine_finds_where_both_types_meet():
    """Type 3 is two conditions: with both inputs free it is found from beside it."""
    mechanism = shipped("five_bar")
    starts = [p.q for p in analyzed("five_bar").points if p.kind in ("type 1", "type 2")]
    both = [p for p in (refine(mechanism, q, "type 3") for q in starts) if p.converged]
    assert both
    for point in both:
        assert point.kind in ("type 3", "constraint")
        assert point.ratio < 1e-9
        assert np.abs(residual(mechanism, point.q)).max() < 1e-9
    with pytest.raises(OptionError, match="unknown kind 'type 4'"):
        refine(mechanism, home(mechanism), "type 4")


def test_refine_does_not_pretend():
    mechanism = four_bar(0.4, 0.1, 0.35, 0.3)
    point = refine(mechanism, home(mechanism), "type 2")
    assert not point.converged
    assert point.ratio > 1e-3


def test_an_analysis_is_printed():
    found = analyzed("five_bar")
    said = ("2 degrees of freedom", "assembly +, elbows -+", "2.245665314", "end of the range")
    assert [x for x in said if x not in str(found)] == []
    assert all(c.passed for c in found.checks)


def few_drawn(mechanism):
    return mechanism_map(mechanism, count=100)


@pytest.mark.parametrize(
    ("compute", "given"),
    [
        (analyzed, "five_bar"), (joint_forms, shipped("gough_stewart")),
        (pose_forms, shipped("gough_stewart")), (pose_forms, shipped("rus6")),
        (loop_forms, shipped("five_bar")), (working_modes, shipped("planar_3rrr")),
        (few_drawn, shipped("planar_3rpr")),
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
        ranks(mechanism)


def test_results_do_not_depend_on_the_call_before():
    """Pinocchio's constraint Jacobian is stale without calc(): two evaluators must not mix."""
    mechanism = shipped("five_bar")
    one, two = (s.q for s in assemblies(mechanism, [1.0, 1.9]))
    loops = Loops(mechanism)
    first = loops.at(one)[1].copy()
    loops.at(two)
    np.testing.assert_array_equal(loops.at(one)[1], first)
    assert np.abs(loops.at(two)[1] - first).max() > 0.1
