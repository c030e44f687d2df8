"""The page leads the output of a mechanism: poses, closure, types and ends as Python has them."""

import numpy as np
import pinocchio as pin
import pytest
from mechanisms import asked, data_of, from_model, planar_tree, shipped
from node import needs_node
from tiers import tiered

from pinsing.loops import home, mechanism_at, working_modes
from pinsing.loops.closure import Loops, output_pose
from pinsing.loops.motion import elbows, led_pose, mode_of, read_pose
from pinsing.robot.mechanism import Loop, Mechanism

LED = {  # the coordinates that the outputs of the shelf can be led in
    "five_bar": "x y", "four_bar": "turn", "planar_3rrr": "x y turn", "planar_3rpr": "x y turn",
    "gough_stewart": "x y z roll pitch yaw", "delta": "x y z", "rps3": "z roll pitch",
    "agile_eye": "roll pitch yaw", "bennett": "roll", "rssr": "roll",
}  # fmt: skip
QUICK = ("five_bar", "planar_3rpr")
SHELF = [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in LED]


def coordinates(mechanism: Mechanism, q: np.ndarray, rows: list[int]) -> np.ndarray:
    place = output_pose(mechanism, q)
    return np.concatenate([place.translation, pin.rpy.matrixToRpy(place.rotation)])[rows]


def turned(gap: np.ndarray, rows: list[int]) -> np.ndarray:
    return np.where(np.array(rows) > 2, np.sin(gap), gap)


@pytest.mark.slow
@needs_node
@pytest.mark.parametrize("name", SHELF)
def test_an_output_is_led_to_a_pose_and_the_loops_stay_closed(name: str) -> None:
    mechanism = shipped(name)
    data = data_of(mechanism)
    rows = data["pose"]["rows"]
    start = coordinates(mechanism, home(mechanism), rows)
    rng = np.random.default_rng(5)
    size = 0.05
    goals = [start + size * rng.uniform(-1, 1, len(rows)) for _ in range(6)]
    found = asked(
        mechanism,
        """({ names: data.pose.coordinates.map(({ symbol }) => symbol),
             led: goals.map((g) => { const f = m.posed(data, g, data.home);
               return { ...f, frame: m.mechanismFrame(data, f.q),
                        worst: m.worst(m.closure(data, f.q).residual) }; }) })""",
        goals=goals,
    )
    assert found["names"] == LED[name].split()
    loops = Loops(mechanism)
    for goal, here in zip(goals, found["led"], strict=True):
        q = np.array(here["q"])
        assert (here["reached"], here["stop"]) == (1, None)
        assert here["worst"] <= 1e-10
        assert np.abs(loops.scaled(q)[0]).max() <= 1e-10
        gap = turned(coordinates(mechanism, q, rows) - goal, rows)
        np.testing.assert_allclose(gap, 0, atol=1e-10)
        np.testing.assert_allclose(
            turned(np.array(here["frame"]["pose"]) - goal, rows), 0, atol=1e-10
        )
        state = mechanism_at(mechanism, q)
        assert (here["frame"]["kind"], here["frame"]["mode"]) == (state.kind, state.mode)
        if len(rows) == len(mechanism.task.rows) and data["pose"]["turn"] != {"kind": "angles"}:
            # What Python takes these numbers for is the same pose.
            wanted, there = read_pose(mechanism, goal), output_pose(mechanism, q)
            shown = [k for k in rows if k < 3]
            np.testing.assert_allclose(
                there.translation[shown], wanted.translation[shown], atol=1e-10
            )
            if any(k > 2 for k in rows):
                np.testing.assert_allclose(there.rotation, wanted.rotation, atol=1e-9)


SLIDES = {f"d{k}": ([[0, 0], [1, 0.1], [0.4, 0.9]][k], 0.3 + 2.0 * k) for k in range(3)}


def slides_in_the_plane() -> Mechanism:
    """3-PRR, its slides driven."""
    model, loops, top = pin.Model(), [], 0
    model.name = "prr"
    ends = ((0.0, 0.0), (0.5, 0.0), (0.2, 0.4))
    for k, (name, ((x, y), turn)) in enumerate(SLIDES.items()):
        place = pin.SE3(pin.rpy.rpyToMatrix(0, 0, turn), np.array([x, y, 0.0]))
        slide = model.addJoint(0, pin.JointModelPX(), place, name)
        rod = model.addJoint(slide, pin.JointModelRUBZ(), pin.SE3.Identity(), f"r{k}")
        end = pin.SE3(np.eye(3), np.array([0.9, 0.0, 0.0]))
        if not k:
            top = model.addJoint(rod, pin.JointModelRUBZ(), end, "turn")
        else:
            model.addFrame(pin.Frame(f"e{k}", rod, 0, end, pin.FrameType.OP_FRAME))
            loops.append(Loop(f"e{k}", f"b{k}", "3d"))
    for k, (x, y) in enumerate(ends):
        place = pin.SE3(np.eye(3), np.array([x, y, 0.0]))
        model.addFrame(pin.Frame(f"b{k}", top, 0, place, pin.FrameType.OP_FRAME))
    limits = dict.fromkeys(SLIDES, (-3.0, 3.0))
    return from_model(model, loops, list(SLIDES), "b0", "vx,vy,wz", limits)


