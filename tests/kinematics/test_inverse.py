"""Inverse solutions against other libraries, and proofs that they exist.

Signs that tell solutions apart, and the names that the field has for them. Joint speeds near
singularities: each method against its formula, and that nothing jumps.
"""

import functools
import sys

import numpy as np
import pinocchio as pin
import pytest
from dh_arms import CRX as CRX_ROWS, arm_of, dh_arm
from tiers import sampled, tiered, tiered_rows

import pinsing
from pinsing.errors import ConfigurationError, OptionError, UnknownNameError
from pinsing.kinematics.inverse import FoundSolutions, Solver, drawn, radii
from pinsing.kinematics.inverse_velocity import METHODS
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.ladder import ExactChain, Point, ladder_of, one_root_left, posture_names

UR5 = (
    (0.089159, 0, 90), (0, -0.425, 0), (0, -0.39225, 0), (0.10915, 0, 90), (0.09465, 0, -90),
    (0.0823, 0, 0),
)  # fmt: skip
PUMA = (
    (0, 0, 90), (0, 0.4318, 0), (0.15005, 0.0203, -90), (0.4318, 0, 90), (0, 0, -90), (0, 0, 0),
)  # fmt: skip
CRX = tuple((d, a, alpha) for alpha, a, d, *_ in CRX_ROWS)


@functools.cache
def made(rows, task="pose"):
    """A table as a robot of its own, so that angles are those of the formulas."""
    return dh_arm([(alpha, a, d) for d, a, alpha in rows], task)


def pose_of(arm, q):
    return tip_placement(arm, np.array(q)).homogeneous


def gaps(arm, found, q):
    """How far q, or each row of it, is from the nearest of some solutions, whole turns aside."""
    far = np.abs(arm.space.wrap(np.asarray(q)[..., None, :] - found.q))
    return far.max(axis=-1).min(axis=-1, initial=np.inf)


def solver_of(rows, library="eaik"):
    """What another library finds of a pose (4, 4): all solutions. ssik (BSD-3) is not required.

    Of an offset wrist ssik derives its equations once, which takes two minutes, and keeps them.
    """
    d, a, alpha = np.array(rows, dtype=float).T
    if library == "ssik":
        ssik = pytest.importorskip("ssik", reason="pip install ssik cython")
        other = ssik.Manipulator.from_dh(np.radians(alpha), a, d)
        return lambda T: np.array([s.q for s in other.solve(T)])
    eaik = pytest.importorskip("eaik.IK_DH", reason="EAIK has no wheel for this Python")
    robot = eaik.DhRobot(np.radians(alpha), a, d)

    def exact(T):
        found = robot.IK(T)
        return found.Q[~np.array(found.is_LS)]

    return exact


