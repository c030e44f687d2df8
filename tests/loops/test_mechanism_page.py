"""The page computes of a mechanism what Python computes: measures, modes, ranges, paths, poses."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import analyzed, asked, data_of, linkage, placed, planar_chains, shipped
from node import needs_node
from platforms import slides_in_the_plane
from tiers import tiered
from urdf_text import J, X

from pinsing import loops
from pinsing.loops import home
from pinsing.loops.closure import BatchLoops, Loops, newton, output_pose, random_closed
from pinsing.loops.motion import assembly_sign, read_pose
from pinsing.robot.mechanism import Mechanism
from pinsing.view.mechanism_viewer import groups, linkage_sizes

pytestmark = needs_node

SHIPPED = ["five_bar", "four_bar", "planar_3rrr"]
WORDS = {
    ("planar_3rrr", "type 2"): "center turns about z through (",
    ("four_bar", "type 1"): "rocker_link cannot turn about z",
}


def slider_crank() -> Mechanism:
    """A crank that drives a piston: one joint slides, between limits."""
    joints = planar_chains({"one": ((0.0, 0.0), [("crank", 0.3), ("rod", 0.8)])})
    joints.append(J("piston", "base", "head", axis=X, kind="prismatic", limits=(0.2, 1.2)))
    home, loops = {"crank": 0.7, "rod": -0.9, "piston": 0.9}, [("one_end", "head")]
    return linkage(joints, loops, ["crank"], "head", "vx", "planar", home=home)


EVERY = [*SHIPPED, "slider_crank", "bennett"]


@pytest.fixture
def mechanism(name: str) -> Mechanism:
    return slider_crank() if name == "slider_crank" else shipped(name)


STATES = """Q.map((q) => {
  const s = m.stateAt(data, q), c = m.closure(data, q);
  return { places: [...c.places, s.place].map(({ R, t }) => [...R.flat(), ...t]),
           sigma: m.svd(c.G).sigma, basis: m.motions(data, q).basis, one: s.one, two: s.two,
           constraint: s.constraint, kind: s.kind, near: s.near, mode: s.mode,
           velocity: s.velocity }; })"""


def states(
    mechanism: Mechanism, Q: Any, slack: float
) -> Iterator[tuple[np.ndarray, dict[str, Any], loops.MechanismState]]:
    """Configurations with what the page and what Python say there; measures and verdict agree."""
    for q, here in zip(Q, asked(mechanism, STATES, Q=Q), strict=True):
        state = loops.mechanism_at(mechanism, q)
        assert (here["kind"], here["near"]) == (state.kind, state.near), q.tolist()
        assert here["constraint"] == pytest.approx(state.constraint_ratio, abs=slack)
        # The motions themselves lose digits where the closure does.
        lost = slack / max(state.constraint_ratio, 1e-9)
        assert here["one"] == pytest.approx(state.output_ratio, abs=lost)
        assert here["two"] == pytest.approx(state.input_ratio, abs=lost)
        yield q, here, state


@pytest.mark.parametrize("name", tiered(EVERY, {"five_bar"}))
def test_frames_measures_and_verdicts_agree(name, mechanism, rng) -> None:
    """Loops of all three kinds, sliding joints; what is singular is among them."""
    Q = random_closed(mechanism, 40, rng)
    assert len(Q) > 20
    if name in SHIPPED:
        Q += [p.q for p in analyzed(name).points]
    closing = Loops(mechanism)
    kinds = set()
    for q, here, state in states(mechanism, Q, 1e-10):
        places = [*list(placed(mechanism, q).oMi)[1:], closing.output(q)[0]]
        flat = [[*at.rotation.ravel(), *at.translation] for at in places]
        np.testing.assert_allclose(here["places"], flat, atol=1e-12)
        sigma = np.linalg.svd(closing.scaled(q)[1], compute_uv=False)
        np.testing.assert_allclose(here["sigma"], sigma, atol=1e-10 * sigma[0])
        if state.kind in ("regular", "type 1") and not state.near:
            assert here["mode"] == state.mode
            size = np.abs(state.velocity).max() + 1e-6
            np.testing.assert_allclose(here["velocity"], state.velocity, atol=1e-6 * size)
        kinds.add(state.kind)
    if name in SHIPPED:
        assert {"regular", "type 1", "type 2"} <= kinds


SHOWN = """Q.map((q) => {
  const s = m.stateAt(data, q), at = s.place.t;
  return { ...m.mechanismFrame(data, q), wrenches: s.lost.map((u) => m.lostOf(data, at, u)),
           twists: s.uncontrolled.map((v) => m.looseOf(data, at, v)) }; })"""


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_what_is_shown_is_what_python_says(name: str) -> None:
    """In words; joints to blame; ellipses; wrenches that do no work, motions without a motor."""
    mechanism, sizes = shipped(name), linkage_sizes(shipped(name))
    rows, shown = list(mechanism.task.rows), set()
    Q = [loops.home(mechanism), *(p.q for p in analyzed(name).points)]
    found = asked(mechanism, SHOWN, Q=Q)
    for q, here in zip(Q, found, strict=True):
        state = loops.mechanism_at(mechanism, q)
        assert (here["kind"], here["mode"]) == (state.kind, state.mode)
        shown.add(state.kind)
        told = [*(m["words"] for m in here["lost"]), *here["given"]]
        assert WORDS.get((name, state.kind), "") in " ".join(told)
        assert not any(re.search("[a-z][A-Z]", word) for word in told)  # a name of the program
        assert bool(here["lost"]) == (state.kind in ("type 1", "type 3"))
        assert bool(here["hot"]) == (state.kind not in ("regular", "constraint"))
        assert (here["condition"] is None) == (state.kind != "regular")  # infinite
        for kind in ("translation", "rotation"):
            drawn = here["ellipsoids"]["all"][kind]["drawn"]
            assert max(drawn) <= 0.6 * sizes.reach + 1e-9
        if state.kind == "type 1":
            (lost,) = here["wrenches"]
            wrench = np.concatenate([lost["force"], lost["moment"]])[rows]
            np.testing.assert_allclose(wrench @ state.velocity, 0, atol=1e-8)
            if lost["line"] is not None:  # the same force, on its line, has no moment left
                moment = np.cross(lost["line"] - state.position, lost["force"])
                np.testing.assert_allclose(moment, lost["moment"], atol=1e-9)
        if state.kind == "type 2":
            (free,), motion, expected = here["twists"], loops.motions(mechanism, q), np.zeros(6)
            expected[rows] = motion.outputs @ np.linalg.svd(motion.inputs)[2][-1]
            got = np.concatenate([free["velocity"], free["turning"]])
            cosine = got @ expected / np.linalg.norm(got) / np.linalg.norm(expected)
            assert abs(cosine) == pytest.approx(1, abs=1e-9)
            if free["centre"] is not None:  # a point of the axis rests
                rest = np.cross(free["turning"], free["centre"] - state.position)
                np.testing.assert_allclose(free["velocity"] + rest, 0, atol=1e-9)
    assert {"regular", "type 1", "type 2"} <= shown
    if name == "five_bar":
        e = found[0]["ellipsoids"]["all"]["translation"]
        velocity = loops.mechanism_at(mechanism, Q[0]).velocity
        R = pin.Quaternion(np.array(e["turn"])).toRotationMatrix()
        drawn = (R @ np.diag(np.square(e["drawn"])) @ R.T)[:2, :2]
        expected = sizes.translation**2 * velocity @ velocity.T
        np.testing.assert_allclose(drawn, expected, atol=3e-4 * sizes.translation**2)


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_driving_follows_the_same_mode_as_far(name: str, mechanism: Mechanism) -> None:
    rng = np.random.default_rng(4)
    start = home(mechanism)
    wanted = start[list(mechanism.actuated)] + rng.uniform(-2, 2, (24, len(mechanism.inputs)))
    code = "wanted.map((inputs) => m.drive(data, inputs, q))"
    found = asked(mechanism, code, q=start, wanted=wanted)
    stopped = 0
    for inputs, here in zip(wanted, found, strict=True):
        there = loops.drive(mechanism, inputs, start)
        assert (here["reached"] == 1) == there.converged
        stopped += not there.converged
        assert here["reached"] == pytest.approx(there.reached, abs=2e-4)
        gap = np.abs(mechanism.fold(np.array(here["q"]) - there.q)).max()
        assert gap < (1e-8 if there.converged else 0.05)  # beside a fold q runs away
        assert np.abs(loops.residual(mechanism, np.array(here["q"]))).max() < 1e-9
    if name in ("five_bar", "planar_3rrr"):
        assert 0 < stopped < 24


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_a_range_ends_where_driving_does(mechanism: Mechanism) -> None:
    q = home(mechanism)
    found = asked(mechanism, "data.actuated.map((_, k) => m.stretch(data, q, k))", q=q)
    for k, here in enumerate(found):
        joint = mechanism.actuated[k]
        limits = np.array([mechanism.lower[joint], mechanism.upper[joint]])
        for p in here["points"]:
            state = loops.mechanism_at(mechanism, p["q"])
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
                    assert loops.drive(mechanism, at, q).converged != beyond
        ends = [p["q"][joint] for p in here["points"] if p["rangeEnd"]]
        assert set(np.round(ends, 9)) <= set(np.round([here["lower"], here["upper"]], 9))


@pytest.mark.parametrize("name", tiered([*EVERY, "agile_eye", "delta"], {"five_bar"}))
def test_modes_agree(name: str, mechanism: Mechanism) -> None:
    """Closed, within the limits, each once and with a name of its own; the pose is kept."""
    q, driven = home(mechanism), list(mechanism.actuated)
    pose = output_pose(mechanism, q)
    found = asked(mechanism, "m.modesAt(data, q)", q=q)
    for kind, known, joints in (
        ("assemblies", loops.assemblies(mechanism, q[driven]), range(mechanism.n)),
        ("working", loops.working_modes(mechanism, pose).modes, driven),
    ):
        listed = np.array([mode["q"] for mode in found[kind]])
        taken = set()
        for there in listed:
            assert np.abs(Loops(mechanism).scaled(there)[0]).max() <= 1e-10
            gaps = mechanism.fold(np.array([s.q for s in known]) - there)[:, list(joints)]
            assert np.abs(gaps).max(axis=1).min() < 1e-6
            taken.add(int(np.abs(gaps).max(axis=1).argmin()))
        # A Delta's platform can be twisted at the same place: the page seeks from fewer starts.
        assert len(taken) == len(listed) == (1 if name == "delta" else len(known))
        assert sum(mode["here"] for mode in found[kind]) == 1
        assert not mechanism.space.outside(listed).any()
    names = {mode["name"] for mode in found["working"]}
    assert len(names) == len(listed)
    assert name != "agile_eye" or not any("0" in x.split("elbows ")[1] for x in names)
    for there in listed:
        at = output_pose(mechanism, there).translation
        np.testing.assert_allclose(at, pose.translation, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_singular_points_are_refined_to_the_same_place(name: str, mechanism: Mechanism) -> None:
    rng = np.random.default_rng(2)
    held = list(mechanism.actuated)[1:]
    points = [p for p in analyzed(name).points if p.kind in ("type 1", "type 2")][:12]
    aside = rng.normal(0, 0.02, (len(points), mechanism.n))
    aside[:, held] = 0
    cases = [{"q": p.q + x, "kind": p.kind} for p, x in zip(points, aside, strict=True)]
    code = "cases.map(({q, kind}) => m.refinePoint(data, q, kind, held))"
    found = asked(mechanism, code, cases=cases, held=held)
    converged = 0
    for case, here in zip(cases, found, strict=True):
        there = loops.refine(mechanism, case["q"], case["kind"], held)
        assert here["converged"] == there.converged
        if there.converged:
            converged += 1
            np.testing.assert_allclose(mechanism.fold(np.array(here["q"]) - there.q), 0, atol=1e-6)
            assert here["kind"] == there.kind
    assert converged >= len(cases) // 2


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_paths_lead_into_singularities_and_along_them(name: str, mechanism: Mechanism) -> None:
    listed = [group for group in groups(mechanism, analyzed(name)) if group.points]
    cases = [
        {"q": p.q, "kind": p.kind, "converged": p.converged,
         "moving": mechanism.inputs.index(p.moving) if p.moving else -1}
        for p in (group.points[0] for group in listed)
    ]  # fmt: skip
    code = "cases.map((p) => [m.mechanismInto(data, p), m.mechanismAlong(data, p)])"
    found = asked(mechanism, code, cases=cases)
    played = 0
    for group, (into, along) in zip(listed, found, strict=True):
        if not into:
            assert "isolated points" in group.more
            continue
        assert loops.mechanism_at(mechanism, into[0]).kind == "regular"
        kinds = {loops.mechanism_at(mechanism, q).kind for q in (into[-1], *along[::6])}
        assert kinds == {group.points[0].kind}
        assert np.abs(np.diff(into, axis=0)).max() < 0.2
        assert bool(along) == (len(mechanism.inputs) > 1)
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
@pytest.mark.parametrize("name", EVERY)
def test_the_healthiest_pose_is_within_limits_and_regular(mechanism: Mechanism) -> None:
    found = asked(mechanism, "m.healthiestPose(data, [], 60, 30)")
    state = loops.mechanism_at(mechanism, found["q"])
    assert state.kind == "regular"
    measures = (state.output_ratio, state.input_ratio, state.constraint_ratio)
    assert found["measure"] == pytest.approx(min(measures), abs=1e-8)
    assert not mechanism.space.outside(np.array(found["q"]), 1e-9).any()
    assert min(measures) > 0.05


@pytest.mark.slow
def test_whole_turns_are_left_out_and_what_is_too_far_is_refused() -> None:
    """A link that asks for a million radians once took minutes of steps."""
    mechanism = slider_crank()
    assert not np.isfinite(mechanism.lower[list(mechanism.actuated)]).any()
    values = [100.0, 1e6, -1e6, 1e9, 1e308]
    code = """values.map((v) => { const f = m.driven(data, [v], data.home);
      return { ...f, words: f.stop ? m.stopWords(data, f.stop) : null }; })"""
    for value, one in zip(values, asked(mechanism, code, values=values), strict=True):
        q, (joint,) = np.array(one["q"]), mechanism.actuated
        assert np.abs(Loops(mechanism).scaled(q)[0]).max() <= 1e-10
        near = abs(value) <= 1e6
        assert one["reached"] == near
        if near:
            assert np.cos(q[joint] - value) == pytest.approx(1, abs=1e-12)
            assert abs(q[joint] - home(mechanism)[joint]) < 2 * np.pi
        else:
            assert one["words"] == "it is moved by at most 1000000 rad at once"
            assert q == pytest.approx(home(mechanism))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gough_stewart", "rps3"])
def test_a_gimbal_lock_of_a_file_s_ball_is_judged_as_in_python(name: str) -> None:
    """Closed with the middle hinge of a ball at a right angle, and beside it."""
    mechanism = shipped(name).without_limits()
    rng, k = np.random.default_rng(4), mechanism.joints.index("s1y")
    Q = rng.uniform(-1, 1, (60, mechanism.n)) * np.where(mechanism.prismatic, 1, np.pi)
    Q[:, k] = np.pi / 2 + np.repeat([0, 1e-4, 0.05], 20)
    Q, error = newton(BatchLoops(mechanism), Q, np.arange(mechanism.n) != k)
    Q = Q[error <= 1e-12]
    assert len(Q) > 8
    for q, here, _ in states(mechanism, Q, 1e-9):
        # Both bases span the same motions of the joints.
        ours, theirs = loops.motions(mechanism, q).basis, np.array(here["basis"]).T
        both = np.hstack([ours, theirs])
        ranks = [np.linalg.matrix_rank(x, tol=1e-6) for x in (ours, theirs, both)]
        assert len(set(ranks)) == 1


LED = {  # the coordinates that the outputs of the shelf can be led in
    "five_bar": "x y", "four_bar": "turn", "planar_3rrr": "x y turn", "planar_3rpr": "x y turn",
    "gough_stewart": "x y z roll pitch yaw", "delta": "x y z", "rps3": "z roll pitch",
    "agile_eye": "roll pitch yaw", "bennett": "roll", "rssr": "roll",
}  # fmt: skip


def coordinates(mechanism: Mechanism, q: np.ndarray, rows: list[int]) -> np.ndarray:
    place = output_pose(mechanism, q)
    return np.concatenate([place.translation, pin.rpy.matrixToRpy(place.rotation)])[rows]


def turned(gap: np.ndarray, rows: list[int]) -> np.ndarray:
    return np.where(np.array(rows) > 2, np.sin(gap), gap)


@pytest.mark.slow
@pytest.mark.parametrize("name", LED)
def test_an_output_is_led_to_a_pose_and_the_loops_stay_closed(name, mechanism) -> None:
    data = data_of(mechanism)
    rows = data["pose"]["rows"]
    aside = np.random.default_rng(5).uniform(-0.05, 0.05, (6, len(rows)))
    goals = coordinates(mechanism, home(mechanism), rows) + aside
    found = asked(
        mechanism,
        """({ names: data.pose.coordinates.map(({ symbol }) => symbol),
             led: goals.map((g) => { const f = m.posed(data, g, data.home);
               return { ...f, frame: m.mechanismFrame(data, f.q),
                        worst: m.worst(m.closure(data, f.q).residual) }; }) })""",
        goals=goals,
    )
    assert found["names"] == LED[name].split()
    closing = Loops(mechanism)
    for goal, here in zip(goals, found["led"], strict=True):
        q = np.array(here["q"])
        assert (here["reached"], here["stop"]) == (1, None)
        assert here["worst"] <= 1e-10
        assert np.abs(closing.scaled(q)[0]).max() <= 1e-10
        poses = np.array([coordinates(mechanism, q, rows), here["frame"]["pose"]])
        np.testing.assert_allclose(turned(poses - goal, rows), 0, atol=1e-10)
        state = loops.mechanism_at(mechanism, q)
        assert (here["frame"]["kind"], here["frame"]["mode"]) == (state.kind, state.mode)
        if len(rows) == len(mechanism.task.rows) and data["pose"]["turn"] != {"kind": "angles"}:
            # What Python takes these numbers for is the same pose.
            wanted, there = read_pose(mechanism, goal), output_pose(mechanism, q)
            away = (there.translation - wanted.translation)[[k for k in rows if k < 3]]
            np.testing.assert_allclose(away, 0, atol=1e-10)
            if any(k > 2 for k in rows):
                np.testing.assert_allclose(there.rotation, wanted.rotation, atol=1e-9)


@pytest.mark.slow
def test_ways_of_driven_slides_have_names_of_their_own_alike_on_the_page(tmp_path: Path) -> None:
    mechanism = slides_in_the_plane(tmp_path)
    q = home(mechanism)
    found = loops.working_modes(mechanism, output_pose(mechanism, q).homogeneous).modes
    assert len(found) == 8
    assert len({s.mode.split("elbows ")[1] for s in found}) == 8
    said = asked(mechanism, "ways.map((q) => m.modeOf(data, q))", ways=[s.q for s in found])
    assert said == [s.mode for s in found]
    stop = {"why": "type 1", "joint": mechanism.joints.index("d0"), "q": q}
    words = asked(mechanism, "m.stopWords(data, stop)", stop=stop)
    assert words == "type 1 singularity: the rod of d0 square to its slide"
    # Geometry: the rod of slide d0 leans ahead where it points along the slide.
    for s in found:
        angle = s.q[mechanism.joints.index("r0")]
        assert s.mode.split("elbows ")[1][0] == ("+" if np.cos(angle - 0.3) > 0 else "-")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar_3rpr", "rps3", "five_bar"])
def test_where_a_pose_ends_a_limit_or_a_singularity_is_met(name: str, mechanism: Mechanism) -> None:
    data = data_of(mechanism)
    found = asked(
        mechanism,
        """data.pose.rows.map((_, k) => {
             const s = m.poseStretch(data, data.home, k, data.sizes.reach);
             const start = m.poseOf(data, m.placeOf(data, data.home));
             const beyond = (v) => start.map((x, i) => (i === k ? v : x));
             const ends = [[s.lower - 0.01, s.below], [s.upper + 0.01, s.above]];
             return { ...s, ends: ends.filter(([, stop]) => stop).map(([v, stop]) => (
               { stop, words: m.stopWords(data, stop),
                 again: m.posed(data, beyond(v), stop.q) })) };
           })""",
    )
    kinds = set()
    for k, reach in enumerate(found):
        row = data["pose"]["rows"][k]
        for end in reach["ends"]:
            stop = end["stop"]
            q = np.array(stop["q"])
            assert np.abs(Loops(mechanism).scaled(q)[0]).max() <= 1e-10
            (value,) = coordinates(mechanism, q, [row])
            assert row > 2 or np.isclose(value, [reach["lower"], reach["upper"]]).any()
            if stop["why"] == "limit":
                j = stop["joint"]
                room = min(q[j] - mechanism.lower[j], mechanism.upper[j] - q[j])
                assert room == pytest.approx(0, abs=1e-5)
                assert mechanism.joints[j] in end["words"]
                assert "is at its limit" in end["words"]
            else:
                assert stop["why"] == "type 1"
                assert loops.mechanism_at(mechanism, q).output_ratio < 1e-3
            # From there it goes no further, and the same reason is given.
            assert end["again"]["reached"] < 1e-3
            assert end["again"]["stop"]["why"] == stop["why"]
            assert not mechanism.space.outside(np.array(end["again"]["q"])).any()
            kinds.add(stop["why"])
    assert kinds == {"planar_3rpr": {"limit"}, "rps3": {"limit"}, "five_bar": {"type 1"}}[name]
