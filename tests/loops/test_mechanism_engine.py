"""The page computes of a mechanism what Python computes: measures, modes, words, ranges, paths."""

import re

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import analyzed, asked, from_model, placed, planar_tree, shipped
from node import needs_node
from tiers import tiered

from pinsing.loops import (
    assemblies,
    drive,
    home,
    mechanism_at,
    motions,
    refine,
    residual,
    working_modes,
)
from pinsing.loops.closure import BatchLoops, Loops, newton, output_pose, planar_dyad, random_closed
from pinsing.loops.motion import assembly_sign
from pinsing.robot.mechanism import Loop, Mechanism
from pinsing.view.mechanism_viewer import groups, linkage_sizes

pytestmark = needs_node

SHIPPED = ["five_bar", "four_bar", "planar_3rrr"]
WORDS = {
    ("planar_3rrr", "type 2"): "center turns about z through (",
    ("four_bar", "type 1"): "rocker_link cannot turn about z",
}


def slider_crank() -> Mechanism:
    """A crank that drives a piston: one joint slides, between limits."""
    model = planar_tree({"one": ((0.0, 0.0), [("crank", 0.3), ("rod", 0.8)])})
    piston = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "piston")
    model.addFrame(pin.Frame("head", piston, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    home, loop = {"crank": 0.7, "rod": -0.9, "piston": 0.9}, Loop("one_end", "head", "planar")
    return from_model(model, [loop], ["crank"], "head", "vx", {"piston": (0.2, 1.2)}, home)


def spherical() -> Mechanism:
    """Four axes through one point, the last link welded to the ground: a loop in space."""
    model = pin.Model()
    model.name = "spherical"
    parent = 0
    turns = (0.0, 0.5, 1.1, 0.9)
    for name, turn in zip("abcd", turns, strict=True):
        place = pin.SE3(pin.rpy.rpyToMatrix(turn, 0.0, 0.0), np.zeros(3))
        parent = model.addJoint(parent, pin.JointModelRUBZ(), place, name)
    start = np.array([0.4, 0.7, -0.5, 0.9])
    model.addFrame(pin.Frame("end", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    data = model.createData()
    values = np.stack([np.cos(start), np.sin(start)], axis=1).ravel()
    pin.framesForwardKinematics(model, data, values)
    there = pin.SE3(data.oMf[model.getFrameId("end")])
    model.addFrame(pin.Frame("ground", 0, 0, there, pin.FrameType.OP_FRAME))
    middle = pin.SE3(np.eye(3), np.array([0.0, 0.2, 0.3]))
    model.addFrame(pin.Frame("tool", 2, 0, middle, pin.FrameType.OP_FRAME))
    home = dict(zip("abcd", start, strict=True))
    return from_model(model, [Loop("ground", "end", "6d")], ["a"], "tool", "wx,wy,wz", home=home)


MADE = {"slider_crank": slider_crank, "spherical": spherical}
EVERY = [*SHIPPED, *MADE]
FEW = ("five_bar", "slider_crank")


def mechanism_of(name: str) -> Mechanism:
    return MADE[name]() if name in MADE else shipped(name)


def closed(mechanism: Mechanism, count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(11)
    found: list[np.ndarray] = []
    while len(found) < count:
        found += random_closed(mechanism, count - len(found), rng)
    return found


@pytest.mark.parametrize("name", tiered(EVERY, {"five_bar"}))
def test_frames_measures_and_verdicts_agree(name: str) -> None:
    """Loops of all three kinds, sliding joints; what is singular is among them."""
    mechanism = mechanism_of(name)
    Q = closed(mechanism, 40)
    if name in SHIPPED:
        Q += [p.q for p in analyzed(name).points]
    found = asked(
        mechanism,
        """Q.map((q) => { const s = m.stateAt(data, q), c = m.closure(data, q);
             return { places: c.places.map(({ R, t }) => [...R.flat(), ...t]),
                      tip: [...s.place.R.flat(), ...s.place.t], sigma: m.svd(c.G).sigma,
                      one: s.one, two: s.two, constraint: s.constraint, kind: s.kind,
                      near: s.near, mode: s.mode, velocity: s.velocity }; })""",
        Q=Q,
    )
    loops = Loops(mechanism)
    kinds = set()
    for q, here in zip(Q, found, strict=True):
        state = mechanism_at(mechanism, q)
        joints = list(placed(mechanism, q).oMi)[1:]
        places = [[*place.rotation.ravel(), *place.translation] for place in joints]
        np.testing.assert_allclose(here["places"], places, atol=1e-12)
        place = loops.output(q)[0]
        np.testing.assert_allclose(
            here["tip"], [*place.rotation.ravel(), *place.translation], atol=1e-12
        )
        sigma = np.linalg.svd(loops.scaled(q)[1], compute_uv=False)
        np.testing.assert_allclose(here["sigma"], sigma, atol=1e-10 * sigma[0])
        assert here["constraint"] == pytest.approx(state.constraint_ratio, abs=1e-10)
        # The motions themselves lose digits where the closure does.
        slack = 1e-10 / max(state.constraint_ratio, 1e-9)
        assert here["one"] == pytest.approx(state.output_ratio, abs=slack)
        assert here["two"] == pytest.approx(state.input_ratio, abs=slack)
        assert (here["kind"], here["near"]) == (state.kind, state.near), q.tolist()
        if state.kind in ("regular", "type 1") and not state.near:
            assert here["mode"] == state.mode
            np.testing.assert_allclose(
                here["velocity"], state.velocity, atol=1e-6 * np.abs(state.velocity).max() + 1e-12
            )
        kinds.add(state.kind)
    if name in SHIPPED:
        assert {"regular", "type 1", "type 2"} <= kinds


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(SHIPPED, ("five_bar",)))
def test_what_is_shown_is_what_python_says(name: str) -> None:
    """Lost and free motions in words, joints to blame, ellipses; at each singular point."""
    mechanism = shipped(name)
    points = analyzed(name).points
    Q = [home(mechanism), *(p.q for p in points)]
    sizes = linkage_sizes(mechanism)
    found = asked(mechanism, "Q.map((q) => m.mechanismFrame(data, q))", Q=Q)
    shown = set()
    for q, frame in zip(Q, found, strict=True):
        state = mechanism_at(mechanism, q)
        assert (frame["kind"], frame["mode"]) == (state.kind, state.mode)
        shown.add(state.kind)
        told = [*(m["words"] for m in frame["lost"]), *frame["given"]]
        assert WORDS.get((name, state.kind), "") in " ".join(told)
        assert not any(re.search("[a-z][A-Z]", word) for word in told)  # a name of the program
        assert bool(frame["lost"]) == (state.kind in ("type 1", "type 3"))
        assert bool(frame["hot"]) == (state.kind not in ("regular", "constraint"))
        assert (frame["condition"] is None) == (state.kind != "regular")  # infinite
        for kind in ("translation", "rotation"):
            drawn = frame["ellipsoids"]["all"][kind]["drawn"]
            assert max(drawn) <= 0.6 * sizes.reach + 1e-9
    assert {"regular", "type 1", "type 2"} <= shown
    if name == "five_bar":
        e = found[0]["ellipsoids"]["all"]["translation"]
        velocity = mechanism_at(mechanism, Q[0]).velocity
        assert velocity is not None
        R = pin.Quaternion(np.array(e["turn"])).toRotationMatrix()
        drawn = (R @ np.diag(np.square(e["drawn"])) @ R.T)[:2, :2]
        expected = sizes.translation**2 * velocity @ velocity.T
        np.testing.assert_allclose(drawn, expected, atol=3e-4 * sizes.translation**2)


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(SHIPPED, {"five_bar"}))
def test_lost_wrenches_do_no_work_and_free_motions_need_no_motor(name: str) -> None:
    mechanism = shipped(name)
    rows = list(mechanism.task.rows)
    q = [
        next(p.q for p in analyzed(name).points if p.kind == kind) for kind in ("type 1", "type 2")
    ]
    one, two = (mechanism_at(mechanism, x) for x in q)
    lost, free = asked(
        mechanism,
        "[m.lostOf(data, ...one), m.looseOf(data, ...two)]",
        one=[one.position, one.lost[:, 0]],
        two=[two.position, two.uncontrolled[:, 0]],
    )
    assert one.velocity is not None
    wrench = np.concatenate([lost["force"], lost["moment"]])[rows]
    np.testing.assert_allclose(wrench @ one.velocity, 0, atol=1e-8)
    if lost["line"] is not None:  # the same force, on its line, has no moment left
        moment = np.cross(lost["line"] - one.position, lost["force"])
        np.testing.assert_allclose(moment, lost["moment"], atol=1e-9)
    motion = motions(mechanism, q[1])
    expected = np.zeros(6)
    expected[rows] = motion.outputs @ np.linalg.svd(motion.inputs)[2][-1]
    got = np.concatenate([free["velocity"], free["turning"]])
    cosine = got @ expected / np.linalg.norm(got) / np.linalg.norm(expected)
    assert abs(cosine) == pytest.approx(1, abs=1e-9)
    if free["centre"] is not None:  # a point of the axis rests
        rest = free["velocity"] + np.cross(free["turning"], free["centre"] - two.position)
        np.testing.assert_allclose(rest, 0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(EVERY, FEW[:1]))
def test_driving_follows_the_same_mode_as_far(name: str) -> None:
    mechanism = mechanism_of(name)
    rng = np.random.default_rng(4)
    start = home(mechanism)
    wanted = start[list(mechanism.actuated)] + rng.uniform(-2, 2, (24, len(mechanism.inputs)))
    code = "wanted.map((inputs) => m.drive(data, inputs, q))"
    found = asked(mechanism, code, q=start, wanted=wanted)
    stopped = 0
    for inputs, here in zip(wanted, found, strict=True):
        there = drive(mechanism, inputs, start)
        assert (here["reached"] == 1) == there.converged
        stopped += not there.converged
        assert here["reached"] == pytest.approx(there.reached, abs=2e-4)
        gap = np.abs(mechanism.fold(np.array(here["q"]) - there.q)).max()
        assert gap < (1e-8 if there.converged else 0.05)  # beside a fold q runs away
        assert np.abs(residual(mechanism, np.array(here["q"]))).max() < 1e-9
    if name in ("five_bar", "planar_3rrr"):
        assert 0 < stopped < 24


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(EVERY, FEW[:1]))
def test_a_range_ends_where_driving_does(name: str) -> None:
    mechanism = mechanism_of(name)
    q = home(mechanism)
    found = asked(mechanism, "data.actuated.map((_, k) => m.stretch(data, q, k))", q=q)
    for k, here in enumerate(found):
        joint = mechanism.actuated[k]
        limits = np.array([mechanism.lower[joint], mechanism.upper[joint]])
        for p in here["points"]:
            state = mechanism_at(mechanism, p["q"])
            assert state.kind == p["kind"]
            assert assembly_sign(mechanism, state.q) in ("0", "?", assembly_sign(mechanism, q))
        if here["whole"]:
            assert here["upper"] - here["lower"] == pytest.approx(2 * np.pi)
            continue
        for end, inward in ((here["lower"], 1), (here["upper"], -1)):
            at = q[list(mechanism.actuated)]
            for beyond in (False, True):
                at[k] = end + 1e-4 * inward * (-1 if beyond else 1)
                if not (beyond and np.abs(limits - end).min() < 1e-9):
                    assert drive(mechanism, at, q).converged != beyond
        ends = [p["q"][joint] for p in here["points"] if p["rangeEnd"]]
        assert set(np.round(ends, 9)) <= set(np.round([here["lower"], here["upper"]], 9))


@pytest.mark.parametrize("name", tiered(EVERY, FEW[:1]))
def test_modes_agree(name: str) -> None:
    mechanism = mechanism_of(name)
    q = home(mechanism)
    found = asked(mechanism, "m.modesAt(data, q)", q=q)
    inputs = q[list(mechanism.actuated)]
    expected = [s.q for s in assemblies(mechanism, inputs)]
    listed = [np.array(mode["q"]) for mode in found["assemblies"]]
    for there in expected:
        assert min(np.abs(mechanism.fold(x - there)).max() for x in listed) < 1e-8
    assert len(listed) == len(expected)
    assert sum(mode["here"] for mode in found["assemblies"]) == 1
    dyad = planar_dyad(mechanism)
    if dyad is not None:
        pins = [dyad.pin(inputs, left) for left in (True, False)]
        same = [np.abs(mechanism.fold(dyad.reaching(inputs, P) - q)).max() for P in pins]
        working = list(dyad.working_modes(pins[int(np.argmin(same))]))
    else:
        working = [s.q for s in working_modes(mechanism, output_pose(mechanism, q)).modes]
    assert len(found["working"]) == len(working)
    driven = list(mechanism.actuated)
    reachable = np.array([mode["q"] for mode in found["working"]])
    for there in working:
        assert np.abs(mechanism.fold(reachable - there)[:, driven]).max(axis=1).min() < 1e-6
    assert len({mode["name"] for mode in found["working"]}) == len(working)
    place = mechanism_at(mechanism, q).position
    for mode in found["working"]:
        reached = mechanism_at(mechanism, mode["q"]).position
        np.testing.assert_allclose(reached, place, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(SHIPPED, ("five_bar",)))
def test_singular_points_are_refined_to_the_same_place(name: str) -> None:
    mechanism = shipped(name)
    rng = np.random.default_rng(2)
    held = list(mechanism.actuated)[1:]
    cases = [
        {"q": p.q + rng.normal(0, 0.02, mechanism.n), "kind": p.kind}
        for p in analyzed(name).points
        if p.kind in ("type 1", "type 2")
    ][:12]
    for case, p in zip(cases, analyzed(name).points, strict=False):
        for j in held:
            case["q"][j] = p.q[j]
    code = "cases.map(({q, kind}) => m.refinePoint(data, q, kind, held))"
    found = asked(mechanism, code, cases=cases, held=held)
    converged = 0
    for case, here in zip(cases, found, strict=True):
        there = refine(mechanism, case["q"], case["kind"], held)
        assert here["converged"] == there.converged
        if there.converged:
            converged += 1
            np.testing.assert_allclose(mechanism.fold(np.array(here["q"]) - there.q), 0, atol=1e-6)
            assert here["kind"] == there.kind
    assert converged >= len(cases) // 2


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(SHIPPED, ("four_bar",)))
def test_paths_lead_into_singularities_and_along_them(name: str) -> None:
    mechanism = shipped(name)
    listed = groups(mechanism, analyzed(name))
    cases = [
        {"q": p.q, "kind": p.kind, "converged": p.converged,
         "moving": mechanism.inputs.index(p.moving) if p.moving else -1}
        for p in (group.points[0] for group in listed if group.points)
    ]  # fmt: skip
    code = "cases.map((p) => [m.mechanismInto(data, p), m.mechanismAlong(data, p)])"
    found = asked(mechanism, code, cases=cases)
    played = 0
    for group, (into, along) in zip([g for g in listed if g.points], found, strict=True):
        point = group.points[0]
        if not into:
            assert "isolated points" in group.more
            continue
        assert mechanism_at(mechanism, into[0]).kind == "regular"
        assert mechanism_at(mechanism, into[-1]).kind == point.kind
        assert np.abs(np.diff(into, axis=0)).max() < 0.2
        assert bool(along) == (len(mechanism.inputs) > 1)
        for q in along[::6]:
            assert mechanism_at(mechanism, q).kind == point.kind
        if along:
            played += 1
            assert np.ptp(along, axis=0).max() > 0.2
            steps = np.diff([*along, along[0]], axis=0)
            assert np.abs(mechanism.fold(steps)).max() < 0.4
    assert played >= (3 if len(mechanism.inputs) > 1 else 0)


def test_of_type_3_there_is_no_way_along():
    mechanism = shipped("five_bar")
    point = {"q": home(mechanism), "kind": "type 3", "moving": 0}
    assert asked(mechanism, "m.mechanismAlong(data, point)", point=point) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(EVERY, FEW[1:]))
