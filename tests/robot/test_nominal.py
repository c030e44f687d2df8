"""The exact geometry: what is snapped, what stays, and how far it is from the file's."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pinocchio as pin
import pytest
from arms import CATALOGUE, draw, place, serial
from batch_cases import reference_jacobian
from hypothesis import given, strategies as st
from pinocchio.utils import rotate
from tiers import sampled, tiered_rows
from urdf_text import J, Y, urdf

from pinsing.kinematics.jacobian import frame_jacobian, frame_jacobians, generic_rank, tip_placement
from pinsing.measures import Chain
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.robot.nominal import ANGLE_TOL, Deviation, Nominal, flatten, nominal
from pinsing.robot.surd import SQUARES, Surd, cosine, parts_of, sine, surd

IDENTITY = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def rotation(axis: str, degrees: float) -> np.ndarray:
    return rotate(axis, math.radians(degrees))


def rational_jacobian(exact: Nominal, q: np.ndarray) -> np.ndarray:
    """Geometric Jacobian of the rational chain, by homogeneous matrices and cross products."""
    coupling = exact.arm.coupling
    values = q if coupling is None else coupling.matrix @ q + coupling.offset
    R, t = (np.array(x, dtype=float) for x in (exact.rotation, exact.translation))
    J = reference_jacobian(Chain(R, t, np.array(exact.prismatic)), values + exact.offset)
    return J if coupling is None else J @ coupling.matrix


def check(arm: Arm, exact: Nominal, Q: np.ndarray) -> float:
    """All that must hold for any arm; returns the largest change of a column that was seen."""
    k = len(exact.prismatic)
    assert k == arm.model.nv
    assert len(exact.rotation) == len(exact.translation) == k + 1
    assert (exact.offset.shape, exact.rotation[-1]) == ((k,), IDENTITY)
    for R in exact.rotation:
        assert all(isinstance(x, Fraction | Surd) for row in R for x in row)
        for a in range(3):
            for b in range(3):
                assert sum(R[c][a] * R[c][b] for c in range(3)) == (a == b)
        (a, b, c), (d, e, f), (g, h, i) = R
        assert a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) == 1
    assert all(isinstance(x, Fraction) for t in exact.translation for x in t)
    for field in ("name", "tip", "base", "joints", "task", "length_scale"):
        assert getattr(exact.arm, field) == getattr(arm, field)
    np.testing.assert_array_equal(exact.arm.lower, arm.lower)
    np.testing.assert_array_equal(exact.arm.upper, arm.upper)
    raw, moved = frame_jacobians(arm, Q), frame_jacobians(exact.arm, Q)
    rational = np.array([rational_jacobian(exact, q) for q in Q])
    size = max(1.0, float(np.abs(raw).max()))
    np.testing.assert_allclose(moved, rational, atol=1e-12 * size)
    change = moved - raw
    change[:, :3] /= arm.length_scale
    seen = float(np.linalg.norm(change, axis=1).max())
    assert seen <= exact.jacobian_change + 1e-14 * size
    if exact.jacobian_change > 1e-12:
        assert exact.snaps  # nothing is moved without being told
    return seen


def snapped(joints, tip=None, count=50, **tolerances) -> tuple[Nominal, float]:
    """Joints, or places where one turns about z, made exact and checked; and what `check` gives."""
    joints = [(pin.JointModelRZ(), x) if isinstance(x, pin.SE3) else x for x in joints]
    arm = load(serial(joints, tip), tip="tip")
    exact = nominal(arm, **tolerances)
    return exact, check(arm, exact, draw(arm, np.random.default_rng(7), count))


@pytest.mark.parametrize(
    ("written", "quarter"),
    [(1.5708, 1), (1.57, 1), (-1.5707963, -1), (3.14, 2), (3.1416, 2), (-1.571, -1), (0.0005, 0)],
)
def test_rounded_right_angles(written, quarter):
    places = place((0, 0, 0.1)), place((0.4, 0, 0), rotate("x", written))
    exact, seen = snapped(places, place((0.25, 0, 0.125)))
    s = (0, 1, 0, -1)[quarter % 4]
    c = (1, 0, -1, 0)[quarter % 4]
    assert exact.rotation[1] == ((1, 0, 0), (0, c, -s), (0, s, c))
    error = abs(written - quarter * math.pi / 2)
    (snap,) = exact.snaps
    assert (snap.what, snap.where) == ("angle", "j1 to j2")
    assert snap.size == pytest.approx(error, rel=1e-6, abs=1e-15)
    assert "rad" in str(snap)
    assert not exact.exact
    assert exact.translation == (
        (0, 0, Fraction(1, 10)), (Fraction(2, 5), 0, 0), (Fraction(1, 4), 0, Fraction(1, 8)),
    )  # fmt: skip
    assert 0.1 * error < exact.jacobian_change < 4 * error
    assert seen > 0.1 * error


def test_angles_beyond_the_tolerance_stay():
    angles = (0.0, math.pi / 2 + 2 * ANGLE_TOL)
    places = [place((0.3, 0, 0), rotate("x", a)) for a in angles]
    stays, _ = snapped(places)
    (twist,) = stays.snaps
    assert twist.what == "twist"
    assert twist.size < 1e-11
    assert stays.jacobian_change < 1e-10
    (angle,) = snapped(places, angle_tol=3 * ANGLE_TOL)[0].snaps
    assert (angle.what, angle.size) == ("angle", pytest.approx(2 * ANGLE_TOL))


def test_what_files_have_is_read_as_written():
    """Lengths keep their decimals, also where right angles have 11 digits or 1.5708."""
    exact = nominal(load("panda"))
    lengths = {abs(x) for t in exact.translation for x in t} - {0}
    written = ("0.333", "0.316", "0.0825", "0.384", "0.088", "0.2104")
    assert lengths == {Fraction(text) for text in written}
    assert exact.exact
    # -0.1197 + 0.13585 = 0.01615; tool0 sits 0.0823 beyond wrist 3.
    lengths = {abs(x) for t in nominal(load("ur5")).translation for x in t} - {0}
    written = ("0.089159", "0.13585", "0.1197", "0.425", "0.39225", "0.093", "0.09465", "0.0823")
    assert {Fraction("0.425"), Fraction("0.39225")} <= lengths <= {Fraction(x) for x in written}
    exact = nominal(load("xarm7"))
    assert {s.what for s in exact.snaps} == {"angle"}
    assert max(s.size for s in exact.snaps) == pytest.approx(3.673e-6, rel=1e-3)
    assert by_quarter_turns(exact)
    assert nominal(load("xarm7", length_scale=0.1)).jacobian_change > 2 * exact.jacobian_change
    for name in ("stanford", "surgical7", "puma560", "irb1400", "iiwa14", "scara"):
        exact = nominal(load(name))
        assert (exact.exact, exact.snaps) == (True, ())
        assert max(x.denominator for t in exact.translation for x in t) <= 10**5


@pytest.mark.parametrize("tolerance", [ANGLE_TOL, 0.01])
def test_angles_that_are_moved_move_no_length(tolerance):
    """A calibrated arm: angles off by a milliradian, lengths with all their digits."""
    R = [rotate("x", math.pi / 2 + 1.5e-3), rotate("y", -1e-3), np.eye(3)]
    lengths = [(0.0, 0.0, 0.162712244574), (-0.425170344631, 1.23e-5, 0.0003519)]
    lengths += [(0.0, -0.099603596358, 2.5e-6)]
    exact, _ = snapped(map(place, lengths, R), place((0.0007, 0, 0.1)), angle_tol=tolerance)
    assert exact.rotation[0] == ((1, 0, 0), (0, 0, -1), (0, 1, 0))
    assert {s.what for s in exact.snaps} == {"angle"}
    for found, written in zip(exact.translation, [*lengths, (0.0007, 0, 0.1)], strict=True):
        assert found == tuple(Fraction(repr(float(x))) for x in written)
    deviation = Deviation.of(exact.snaps)
    assert (deviation.angle, deviation.length) == (pytest.approx(1.5e-3), 0.0)
    assert "lengths as written" in str(deviation)


def test_origins_stay_on_axes_that_are_turned():
    """The origin slides along the axis as it is made, not as it was rounded."""
    quarter = rotate("x", 1.5708)
    places = [
        place((0.1, 0, 0.2)), place((0, -0.0611, 0.0181), quarter),
        place((0.1, 0.0611, 0.0181), (rotation("z", -177.2) @ quarter).T),
    ]  # fmt: skip
    exact, _ = snapped(places, place((0, 0, 0.1)))
    digits = [len(f"{float(x):.15g}") for t in exact.translation[1:] for x in t]
    assert max(digits) <= 8


def test_snap_length():
    """The 0.436 mm offset of an iiwa model: kept by default, gone on request."""
    places = [
        place((0, 0, 0.36)), place((-0.000436, 0, 0.42), rotation("x", 90)),
        place((0.01, 0.4, 0), rotation("x", -90)),
    ]  # fmt: skip
    kept, _ = snapped(places, place((0, 0, 0.126)))
    assert kept.translation[1][0] == Fraction(-436, 10**6)
    assert kept.exact
    assert not kept.snaps
    gone, seen = snapped(places, place((0, 0, 0.126)), count=100, snap_length=1e-3)
    assert gone.translation[1] == (0, 0, Fraction(42, 100))
    assert gone.translation[2][0] == Fraction(1, 100)
    (snap,) = gone.snaps
    assert (snap.what, snap.where) == ("length", "j1 to j2")
    assert snap.size == pytest.approx(0.000436)
    assert " m " in str(snap)
    assert 0.5 * 0.000436 < seen < 1.000001 * gone.jacobian_change < 3 * 0.000436


def by_quarter_turns(exact: Nominal) -> bool:
    return all(x.denominator == 1 for R in exact.rotation for row in R for x in row)


@pytest.mark.parametrize("degrees", [45, -30, 17.3, 90, 135, 180])
@pytest.mark.parametrize("at", [0, 1, 2])
def test_a_turn_about_the_joints_own_axis_is_an_offset(degrees, at):
    turns = [rotation("x", 90 * (i > 0) - 180 * (i > 1)) for i in range(3)]
    turns[at] = turns[at] @ rotation("z", degrees)
    places = [place((0.1 * i, 0, 0.3), R) for i, R in enumerate(turns)]
    exact, _ = snapped(places, place((0.5, 0.2, 0)), count=20)
    assert (exact.exact, exact.snaps) == (True, ())
    assert by_quarter_turns(exact)


@pytest.mark.parametrize("degrees", [15, -30, 45, 60, -75, 105, 135, 150, -165])
@pytest.mark.parametrize("digits", [4, 16])
def test_twists_of_fifteen_degrees_are_exact(degrees, digits):
    R = rotate("x", round(math.radians(degrees), digits))
    places = place((0, 0, 0.4)), place((0.1, 0, 0), R), place((0.2, 0, 0), rotation("x", -90))
    exact, _ = snapped(places, place((0.3, 0, 0.08)), count=30)
    c, s = cosine(degrees // 15), sine(abs(degrees) // 15)  # a half turn flips the sine
    assert exact.rotation[1] == ((1, 0, 0), (0, c, -s), (0, s, c))
    assert [s.what for s in exact.snaps] == ["angle"] * (digits == 4)


@pytest.mark.parametrize(("tilt", "last"), [(0.9, 1.4e-9), (math.pi / 4 + 1e-6, 0.0)])
def test_the_largest_angle_that_was_moved_is_told(tilt, last):
    R = rotate("z", 1.1e-3) @ rotate("x", tilt) @ rotate("z", last)
    exact, _ = snapped([place((0, 0, 0.4)), place((0.3, 0, 0.1), R)], place((0.2, 0, 0)))
    assert Deviation.of(exact.snaps).angle == pytest.approx(1.1e-3, rel=1e-3)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0, 0, -1), (-1, 0, 0), (0, 1, 0)])
def test_axes_along_coordinates_stay_exact(axis):
    axis = np.array(axis, dtype=float)
    joints = [
        (pin.JointModelRX(), place((0.1, 0.2, 0.3))),
        (pin.JointModelRevoluteUnaligned(axis), place((0, 0.25, 0))),
        (pin.JointModelPrismaticUnaligned(axis), place((0, 0.25, 0), rotation("y", 90))),
        (pin.JointModelRY(), place((0.1, 0, 0))),
    ]
    exact, _ = snapped(joints, place((0.3, 0, 0.1)), count=30)
    assert (exact.exact, exact.snaps) == (True, ())
    assert by_quarter_turns(exact)


@pytest.mark.parametrize(("robot", "tip"), sampled(tiered_rows(CATALOGUE, CATALOGUE[::2])))
def test_real_arms(robot, tip, rng):
    arm = load(robot, tip=tip)
    exact = nominal(arm)
    seen = check(arm, exact, draw(arm, rng, 100))
    assert exact.jacobian_change < 1e-3
    if exact.jacobian_change > 1e-9:  # a bound, but a useful one
        assert exact.jacobian_change < 4 * seen
    again = nominal(exact.arm)  # it is its own
    assert again.arm is exact.arm
    assert (again.rotation, again.translation) == (exact.rotation, exact.translation)
    assert (again.exact, again.snaps) == (True, ())
    assert generic_rank(exact.arm) == generic_rank(arm)
    told, anew = flatten(exact.arm), flatten(replace(exact.arm))  # the chain is its model's
    assert told is not anew
    assert (told.R.tobytes(), told.t.tobytes()) == (anew.R.tobytes(), anew.t.tobytes())
    assert (told.prismatic == anew.prismatic).all()


def test_mimic_joints_count_with_their_multiplier(rng):
    rows = [
        ("revolute", (-1, 1), ""), ("continuous", None, ""),
        ("revolute", (-5, 5), '<mimic joint="j1" multiplier="-3" offset="0.1"/>'),
        ("continuous", None, '<mimic joint="j2" multiplier="2"/>'), ("revolute", (-1, 1), ""),
    ]  # fmt: skip
    at = {"at": (0.4, 0, 0), "rpy": (1.5708, 0, 0)}
    joints = [
        J(f"j{i}", f"l{i - 1}", f"l{i}", **at, kind=kind, limits=limits, more=more)
        for i, (kind, limits, more) in enumerate(rows, 1)
    ]
    arm = load(urdf(joints))
    assert arm.n == 3
    exact = nominal(arm)
    seen = check(arm, exact, draw(arm, rng, 200))
    assert seen < exact.jacobian_change < 30 * seen


def test_the_arm_on_the_exact_geometry(rng):
    arm = load("xarm7")
    model = arm.model.copy()
    q = draw(arm, rng, 1)[0]
    before = frame_jacobian(arm, q)
    nominal(arm)
    assert arm.model == model
    np.testing.assert_array_equal(frame_jacobian(arm, q), before)
    for name in ("panda", "irb1400", "kinova", "so101"):
        arm = load(name)
        exact = nominal(arm)
        for q in draw(arm, rng, 5):
            raw, moved = tip_placement(arm, q), tip_placement(exact.arm, q)
            size = pin.log6(raw.actInv(moved)).vector
            assert np.abs(size).max() < max(20 * exact.jacobian_change, 1e-12)
    exact = nominal(load("puma560"))
    found = flatten(exact.arm)
    lengths = np.array([[float(x) for x in row] for row in exact.translation])
    assert (found.t == lengths).all()
    with pytest.raises(ValueError, match="read-only"):
        found.t[0, 0] = 1.0


@st.composite
def chains(draw_from):
    n = draw_from(st.integers(1, 6))
    length = st.integers(-800, 800).map(lambda k: k / 1000)
    angle = st.one_of(
        st.integers(-2, 2).map(lambda k: k * math.pi / 2),
        st.sampled_from([1.5708, -1.57, 3.14, 1.5707963267948966, 1e-5]),
        st.integers(-12, 12).map(lambda k: k * math.pi / 12),
        st.floats(-3.125, 3.125, width=32),
    )
    kinds = st.sampled_from(
        [pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelPX, pin.JointModelPZ]
    )
    joints = []
    for _ in range(n):
        xyz = [draw_from(length) for _ in range(3)]
        R = pin.rpy.rpyToMatrix(*(draw_from(angle) for _ in range(3)))
        if draw_from(st.integers(0, 4)) == 0:
            axis = np.array([draw_from(st.integers(-3, 3)) for _ in range(2)] + [1.0])
            axis /= np.linalg.norm(axis)
            slides = draw_from(st.booleans())
            kind = pin.JointModelPrismaticUnaligned if slides else pin.JointModelRevoluteUnaligned
            joints.append((kind(axis), place(xyz, R)))
        else:
            joints.append((draw_from(kinds)(), place(xyz, R)))
    tip = place(
        [draw_from(length) for _ in range(3)], pin.rpy.rpyToMatrix(0.1, draw_from(angle), 2)
    )
    return joints, tip


@given(chains(), st.integers(0, 2**32 - 1))
def test_any_chain_is_within_its_stated_bound(chain, seed):
    joints, tip = chain
    arm = load(serial(joints, tip), tip="tip")
    Q = draw(arm, np.random.default_rng(seed), 8)
    exact = nominal(arm)
    check(arm, exact, Q)
    assert exact.jacobian_change < 0.2  # six joints off by 2e-3 each, a few metres of reach


def test_a_fixed_joint_of_four_digits_tilts_no_length():
    """Flanges and mounts are turned by 1.5708 as well: what is written behind them stays."""
    joints = [
        J("mount", "a", "m", (0, 0, 0.1), kind="fixed", rpy=(1.5708, 0, 0)),
        J("j1", "m", "b", (0.1, 0.2, 0.3), Y),
        J("j2", "b", "c", (0.4, 0, 0), Y, rpy=(1.5708, 0, 0)),
        J("f1", "c", "flange", (0.05, 0, 0), kind="fixed", rpy=(0, -1.5708, -1.5708)),
        J("f2", "flange", "tool", (0.01, 0.02, 0.15), kind="fixed"),
    ]  # fmt: skip
    arm = load(urdf(joints), tip="tool", task="position")
    exact = nominal(arm)
    assert exact.translation == (
        (Fraction("0.1"), Fraction("-0.3"), Fraction("0.3")),
        (0, Fraction("0.4"), 0),
        (Fraction("0.01"), Fraction("0.07"), Fraction("0.15")),
    )
    assert {s.what for s in exact.snaps} == {"angle"}
    check(arm, exact, draw(arm, np.random.default_rng(1), 50))


# Exact numbers with square roots of 2 and 3 ----------------------------------------------

fractions = st.fractions(min_value=-9, max_value=9, max_denominator=50)
numbers = st.builds(surd, fractions, fractions, fractions, fractions)


@pytest.mark.parametrize("steps", range(-30, 31))
def test_multiples_of_fifteen_degrees(steps):
    angle = math.radians(15 * steps)
    assert float(cosine(steps)) == pytest.approx(math.cos(angle), abs=1e-14)
    assert float(sine(steps)) == pytest.approx(math.sin(angle), abs=1e-14)
    assert cosine(steps) * cosine(steps) + sine(steps) * sine(steps) == 1
    if steps % 6 == 0 or steps % 4 == 0:
        assert isinstance(cosine(steps), Fraction)  # what is rational is no Surd


@pytest.mark.slow
@given(numbers, numbers, numbers)
def test_the_field(a, b, c):
    assert a + b == b + a
    assert a * b == b * a
    assert (a + b) * c == a * c + b * c
    assert (a - b, a - a) == (-(b - a), 0)
    if a != 0:
        assert a / a == 1
        assert b / a * a == b
        assert 1 / a * a == 1
    assert float(a * b) == pytest.approx(float(a) * float(b), rel=1e-9, abs=1e-9)
    assert hash(a + b) == hash(b + a)


@pytest.mark.slow
@given(numbers)
def test_floats_do_not_cancel(a):
    """A number close to zero keeps all its digits."""
    value = sum(float(p) * math.sqrt(s) for p, s in zip(parts_of(a), SQUARES, strict=True))
    assert float(a) == pytest.approx(value, abs=1e-12)
    tiny = surd(Fraction(-665857), Fraction(470832), Fraction(0), Fraction(0))  # a convergent
    assert isinstance(tiny, Surd)
    assert float(tiny) == pytest.approx(-1 / (665857 + 470832 * math.sqrt(2)), rel=1e-12)