@pytest.mark.slow
@needs_node
def test_ways_of_driven_slides_have_names_of_their_own_alike_on_the_page() -> None:
    mechanism = slides_in_the_plane()
    q = home(mechanism)
    found = working_modes(mechanism, output_pose(mechanism, q).homogeneous).modes
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
        assert s.mode.split("elbows ")[1][0] == ("+" if np.cos(angle) > 0 else "-")


def test_a_driven_elbow_is_told_like_another() -> None:
    model = planar_tree(
        {
            "one": ((0.0, 0.0), [("a", 0.6), ("b", 0.7)]),
            "two": ((1.0, 0.0), [("c", 0.6), ("d", 0.7)]),
        }
    )
    made = from_model(
        model, [Loop("one_end", "two_end", "3d")], ["a", "b", "c"], "one_end", "vx,vy"
    )
    found = working_modes(made, output_pose(made, home(made)).homogeneous).modes
    assert len({s.mode for s in found}) == len(found) == 4


@pytest.mark.slow
@needs_node
@pytest.mark.parametrize("name", tiered(["planar_3rpr", "rps3", "five_bar"], {"five_bar"}))
def test_where_a_pose_ends_a_limit_or_a_singularity_is_met(name: str) -> None:
    mechanism = shipped(name)
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
            assert (
                np.isclose(
                    coordinates(mechanism, q, [row])[0], [reach["lower"], reach["upper"]]
                ).any()
                or row > 2
            )
            if stop["why"] == "limit":
                j = stop["joint"]
                assert min(q[j] - mechanism.lower[j], mechanism.upper[j] - q[j]) == pytest.approx(
                    0, abs=1e-5
                )
                assert mechanism.joints[j] in end["words"]
                assert "is at its limit" in end["words"]
            else:
                assert stop["why"] == "type 1"
                assert mechanism_at(mechanism, q).output_ratio < 1e-3
            # From there it goes no further, and the same reason is given.
            assert end["again"]["reached"] < 1e-3
            assert end["again"]["stop"]["why"] == stop["why"]
            assert not mechanism.space.outside(np.array(end["again"]["q"])).any()
            kinds.add(stop["why"])
    assert kinds == {"planar_3rpr": {"limit"}, "rps3": {"limit"}, "five_bar": {"type 1"}}[name]


def test_only_what_the_output_can_do_is_led() -> None:
    """A turn about one axis is an angle; of what is coupled, as many rows as there are freedoms."""
    assert led_pose(shipped("delta")) == {"rows": [0, 1, 2], "turn": None}
    assert led_pose(shipped("gough_stewart"))["turn"] == {"kind": "full"}
    assert led_pose(shipped("rps3")) == {"rows": [2, 3, 4], "turn": {"kind": "angles"}}
    assert led_pose(shipped("planar_3rrr"))["turn"]["kind"] == "axis"
    legs = {
        "one": ((0.0, 0.0), [("crank", 0.3), ("coupler", 0.8)]),
        "two": ((0.9, 0.0), [("rocker", 0.6)]),
    }
    model = planar_tree(legs)
    four = from_model(model, [Loop("one_end", "two_end", "3d")], ["crank"], "one_end", "vx,vy,wz")
    assert len(led_pose(four)["rows"]) == 1


@needs_node
@pytest.mark.slow
@pytest.mark.parametrize("name", ["agile_eye", "delta"])
def test_all_working_modes_of_the_pose_are_listed_by_name(name: str) -> None:
    """Those that Python finds, each with the pose kept, the loops closed and a name of its own."""
    mechanism = shipped(name)
    q = home(mechanism)
    found = asked(mechanism, "m.modesAt(data, q).working", q=q)
    pose = output_pose(mechanism, q)
    expected = np.array([s.inputs for s in working_modes(mechanism, pose).modes])
    # A Delta's platform can be twisted at the same place: the page seeks from fewer starts.
    assert len(found) == len(expected) if name == "agile_eye" else len(found) >= 1
    assert len({mode["name"] for mode in found}) == len(found)
    driven = list(mechanism.actuated)
    for mode in found:
        there = np.array(mode["q"])
        assert np.abs(Loops(mechanism).scaled(there)[0]).max() <= 1e-10
        reached = output_pose(mechanism, there)
        np.testing.assert_allclose(reached.translation, pose.translation, atol=1e-8)
        assert not mechanism.space.outside(there).any()
        gap = np.sin((expected - there[driven]) / 2)
        assert np.abs(gap).max(axis=1).min() < 1e-6
    if name == "agile_eye":
        assert len(found) == 8
        signs = {mode["name"].split("elbows ")[1] for mode in found}
        assert len(signs) == 8
        assert not any("0" in s for s in signs)


def test_a_leg_on_a_sphere_has_an_elbow_and_a_leg_that_only_lengthens_has_none() -> None:
    eye, stewart = shipped("agile_eye"), shipped("gough_stewart")
    assert mode_of(eye, home(eye)) == "assembly +, elbows ---"
    assert elbows(stewart) == ()
    assert "elbows" not in mode_of(stewart, home(stewart))


def test_a_rod_that_leaves_the_plane_of_its_crank_has_an_elbow() -> None:
    rssr = shipped("rssr")
    assert len(elbows(rssr)) == 1
    assert mode_of(rssr, home(rssr)) == "assembly +, elbows +"