def test_the_healthiest_pose_is_within_limits_and_regular(name: str) -> None:
    mechanism = mechanism_of(name)
    found = asked(mechanism, "m.healthiestPose(data, [], 60, 30)")
    state = mechanism_at(mechanism, found["q"])
    assert state.kind == "regular"
    measures = (state.output_ratio, state.input_ratio, state.constraint_ratio)
    assert found["measure"] == pytest.approx(min(measures), abs=1e-8)
    q = np.array(found["q"])
    assert (q >= mechanism.lower - 1e-9).all()
    assert (q <= mechanism.upper + 1e-9).all()
    assert min(measures) > 0.05


@pytest.mark.slow
def test_whole_turns_are_left_out_and_what_is_too_far_is_refused() -> None:
    """A link that asks for a million radians once took minutes of steps."""
    mechanism = slider_crank()
    assert not np.isfinite(mechanism.lower[list(mechanism.actuated)]).any()
    values = [100.0, 1e6, -1e6, 1e9, 1e308]
    found = asked(
        mechanism,
        """values.map((v) => { const f = m.driven(data, [v], data.home);
             return { ...f, words: f.stop ? m.stopWords(data, f.stop) : null }; })""",
        values=values,
    )
    joint = mechanism.actuated[0]
    for value, one in zip(values, found, strict=True):
        q = np.array(one["q"])
        assert np.abs(Loops(mechanism).scaled(q)[0]).max() <= 1e-10
        if abs(value) <= 1e6:
            assert one["reached"] == 1
            assert np.cos(q[joint] - value) == pytest.approx(1, abs=1e-12)
            assert abs(q[joint] - home(mechanism)[joint]) < 2 * np.pi
        else:
            assert one["reached"] == 0
            assert one["words"] == "it is moved by at most 1000000 rad at once"
            assert q == pytest.approx(home(mechanism))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gough_stewart", "rps3"])