LIBRARIES = [
    # library, table, solutions of a pose at least, poses, whether EAIK is taken from ours
    ("eaik", PUMA, 7.9, 10, False), ("eaik", PUMA, 7.9, 10, True),
    ("eaik", PUMA, 7.9, 500, False), ("eaik", UR5, 6, 500, False), ("eaik", UR5, 6, 500, True),
    *(("ssik", rows, 6, 500, False) for rows in (UR5, PUMA, CRX)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("library", "rows", "mean", "count", "own"), tiered_rows(LIBRARIES, LIBRARIES[:2])
)
def test_against_another_library(monkeypatch, library, rows, mean, count, own):
    """Every solution of the other is found, or the pose carries a doubt; none is made up.

    A PUMA meets poses so near its shoulder's singularity that no proof is to be had there.
    """
    if own:
        monkeypatch.setattr(sys.modules[Solver.__module__], "decomposed", lambda *_: None)
    arm, total, certified, solve = made(rows), 0, 0, solver_of(rows, library)
    for q in arm.space.sample(count, np.random.default_rng(int(count > 10)), True):
        T = pose_of(arm, q)
        theirs, found = solve(T), pinsing.inverse(arm, T)
        missed = (gaps(arm, found, theirs) > 1e-6).sum()
        assert len(found) <= len(theirs)
        assert found.doubt or not missed
        assert found.certified <= len(found)
        full = any("no more regular ones" in note for note in found.notes)
        assert full == (sum(s.regular for s in found) == 8 and rows is not CRX)
        certified += found.certified
        total += len(found) - missed
    assert total > count * mean
    assert certified == total if count == 10 or rows is UR5 else certified > 0.99 * total


@pytest.mark.slow
@pytest.mark.parametrize("rows", [UR5, PUMA], ids=["ur5", "puma"])
def test_pairs_next_to_a_singularity_are_told_apart(rows):
    """Stretched elbows but for 1e-4 and less: two solutions that near, of opposite signs."""
    arm, least, solve = made(rows), [], solver_of(rows)
    for q in arm.space.sample(8, np.random.default_rng(9), True):
        q[2] = 4e-5 - (0 if rows is UR5 else np.arctan2(0.4318, 0.0203))
        T = pose_of(arm, q)
        found = pinsing.inverse(arm, T)
        assert found.doubt or gaps(arm, found, solve(T)).max() < 1e-5
        turn = arm.space.wrap(found.q[:, None] - found.q)
        least.append(np.abs(turn).max(axis=2)[~np.eye(len(found), dtype=bool)].min())
    assert min(least) < 2e-4


@pytest.mark.slow
def test_more_starts_find_no_more_for_an_offset_wrist():
    """Of another seed, where there is no doubt."""
    arm, seen = made(CRX), set()
    for q in arm.space.sample(120, np.random.default_rng(11), True):
        T = pose_of(arm, q)
        found, more = pinsing.inverse(arm, T), pinsing.inverse(arm, T, starts=1024, seed=7)
        for s in found.q:
            assert np.abs(pose_of(arm, s) - T).max() < 1e-9
        assert found.doubt or (len(found) >= len(more) and len(found) % 2 == 0)
        seen.add(len(found))
    assert seen >= {4, 8, 12}


def test_a_sign_that_lacks_is_known():
    """Solutions of a pose with one left out: the determinants do not balance, and starts follow."""
    arm = made(CRX)
    q = np.array([0.3, -0.8, 1.1, 0.4, 0.9, -0.5])
    T = tip_placement(arm, q)
    solver = Solver(arm, T.translation, T.rotation)
    known = pinsing.inverse(arm, T.homogeneous)
    # A start that stalled beside one of them is no doubt, elsewhere it is.
    solver._stalled = np.array([[*known.q[0], 1e-3]])
    assert (solver.doubt(known.q), bool(solver.doubt(known.q[1:]))) == ("", True)
    found = FoundSolutions(solver)
    found.add(known.q, np.zeros(len(known)))
    assert found.lacking == 0
    for out in range(len(known)):
        found = FoundSolutions(solver)
        rest = np.delete(known.q, out, axis=0)
        found.add(rest, np.zeros(len(rest)))
        assert found.lacking == solver.signs(known.q[out : out + 1])[0]
        assert not found.settled()
        rng = np.random.default_rng(0)
        Q = drawn(solver, 40, rng, found.lacking)
        assert (solver.signs(Q) == found.lacking).all()


@pytest.mark.parametrize("name", ["ur5", "stanford", "kinova"])
def test_the_true_solution_is_within_the_radius(name):
    arm = pinsing.load(name)
    q = arm.space.sample(1, np.random.default_rng(5), True)[0]
    T = tip_placement(arm, q)
    solver = Solver(arm, T.translation, T.rotation)
    rng = np.random.default_rng(0)
    for size in (1e-9, 1e-7, 1e-5, 1e-4):
        Q = q + rng.normal(size=(40, 6)) * size
        r = radii(solver, Q)
        assert (r > np.linalg.norm(Q - q, axis=1)).all()
        assert size > 1e-9 or (r < 1e-4).all()
    assert np.isinf(radii(solver, q + rng.normal(size=(40, 6)))).all()


# The upper arm and the forearm of PUMA 560 are of almost one length: its elbow folded, the wrist
# is half a millimetre from the axis of joint 2, and the pose tells little about two joints.
FOLDED = np.pi / 2 + np.arctan2(0.0203, 0.4318)


@pytest.mark.parametrize("q5", sampled([1e-7, 3e-8, 1e-8, 1e-9, 0.0]))
def test_next_to_the_wrist_singularity_a_solution_is_found_and_flagged(q5):
    arm = arm_of("puma560")
    q = [0.3, 0.4, -0.5, 0.2, q5, 0.1]
    found = pinsing.inverse(arm, pose_of(arm, q))
    assert sum(s.regular for s in found) == 6
    straight = [s for s in found if abs(s.q[4]) < 1e-6]
    assert straight
    assert not any(s.regular for s in straight)
    assert all(np.isinf(s.radius) for s in straight)
    assert "SINGULAR" in str(found)
    if q5 > 1e-8:
        assert gaps(arm, found, q) < 1e-6


@pytest.mark.parametrize("name", ["puma560", "irb1400"])
def test_nearly_straight_wrists_are_found(name):
    """Closed solutions of such poses are of least squares only."""
    arm, rng = arm_of(name), np.random.default_rng(0)
    Q = arm.space.sample(8, rng, True)
    Q[:, 4] = 10 ** rng.uniform(-12, -7, len(Q))
    for q in Q:
        assert min(abs(s.q[4]) for s in pinsing.inverse(arm, pose_of(arm, q))) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("e", [3e-3, 1e-3, 1e-4])
def test_reachable_is_not_called_out_of_reach(e):
    arm = arm_of("puma560")
    q = [0.3, 0.4, FOLDED + e, 0.2, 0.5, 0.1]
    found = pinsing.inverse(arm, pose_of(arm, q))
    assert len(found) or ("stalled" in found.doubt and "out of reach" not in str(found))
    assert gaps(arm, pinsing.inverse(arm, pose_of(arm, q), near=q), q) < 1e-6


FAR = [
    ("ur5", [5.0, 0, 0, 0, 0, 0]), ("stanford", [9e8] * 6), ("puma560", [9e8] * 6),
    ("puma560", [1e9, -1e9, 0, 1e8, 0, 0]), ("puma560", [1e6, 0, 0, 0, 0, 0]),
]  # fmt: skip


@pytest.mark.parametrize(("name", "pose"), tiered_rows(FAR, FAR[:1]))
def test_out_of_reach_is_an_answer_and_huge_poses_overflow_nothing(name, pose):
    found = pinsing.inverse(arm_of(name), pose)
    assert len(found) == 0
    assert "out of reach" in str(found)
    with pytest.raises(ConfigurationError, match="which no arm reaches"):
        pinsing.inverse(arm_of(name), [1e300] * 6)


def test_a_joint_held_outside_its_limits_stays_there_and_is_flagged():
    arm = pinsing.load("iiwa14", units="rad")
    q = np.array([0.1, 0.5, 0.3, -1, 0.2, 0.7, 0.4])
    pose = pose_of(arm, q)
    found = pinsing.inverse(arm, pose, fixed={arm.joints[2]: 0.3 + 4 * np.pi})
    assert len(found) == 8
    assert all(s.q[2] == 0.3 + 4 * np.pi for s in found)
    assert not any(s.within_limits for s in found)
    assert any("outside its limits" in n for n in found.notes)
    inside = pinsing.inverse(arm, pose, fixed={arm.joints[2]: 0.3})
    assert any(s.within_limits for s in inside)
    assert not any("outside its limits" in n for n in inside.notes)


ROBOTS = ["ur5", "puma560", "stanford", "kinova", "scara", "planar3r"]


@pytest.mark.parametrize("name", tiered(ROBOTS, ("ur5", "planar3r")))
def test_the_pose_is_reached_and_the_source_is_among_them(name):
    arm = arm_of(name)
    for q in arm.space.sample(4, np.random.default_rng(2), True):
        T = pose_of(arm, q)
        found = pinsing.inverse(arm, T)
        for s in found:
            assert np.abs(pose_of(arm, s.q) - T).max() < 1e-9
            assert s.within_limits == (not arm.space.outside(s.q).any())
        assert gaps(arm, found, q) < 1e-6


def test_a_redundant_arm_needs_joints_to_hold():
    arm = arm_of("panda")
    q = np.array([0.1, -0.5, 0.3, -2.0, 0.2, 1.7, 0.4])
    T = pose_of(arm, q)
    with pytest.raises(OptionError, match="hold 1 more"):
        pinsing.inverse(arm, T)
    found = pinsing.inverse(arm, T, fixed={arm.joints[2]: 0.3})
    assert gaps(arm, found, q) < 1e-6
    np.testing.assert_allclose(found.q[:, 2], 0.3, rtol=1e-6)
    with pytest.raises(UnknownNameError):
        pinsing.inverse(arm, T, fixed={"nope": 0.0})


def share(arm, count=60):
    """det J over the product of what the signs are taken of, at random configurations."""
    nominal = pinsing.robot.nominal(arm)
    ladder = ladder_of(nominal)
    Q = nominal.arm.space.sample(count, np.random.default_rng(3), True)
    J = pinsing.kinematics.task_jacobians(nominal.arm, Q)
    rows = np.abs(J).max(axis=(0, 2)) > 1e-12
    det = np.linalg.det(J[:, rows])
    return det / np.prod([s.value(Q) for s in ladder.stages], axis=0)


ARMS = ["ur5", "puma560", "irb1400", "kinova", "z1", "talos_arm", "stanford", "scara"]


@pytest.mark.parametrize("name", ARMS)
def test_the_determinant_is_the_product_of_the_signed_values(name):
    """So they are zero exactly where the arm is singular: up to one constant, of one size."""
    ratio = share(pinsing.load(name))
    assert np.ptp(np.abs(ratio)) < 1e-9 * np.abs(ratio[0])


POSITION = {
    "first axes parallel": [(0, 1, 0), (90, 0.7, 0.2), (0, 0.5, 0.1)],
    "first axes cross": [(90, 0, 0.3), (60, 0.7, 0.2), (0, 0.5, 0.1)],
    "last axes parallel": [(90, 0.4, 0.3), (0, 0.7, 0.2), (0, 0.5, 0.1)],
    "twisted, last axes parallel": [(60, 0.4, 0.3), (0, 0.7, 0.2), (0, 0.5, 0.1)],
    "orthogonal, no offset": [(-90, 1, 0), (90, 2, 0), (0, 1.5, 0)],
    "few solutions": [(-90, 1, 0), (90, 2, 1), (0, 0.1, 0)],
    "a slide, the first axes cross": [(90, 0, 0), (90, 0.3, 0.2), (0, 0, 0.5, 0, "prismatic")],
    "a slide, offset": [(90, 0.4, 0), (90, 0, 0.2), (0, 0, 0.5, 0, "prismatic")],
}


@pytest.mark.parametrize("name", tiered(POSITION, {"a slide, offset"}))
def test_no_two_solutions_of_a_point_agree_in_all_signs(name):
    """The theorem, at random points; with the product of the values against det J."""
    rows = POSITION[name]
    arm = dh_arm(rows, "position")
    ladder = ladder_of(pinsing.robot.nominal(arm))
    assert ladder is not None
    ratio = share(arm)
    assert (ratio > 0).all() or (ratio < 0).all() or rows[0][0] == 0
    rng = np.random.default_rng(1)
    most = 0
    for q in arm.space.sample(6, rng, True):
        found = [s.q for s in pinsing.inverse(arm, tip_placement(arm, q).translation) if s.regular]
        signs = ladder.signs(np.array(found))
        assert len({tuple(s) for s in signs}) == len(found)
        most = max(most, len(found))
    assert 2 <= most <= ladder.most


@pytest.mark.slow
def test_what_is_left_of_the_equation_has_the_roots_of_the_others():
    """The sign of its discriminant against the number of solutions found, arm with 2 and 4."""
    arm = dh_arm([(-90, 1, 0), (90, 2, 1), (0, 1.5, 0)], "position")
    chain = ExactChain.of(pinsing.robot.nominal(arm))
    cubic = Point.of(chain, chain.translation[3]).numbers
    assert not one_root_left(cubic)
    counts = set()
    for q in arm.space.sample(12, np.random.default_rng(2), True):
        sign = float(cubic.discriminant(chain.values(q[None])[:, 1:])[0])
        known = pinsing.inverse(arm, tip_placement(arm, q).translation)
        counts.add(len(known))
        assert len(known) == (2 if sign < 0 else 4)
    assert counts == {2, 4}


def test_the_discriminant_is_the_sum_that_stands_for_it():
    arm = dh_arm([(-70, 1, 0.2), (80, 2, 1), (0, 1.5, 0)], "position")
    chain = ExactChain.of(pinsing.robot.nominal(arm))
    cubic = Point.of(chain, chain.translation[3]).numbers
    x = np.random.default_rng(0).uniform(-4, 4, (2000, 2))
    value, (amplitude, phase, rate) = cubic.discriminant(x), cubic.expanded()
    assert np.abs(np.cos(x @ rate.T + phase) @ amplitude - value).max() < 12 * cubic.rounding
    assert cubic.rounding < 1e-8 * np.abs(value).max()
    for first, second in ((-90, 90), (60, 30)):  # the sine of 60 degrees has a square root
        rows = [(first, 1, 0), (second, 2, 1), (0, 1.5, 0.1 * (first > 0))]
        assert ladder_of(pinsing.robot.nominal(dh_arm(rows, "position"))) is None
    for name in ("so101", "panda", "iiwa14"):
        assert ladder_of(pinsing.robot.nominal(pinsing.load(name))) is None


AT_WORK = [
    ("rs007n", (0, 20, -80, 0, -80, 0)), ("a0509", (0, 20, 90, 0, 70, 0)),
    ("z1", (0, 90, -90, 0, 30, 0)), ("uf850", (0, -20, -90, 0, 70, 0)),
]  # fmt: skip
FANUC = [(name, (0, -11, -17, 0, -90, 0)) for name in ("lrmate200id", "m10id", "r2000ic")]


@pytest.mark.parametrize(("name", "q"), [*sampled(AT_WORK), *FANUC])
def test_an_arm_at_work_has_its_shoulder_in_front(name, q):
    """Also one that stands on its first axis at zero, or with the wrist a little behind it."""
    (said,) = posture_names(pinsing.robot.nominal(pinsing.load(name)), np.radians([q]))
    assert said[:2] == ("shoulder front", "elbow up")
    assert said[2] == "wrist no-flip" or (name, q) not in FANUC  # as pendants show it, tool down


def test_elbow_up_is_up():
    """The elbow over the line from shoulder to wrist, while the wrist is ahead; by Pinocchio."""
    geometry = pinsing.robot.nominal(pinsing.load("irb1400"))
    arm, seen = geometry.arm, 0
    data = arm.model.createData()
    Q = arm.space.sample(200, np.random.default_rng(0))
    for q, said in zip(Q, posture_names(geometry, Q), strict=True):
        pin.forwardKinematics(arm.model, data, arm.model_q(q))
        shoulder, elbow, wrist = (data.oMi[k].translation for k in (2, 3, 5))
        out = (wrist - shoulder) * [1, 1, 0]
        beyond = np.linalg.norm(wrist[:2]) > np.linalg.norm(shoulder[:2])
        if shoulder[:2] @ wrist[:2] > 0 and beyond and np.linalg.norm(out) > 0.1:
            above = np.cross(wrist - shoulder, elbow - shoulder) @ np.cross(out, [0, 0, 1]) > 0
            assert said[:2] == ("shoulder front", f"elbow {'up' if above else 'down'}")
            seen += 1
    assert seen > 20


@pytest.mark.parametrize("name", tiered(["ur5", "puma560", "kinova", "z1"], ("ur5",)))
def test_they_change_at_singular_configurations_alone(name):
    """And postures of one pose have different names."""
    arm = pinsing.load(name)
    form = pinsing.closed_form(arm)
    found = pinsing.aspects(form, limits=False)
    Q = arm.space.sample(200, np.random.default_rng(4), True)
    names = posture_names(form.geometry, Q)
    pairs = {(found.of(q), said) for q, said in zip(Q, names, strict=True)}
    assert len({number for number, _ in pairs}) == len({n for _, n in pairs}) == len(pairs) == 8
    solved = pinsing.inverse(arm, pose_of(arm, Q[0])).q
    assert len(set(posture_names(form.geometry, solved))) == len(solved) >= 4


DAMPED = [m for m in METHODS if m != "pinv"]


def wrist(q5: float) -> np.ndarray:
    return pinsing.frame_jacobian(pinsing.load("ur5"), [0.3, -1, 1, -1, q5, 0])


def test_the_pseudoinverse_is_that_of_numpy(rng) -> None:
    for shape in ((6, 6), (6, 7), (3, 6), (6, 4), (1, 3)):
        J, x = rng.normal(size=(20, *shape)), rng.normal(size=(20, shape[0]))
        found = pinsing.inverse_velocity(J, x, "pinv")
        np.testing.assert_allclose(found.dq, np.einsum("...nm,...m->...n", np.linalg.pinv(J), x))
        np.testing.assert_allclose(found.achieved + found.missed, x)
        np.testing.assert_allclose(found.kept, 1)
        assert (found.damped < 1e-12).all()


def selective(J: np.ndarray, x: np.ndarray, limit: float) -> np.ndarray:
    """Buss and Kim 2005, step by step in loops, for one target."""
    U, s, VT = np.linalg.svd(J, full_matrices=False)
    total = np.zeros(J.shape[1])
    for i in np.flatnonzero(s > 1e-12 * s[0]):
        M = sum(abs(VT[i, j]) * np.linalg.norm(J[:, j]) for j in range(J.shape[1])) / s[i]
        gamma = min(1.0, np.linalg.norm(U[:, i]) / M) * limit
        part = U[:, i] @ x / s[i] * VT[i]
        total += part * min(1.0, gamma / max(np.abs(part).max(), 1e-300))
    return total * min(1.0, limit / np.abs(total).max())


def jparse(J: np.ndarray, x: np.ndarray, gamma: float) -> np.ndarray:
    """J_s^+ J_p J_p^+ + J_s^+ Phi of arXiv 2505.00306, with matrices."""
    U, s, VT = np.linalg.svd(J)
    low = s <= gamma * s[0]
    safety = U @ np.diag(np.where(low, gamma * s[0], s)) @ VT
    projection = U @ np.diag(np.where(low, 0, s)) @ VT
    phi = U @ np.diag(np.where(low, s / (gamma * s[0]), 0)) @ U.T
    both = projection @ np.linalg.pinv(projection, rcond=1e-9) + phi
    return np.linalg.pinv(safety) @ both @ x


@pytest.mark.parametrize("q5", [0.0, 1e-6, 1e-3, 0.01, 0.02, 0.05, 0.2, 1.0, 1.2])
def test_each_method_is_its_formula(q5: float, rng) -> None:
    J, x = wrist(q5), rng.normal(size=6)
    U, sigma, _ = np.linalg.svd(J)
    gram, w = J @ J.T, np.sqrt(abs(np.linalg.det(J @ J.T)))
    threshold = (sigma[-1] + sigma[-2]) / 2  # one direction is below it
    lost = np.outer(U[:, -1], U[:, -1])

    def damped(square: np.ndarray) -> np.ndarray:
        return J.T @ np.linalg.solve(gram + square, x)

    def least(share: float) -> np.ndarray:
        return damped((0.07 * max(1 - share, 0)) ** 2 * np.eye(6))

    beta = 0.3**2 * (1 - (sigma[-1] / threshold) ** 2)
    filtered = {"damping": 0.3, "threshold": threshold, "isotropic": 0.01}
    for method, options, wanted, close in (
        ("dls", {"damping": 0.07, "threshold": 0.2}, least(sigma[-1] / 0.2), {"rtol": 1e-7}),
        ("dls", {"damping": 0.07, "manipulability": 0.05}, least(w / 0.05), {"rtol": 1e-6}),
        ("filter", filtered, damped(1e-4 * np.eye(6) + beta * lost), {"rtol": 1e-8}),
        ("sdls", {"gamma_max": 0.6}, selective(J, x, 0.6), {"atol": 1e-12}),
        ("jparse", {"gamma": 0.15}, jparse(J, x, 0.15), {"atol": 1e-10}),
    ):
        found = pinsing.inverse_velocity(J, x, method, **options)
        np.testing.assert_allclose(found.dq, wanted, **close)
        np.testing.assert_allclose(found.achieved, J @ found.dq, atol=1e-12)
    J, x = rng.normal(size=(3, 7)), rng.normal(size=3)
    found = pinsing.inverse_velocity(J, x, "sdls", gamma_max=0.6)
    np.testing.assert_allclose(found.dq, selective(J, x, 0.6), atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_far_from_singularities_all_is_achieved(method: str, rng) -> None:
    J, x = wrist(1.2), 0.05 * rng.normal(size=6)
    found = pinsing.inverse_velocity(J, x, method, threshold=0.02, gamma=0.01, gamma_max=10.0)
    np.testing.assert_allclose(found.achieved, x, atol=1e-12)
    assert found.damped < 1e-9


@pytest.mark.parametrize("method", sampled(DAMPED))
def test_speeds_stay_bounded_and_do_not_jump_through_a_singularity(method: str) -> None:
    q5 = np.linspace(-0.3, 0.3, 6001)
    Q = np.tile([0.3, -1, 1, -1, 0, 0], (len(q5), 1))
    Q[:, 4] = q5
    J = pinsing.kinematics.frame_jacobians(pinsing.load("ur5"), Q)
    x = np.array([0, 0.1, 0.1, 0.3, 0.2, 0.1])
    found = pinsing.inverse_velocity(J, x, method)
    assert np.abs(found.dq).max() < 6
    assert np.abs(np.diff(found.dq, axis=0)).max() < 0.05
    plain = pinsing.inverse_velocity(J, x, "pinv")
    assert np.abs(plain.dq).max() > 1000  # so that this could fail
    assert found.damped[3000] == pytest.approx(1, abs=1e-6)
    assert found.damped.min() < 0.9


@pytest.mark.parametrize("method", ["dls", "filter", "jparse"])
def test_two_lost_directions_that_change_places_make_no_jump(method: str) -> None:
    a = np.linspace(0.01, 0.04, 2001)
    J = np.zeros((len(a), 3, 3))
    J[:, 0, 0], J[:, 1, 1], J[:, 2, 2] = 1, a, 0.05 - a
    found = pinsing.inverse_velocity(J, [0.1, 0.2, 0.3], method)
    assert np.abs(np.diff(found.dq, axis=0)).max() < 0.01


def test_joint_speed_limits_keep_the_direction() -> None:
    J, x = wrist(0.05), np.array([0.3, 0, 0.2, 0, 0.5, 0.1])
    free = pinsing.inverse_velocity(J, x, "pinv")
    limits = np.array([1, 1, 1, 0.4, 1, np.inf])
    held = pinsing.inverse_velocity(J, x, "pinv", speed_limits=limits)
    assert (np.abs(held.dq) <= limits * (1 + 1e-12)).all()
    assert (np.abs(held.dq) / limits).max() == pytest.approx(1)
    np.testing.assert_allclose(held.dq, free.dq * held.speed_scale)
    np.testing.assert_allclose(held.achieved, held.speed_scale * x, atol=1e-12)


@pytest.mark.parametrize(
    ("J", "twist", "options", "error", "words"),
    [
        (np.eye(6), np.ones(5), {}, ConfigurationError, "6 values"),
        (np.ones(6), np.ones(6), {}, ConfigurationError, "shape"),
        (np.full((6, 6), np.nan), np.ones(6), {}, ConfigurationError, "finite"),
        (np.ones((3, 6, 6)), np.ones((4, 6)), {}, ConfigurationError, "as many"),
        (np.eye(6), np.ones(6), {"method": "magic"}, OptionError, "pinv, dls"),
        (np.eye(6), np.ones(6), {"damping": 0.0}, OptionError, "damping"),
        (np.eye(6), np.ones(6), {"gamma": 1.0}, OptionError, "gamma"),
        (np.eye(6), np.ones(6), {"length_scale": -1.0}, OptionError, "length_scale"),
        (np.eye(3), np.ones(3), {"length_scale": 0.5}, OptionError, "of 6 rows"),
        (np.eye(6), np.ones(6), {"weights": np.zeros(6)}, OptionError, "weights"),
        (np.eye(6), np.ones(6), {"speed_limits": [1.0]}, OptionError, "speed_limits"),
    ],
)
def test_bad_input(J: object, twist: object, options: dict, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        pinsing.inverse_velocity(J, twist, **options)
