"""The exact geometry: what is snapped, what stays, and how far it is from the file's."""

import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from arms import CATALOGUE, draw, place, serial
from batch_cases import reference_jacobian
from golden import Golden
from hypothesis import given, strategies as st
from pinocchio.utils import rotate
from tiers import sampled, tiered_rows
from urdf_text import Y, Z, chain_text, follows

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
        M = np.array(R, dtype=object)
        assert (M.T @ M == IDENTITY).all()
        assert M[0] @ np.cross(M[1], M[2]) == 1
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


def upright(degrees: float, at: int) -> list[pin.SE3]:
    """Joints at right angles, one of which stands turned about its own axis."""
    turns = [rotation("x", 90 * (i > 0) - 180 * (i > 1)) for i in range(3)]
    turns[at] = turns[at] @ rotation("z", degrees)
    return [place((0.1 * i, 0, 0.3), R) for i, R in enumerate(turns)]


def along(axis: tuple[float, ...]) -> list[tuple[object, pin.SE3]]:
    unit = np.array(axis, dtype=float)
    return [
        (pin.JointModelRX(), place((0.1, 0.2, 0.3))),
        (pin.JointModelRevoluteUnaligned(unit), place((0, 0.25, 0))),
        (pin.JointModelPrismaticUnaligned(unit), place((0, 0.25, 0), rotation("y", 90))),
        (pin.JointModelRY(), place((0.1, 0, 0))),
    ]


CALIBRATED = [
    place((0.0, 0.0, 0.162712244574), rotate("x", math.pi / 2 + 1.5e-3)),
    place((-0.425170344631, 1.23e-5, 0.0003519), rotate("y", -1e-3)),
    place((0.0, -0.099603596358, 2.5e-6)),
]
IIWA = [
    place((0, 0, 0.36)), place((-0.000436, 0, 0.42), rotation("x", 90)),
    place((0.01, 0.4, 0), rotation("x", -90)),
]  # fmt: skip
ROUNDED = [
    place((0.1, 0, 0.2)), place((0, -0.0611, 0.0181), rotate("x", 1.5708)),
    place((0.1, 0.0611, 0.0181), (rotation("z", -177.2) @ rotate("x", 1.5708)).T),
]  # fmt: skip
FAR = [place((0.3, 0, 0), rotate("x", a)) for a in (0.0, math.pi / 2 + 2 * ANGLE_TOL)]
TILTS = [(0.9, 1.4e-9), (math.pi / 4 + 1e-6, 0.0)]
# Joints, the tip behind them, and tolerances.
MADE = {
    **{
        f"a right angle written {x}": (
            [place((0, 0, 0.1)), place((0.4, 0, 0), rotate("x", x))], (0.25, 0, 0.125), {},
        )
        for x in (1.5708, 1.57, -1.5707963, 3.14, 3.1416, -1.571, 0.0005)
    },
    "beyond the tolerance": (FAR, (0, 0, 0), {}),
    "within a larger tolerance": (FAR, (0, 0, 0), {"angle_tol": 3 * ANGLE_TOL}),
    "calibrated, lengths with all their digits": (CALIBRATED, (0.0007, 0, 0.1), {}),
    "calibrated, larger tolerance": (CALIBRATED, (0.0007, 0, 0.1), {"angle_tol": 0.01}),
    "origins slide along axes as they are made": (ROUNDED, (0, 0, 0.1), {}),
    "an offset of 0.436 mm": (IIWA, (0, 0, 0.126), {}),
    "an offset of 0.436 mm, gone on request": (IIWA, (0, 0, 0.126), {"snap_length": 1e-3}),
    **{
        f"joint {at} stands turned by {degrees}": (upright(degrees, at), (0.5, 0.2, 0), {})
        for degrees in (45, -30, 17.3, 90, 135, 180) for at in range(3)
    },
    **{
        f"a twist of {degrees} of {digits} digits": (
            [
                place((0, 0, 0.4)),
                place((0.1, 0, 0), rotate("x", round(math.radians(degrees), digits))),
                place((0.2, 0, 0), rotation("x", -90)),
            ],
            (0.3, 0, 0.08), {},
        )
        for degrees in (15, -30, 45, 60, -75, 105, 135, 150, -165) for digits in (4, 16)
    },
    **{
        f"a milliradian beside a tilt of {tilt:.2f}": (
            [
                place((0, 0, 0.4)),
                place((0.3, 0, 0.1), rotate("z", 1.1e-3) @ rotate("x", tilt) @ rotate("z", last)),
            ],
            (0.2, 0, 0), {},
        )
        for tilt, last in TILTS
    },
    **{
        f"axes along {axis}": (along(axis), (0.3, 0, 0.1), {})
        for axis in ((1, 0, 0), (0, -1, 0), (0, 0, -1), (-1, 0, 0), (0, 1, 0))
    },
}  # fmt: skip
GEOMETRY = Golden(Path(__file__).with_name("nominal.txt"))