def test_a_gimbal_lock_of_a_file_s_ball_is_judged_as_in_python(name: str) -> None:
    """Closed with the middle hinge of a ball at a right angle, and beside it."""
    mechanism = shipped(name).without_limits()
    loops = BatchLoops(mechanism)
    rng = np.random.default_rng(4)
    k = mechanism.joints.index("s1y")
    Q = rng.uniform(-1, 1, (60, mechanism.n)) * np.where(mechanism.prismatic, 1, np.pi)
    Q[:, k] = np.pi / 2 + np.repeat([0, 1e-4, 0.05], 20)
    Q, error = newton(loops, Q, np.arange(mechanism.n) != k)
    Q = Q[error <= 1e-12]
    assert len(Q) > 8
    found = asked(
        mechanism,
        """Q.map((q) => { const s = m.stateAt(data, q), f = m.motions(data, q);
             return { one: s.one, two: s.two, constraint: s.constraint, kind: s.kind,
                      near: s.near, basis: f.basis }; })""",
        Q=Q,
    )
    for q, here in zip(Q, found, strict=True):
        state, moved = mechanism_at(mechanism, q), motions(mechanism, q)
        assert (here["kind"], here["near"]) == (state.kind, state.near)
        assert here["constraint"] == pytest.approx(state.constraint_ratio, abs=1e-9)
        assert here["one"] == pytest.approx(state.output_ratio, abs=1e-8)
        assert here["two"] == pytest.approx(state.input_ratio, abs=1e-8)
        # Both bases span the same motions of the joints.
        ours, theirs = moved.basis, np.array(here["basis"]).T
        both = np.hstack([ours, theirs])
        ranks = [np.linalg.matrix_rank(x, tol=1e-6) for x in (ours, theirs, both)]
        assert len(set(ranks)) == 1