def written(number: Fraction | Surd) -> str:
    """Exactly; to nine digits where a machine's last bit may tell."""
    if max(part.denominator for part in parts_of(number)) > 10**6:
        return f"{float(number):.9g}"
    terms = zip(parts_of(number), SQUARES, strict=True)
    return " + ".join(f"{p} √{s}" if s > 1 else str(p) for p, s in terms if p) or "0"


def about(size: float) -> str:
    return f"{size:.1e}" if size > 1e-9 else "rounding"


@pytest.mark.parametrize("head", GEOMETRY.heads())
def test_what_is_exact(head):
    """Of arms that files describe, and of chains made: all numbers, and what was moved."""
    if head in MADE:
        joints, tip, tolerances = MADE[head]
        exact, seen = snapped(joints, place(tip), count=30, **tolerances)
        assert exact.jacobian_change < 1e-9 or exact.jacobian_change < 10 * seen
    else:
        exact = nominal(load(head))
    said = [
        f"{', '.join(map(str, t))}; {', '.join(written(x) for row in R for x in row)}"
        for t, R in zip(exact.translation, exact.rotation, strict=True)
    ]
    said += [f"moved: {s.what} of {s.where} by {about(s.size)}" for s in exact.snaps]
    deviation = Deviation.of(exact.snaps)
    if deviation is not None and not deviation.twist:
        said.append(str(deviation))
    change = about(exact.jacobian_change)
    GEOMETRY.hold(head, "\n".join([*said, f"columns change by {change}; exact: {exact.exact}"]))


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
    kinds = "revolute", "continuous", "revolute", "continuous", "revolute"
    more = "", "", follows(1, -3, 0.1), follows(2, 2), ""
    rows = [(k, (0.4, 0, 0), Z, (1.5708, 0, 0), m) for k, m in zip(kinds, more, strict=True)]
    arm = load(chain_text(rows))
    assert arm.n == 3
    exact = nominal(arm)
    seen = check(arm, exact, draw(arm, rng, 200))
    assert seen < exact.jacobian_change < 30 * seen


def test_the_arm_on_the_exact_geometry(rng):
    arm, tenth = load("xarm7"), load("xarm7", length_scale=0.1)
    model, q = arm.model.copy(), draw(arm, rng, 1)[0]
    before = frame_jacobian(arm, q)
    assert nominal(tenth).jacobian_change > 2 * nominal(arm).jacobian_change
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
    assert (found.t == np.array(exact.translation, dtype=float)).all()
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


def test_a_fixed_joint_of_four_digits_tilts_no_length(rng):
    """Flanges and mounts are turned by 1.5708 as well: what is written behind them stays."""
    rows = [
        ("fixed", (0, 0, 0.1), Z, (1.5708, 0, 0)), ("continuous", (0.1, 0.2, 0.3), Y),
        ("continuous", (0.4, 0, 0), Y, (1.5708, 0, 0)),
        ("fixed", (0.05, 0, 0), Z, (0, -1.5708, -1.5708)), ("fixed", (0.01, 0.02, 0.15)),
    ]  # fmt: skip
    arm = load(chain_text(rows), tip="l5", task="position")
    exact = nominal(arm)
    lengths = ("0.1", "-0.3", "0.3"), (0, "0.4", 0), ("0.01", "0.07", "0.15")
    assert exact.translation == tuple(tuple(map(Fraction, row)) for row in lengths)
    assert {s.what for s in exact.snaps} == {"angle"}
    check(arm, exact, draw(arm, rng, 50))


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


def test_floats_do_not_cancel():
    """A number close to zero keeps all its digits."""
    tiny = surd(Fraction(-665857), Fraction(470832), Fraction(0), Fraction(0))  # a convergent
    assert isinstance(tiny, Surd)
    assert float(tiny) == pytest.approx(-1 / (665857 + 470832 * math.sqrt(2)), rel=1e-12)


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
    value = sum(float(p) * math.sqrt(s) for p, s in zip(parts_of(a), SQUARES, strict=True))
    assert float(a) == pytest.approx(value, abs=1e-12)
