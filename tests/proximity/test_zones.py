"""Zones: bounds of joint speeds in boxes, and the distances that rest on them."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from command_line import run
from dh_arms import dh_arm
from plain_speeds import PlainBounds
from tiers import tiered, tiered_rows

import pinsing
from pinsing.algebra.conditions import two_sided
from pinsing.errors import OptionError
from pinsing.kinematics.jacobian import frame_jacobians, tip_poses
from pinsing.kinematics.tip_speed import SpeedJudge
from pinsing.proximity import zones as zone_search
from pinsing.proximity.clearance import watch
from pinsing.proximity.zones import Region, parts_of
from pinsing.robot.nominal import flatten, on_chain

CASES = [
    ("ur5", {}, None), ("ur5", {"task": "position"}, None), ("ur5", {"task": "tool-axis"}, None),
    ("panda", {}, None), ("planar3r", {}, [1, 1, 1]), ("scara", {}, [3, 3, 1, 3]),
    ("stanford", {}, [1, 1, 0.5, 1, 1, 1]),
    ("stanford", {"tip": "link3", "task": "position"}, [1, 1, 0.5]),
]  # fmt: skip


def _shares(judge, Q, v, w):
    """At Q (N, n): by the inverse, or of a redundant arm by the facets of its twists."""
    if judge.rank < judge.arm.n:
        return judge.shares(Q, v, w).max(axis=1)
    A = judge.rows(frame_jacobians(judge.arm, Q), Q)
    z = np.linalg.pinv(A)
    linear, angular = (
        np.linalg.norm(z[..., own], axis=-1) for own in (judge.linear, ~judge.linear)
    )
    return ((v * linear + w * angular) / judge.limits).max(axis=1)


def _search(monkeypatch, form, **options):
    """The search that answers, before it begins."""
    monkeypatch.setattr(zone_search._Search, "zones", lambda search: search)
    return pinsing.zones(form, **options)


@pytest.mark.parametrize(("name", "options", "speeds"), tiered_rows(CASES, CASES[::3] + CASES[-1:]))
def test_no_configuration_of_a_box_takes_more_than_its_bound(name, options, speeds):
    arm, rng = pinsing.load(name, **options), np.random.default_rng(1)
    judge = SpeedJudge(arm, speeds)
    slow = 0.02, 0.04  # more than the limits is not bounded
    bounds = PlainBounds(judge, *slow, np.where(arm.prismatic, 1.0, 0.0))
    turns = ~arm.prismatic
    C = rng.uniform(-1, 1, (200, arm.n)) * np.where(turns, np.pi, 0.3)
    spare = len(bounds.far) - len(bounds.rows)
    for radius, rounds in itertools.product((0.1, 0.02, 0.0), (2, 0) if spare else (2,)):
        R = np.full(C.shape, radius) * np.where(turns, 1.0, 0.3)
        found = bounds._of(C, R, rounds)
        assert np.isfinite(found.most).mean() > (0.5 if radius < 0.1 else -1)
        for _ in range(5):
            Q = C + R * rng.choice([-1.0, 1.0, 0.3], C.shape)
            away = rng.uniform(-1, 1, C.shape) * np.where(turns, np.pi, 0.3)
            Q = np.where(bounds.moving, Q, away)
            assert (_shares(judge, Q, *slow) <= found.most * (1 + 1e-9)).all()
        at_centre, square = _shares(judge, C, *slow), judge.rank == arm.n
        np.testing.assert_allclose(found.center, at_centre, rtol=1e-5 if square else 0.5)
        assert (found.center >= at_centre * (1 - 1e-5)).all()
        if radius == 0.0:
            good = np.isfinite(found.most)
            np.testing.assert_allclose(found.most[good], found.center[good], rtol=1e-3)
        if rounds:
            plain = bounds.plain(C, R, rounds)
            np.testing.assert_allclose(plain, found.most, rtol=1e-4)
        elif spare == 1:  # the best right inverse, or nearly that
            assert np.percentile(found.center / at_centre, 90) < 1.05


@pytest.mark.parametrize(
    "name", tiered(["ur5", "panda", "stanford", "crx10ia"], ("ur5", "stanford"))
)
def test_the_fourth_order_is_no_more_than_its_bound(name):
    """Of Jacobians at a point of the middle link, in its axes."""
    arm, rng = pinsing.load(name), np.random.default_rng(5)
    bounds = PlainBounds(SpeedJudge(arm, np.ones(arm.n)), 0.25, 0.5, 1.0 * arm.prismatic)
    every = np.arange(arm.n)
    for _ in range(25):
        C = rng.uniform(-1, 1, arm.n) * np.where(arm.prismatic, 0.3, np.pi)
        R = rng.uniform(0, 0.3, arm.n) * bounds.moving
        d, link = R * rng.choice([-1, 1], arm.n), pin.SE3.Identity()
        J, moved = frame_jacobians(arm, np.array([C, C + d]))[:, None]
        tip = np.diff(tip_poses(arm, np.array([C, C + d]))[0], axis=0)[0]
        for j in range(bounds.middle + 1):
            link = link * pin.exp6(J[0, :, j] * d[j])
        moved[0, :3] += np.cross(moved[0, 3:], link.translation - tip, axis=0)
        slopes = np.array([bounds._slope(J, J, j) for j in range(arm.n)])
        left = np.kron(np.eye(2), link.rotation.T) @ moved - J - np.tensordot(d, slopes, 1)
        for a, b in zip(*np.triu_indices(arm.n), strict=True):
            both = bounds._slope(slopes[b], J, a) + bounds._slope(J, slopes[b], a)
            dd = d[a] * d[b] / (1 + (a == b))
            left -= dd * both
            for o in bounds._nearer(every, a, b):
                left -= dd * d[o] / (1 + (o == a) + (o == b)) * bounds._slope(both, J, o)
        most = bounds._rest(np.eye(6)[None, [0, 3]], J, R[None])[0][0]
        assert (np.linalg.norm(left[0].reshape(2, 3, -1), axis=1) <= most * (1 + 1e-6) + 1e-9).all()


@pytest.mark.parametrize(
    ("name", "speeds", "boxes", "within", "said"),
    [
        ("scara", [5, 5, 1, 10], 20_000, None, ()),
        ("planar3r", [2, 2, 2], 20_000, None, ()),
        *(pytest.param("ur5", None, *case, marks=pytest.mark.slow) for case in (
            (20_000, {"elbow_joint": (0.7, 2.4), "wrist_2_joint": (0.5, 2.6),
                      "wrist_1_joint": (-1.5, 0.0)}, ()),
            (4000, "elbow up, wrist no-flip, q3=0.6..1.2, wrist_1_joint=-1..1, "
             "wrist_2_joint=-1.4..2",
             ("elbow up", "wrist no-flip", "elbow_joint between 34.38° and 68.75°")),
            (4000, "q3=0.7..2, z=0.1..0.3, x=-0.2..0.3, q4=-0.5..0.5, q5=0.2..1",
             ("elbow_joint between 40.11° and 114.6°", "z of the tip between 0.1 m and 0.3 m")),
        )),
    ],
)  # fmt: skip
def test_outside_the_zones_no_limit_is_exceeded(name, speeds, boxes, within, said):
    """Also of a posture, and of a box of the workspace."""
    form = pinsing.closed_form(pinsing.load(name))
    found = pinsing.zones(form, joint_speeds=speeds, within=within, boxes=boxes)
    ranges = parts_of(within) if isinstance(within, str) else within or {}
    assert set(said) <= set(found.within)
    judge, region = SpeedJudge(form.loaded, speeds), Region(form, form.loaded, ranges)
    rng = np.random.default_rng(2)
    Q = rng.uniform(found.lower, found.upper, (30_000, form.loaded.n))
    exceeding = Q[(_shares(judge, Q, 0.25, 0.5) > 1) & region.holds(Q)]
    assert len(exceeding)
    families = [form[name] for name in watch(form).names]
    for q in exceeding[:200]:
        far = {f.name: f.distance(q).upper for f in families}
        assert any(far[n] <= found.distances[n] for n in far)
        assert min(far.values()) <= found.common
    assert _shares(judge, found.worst[None], 0.25, 0.5)[0] > 1
    assert region.holds(found.worst[None]).all()
    assert min(f.distance(found.worst).upper for f in families) >= found.common_exceeding - 1e-9
    assert found.common_exceeding <= found.common
    if speeds is not None:  # little more is kept than is needed; for a UR5 boxes end first
        assert found.common <= 1.055 * found.common_exceeding
    assert found.sigma_min_proven <= found.sigma_min
    again = pinsing.proximity.Zones.from_json(found.to_json())
    assert (again.distances, again.posture) == (found.distances, found.posture)
    np.testing.assert_array_equal(again.tip_lower, found.tip_lower)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "within"),
    [("irb120", None), ("ur5", None), ("ur10e", None), ("rs007n", None),
     ("hc10", "limits"), ("gofa5", "limits"), ("crx5ia", "limits"), ("meca500", "limits")],
)  # fmt: skip
def test_each_distance_is_within_a_twentieth_of_one_that_is_too_near(name, within):
    # Where zones meet, what exceeds a limit is a sliver: neither boxes nor random steps find it
    # unless distances near it are proven as closely as the boxes are small.
    found = pinsing.zones(pinsing.closed_form(pinsing.load(name), prove=False), within=within)
    assert found.boxes < 1_500_000
    assert found.common <= 1.055 * found.common_exceeding
    for family, distance in found.distances.items():
        assert distance <= 1.0501 * found.exceeding[family]


def test_the_command_says_what_to_keep_and_where():
    done = run("zones", "scara", "--joint-speeds", "5,5,1,10", "--within", "q3=0..0.1")
    assert "with d3 between 0 m and 0.1 m, keep 20.3° from" in done.stdout


def test_a_slide_is_bounded_where_zones_are_asked_for(monkeypatch):
    """Also beyond its limits, of 0.5 m: how far the tip is from the axes before it."""
    form = pinsing.closed_form(pinsing.load("stanford"))
    search = _search(monkeypatch, form, joint_speeds=np.ones(6), within={"d3": (0.5, 9.0)})
    assert (search.bounds.far[:2] > 9).all()


@pytest.mark.parametrize("name", ["iiwa14", "panda", "ur5"])
def test_what_is_cut_off_boxes_is_within_zones(monkeypatch, name):
    """Of families of one joint value and of several."""
    search = _search(monkeypatch, pinsing.closed_form(pinsing.load(name), prove=False))
    rng = np.random.default_rng(6)
    C = rng.uniform(-np.pi, np.pi, (4000, search.arm.n))
    R = rng.uniform(0, 1, C.shape) * rng.choice([0.1, 0.5], (4000, 1))
    kept = rng.uniform(0.3, 1.2, len(search.each))
    c, r = search._trimmed(C, R, kept)
    Q = C + R * rng.uniform(-1, 1, C.shape)
    cut = (np.abs(Q - c) > r).any(axis=1)
    assert cut.any()
    near = two_sided(search.watched.conditions.zeros, Q[cut], each=True).each[..., 0]
    assert (near <= kept + 1e-9).any(axis=1).all()


def test_long_equations_are_reached_and_never_too_near(monkeypatch):
    form = pinsing.closed_form(pinsing.load("gofa5"), prove=False)
    Q = np.random.default_rng(8).uniform(-np.pi, np.pi, (400, 6))
    search = _search(monkeypatch, form)
    cells = zone_search._cells(Q, 0 * Q, len(search.each))
    search._follow(cells)
    search._begin_elsewhere(cells)
    low = two_sided(watch(form).conditions.zeros, Q, each=True).each[..., 0]
    up = search._upper(cells)[0]
    assert np.isfinite(up).all()
    true = pinsing.clearance(form, Q[:100], certify=True, boxes=2000)
    assert (true.lower <= up[:100, 0] * (1 + 1e-9)).all()
    assert (low[:100, 0] <= true.upper).all()
    assert np.mean(up[:100, 0] <= 1.02 * true.upper) > 0.96


@pytest.mark.parametrize("name", ["panda", "ur5", "gofa5"])
def test_points_are_as_near_to_families_as_bounds_say(name):
    form = pinsing.closed_form(pinsing.load(name), prove=False)
    conditions = watch(form).conditions.zeros
    Q = np.random.default_rng(9).uniform(-np.pi, np.pi, (300, form.loaded.n))
    found = two_sided(conditions, Q, each=True, points=True)
    assert (found.each <= two_sided(conditions, Q, each=True).each + 1e-12).all()
    left = found.each[..., 1] - np.linalg.norm(found.points - Q[:, None], axis=2)
    for k in range(conditions.families):
        at = two_sided(conditions, found.points[:, k], each=True).each[:, k, 0]
        assert (at <= left[:, k] + 1e-8).all()


@pytest.mark.parametrize(
    ("name", "within", "most"),
    tiered_rows(
        [("panda", "limits", 2), ("panda", None, 8), ("iiwa14", None, 32), ("ur5", None, 4),
         ("crx10ia", "limits", 4), ("ur5", "elbow up", 1), ("ur5", {"z": (0.1, 0.4)}, 1)],
        [("ur5", None, 4), ("ur5", {"z": (0.1, 0.4)}, 1)],
    ),
)  # fmt: skip
def test_what_boxes_leave_out_is_like_what_they_cover(monkeypatch, name, within, most):
    form = pinsing.closed_form(pinsing.load(name), prove=False)
    search = _search(monkeypatch, form, within=within)
    maps, middle = search._symmetries(), (search.low + search.high) / 2
    assert len(maps) == most
    Q = np.random.default_rng(4).uniform(search.low, search.high, (40, form.loaded.n))
    alike = middle + maps[:, None, 0] * (Q - middle) + maps[:, None, 1]
    shares = [search.judge.shares(q, 0.25, 0.5).max(axis=1) for q in alike]
    np.testing.assert_allclose(shares, np.broadcast_to(shares[0], np.shape(shares)), rtol=1e-6)
    for family in watch(form).families:
        far = [[family.distance(q).value for q in like] for like in alike[:, :5]]
        np.testing.assert_allclose(far, np.broadcast_to(far[0], np.shape(far)), atol=1e-6)
    C, R = search._first_boxes()
    off = (alike[:, :, None] - C + np.pi) % (2 * np.pi) - np.pi
    covered = ((np.abs(off) <= R + 1e-9) | ~search.active).all(axis=3)
    assert covered.any(axis=(0, 2)).all()


@pytest.mark.slow
def test_outside_the_zones_what_thresholds_mean_is_looked_for_where_zones_meet():
    found = pinsing.zones(pinsing.closed_form(pinsing.load("kr6_r900")), boxes=800_000)
    # Plain sampling of 200,000 configurations finds 0.0480 and 35.9.
    assert found.sigma_min_proven < found.sigma_min < 0.048
    assert found.condition_number > 35.9


def test_where_nothing_is_left_outside_no_distance_is_called_useful():
    done = run("zones", "ur5", "--boxes", "1", "--deg")
    assert done.exit_code == 0
    assert "ur5: no useful distance was found" in done.stdout
    assert "exceed no joint speed limit" not in done.stdout
    said = " ".join(done.stdout.split())
    assert "or the search ended too early: try lower --tip-speed and --turn-speed" in said
    assert re.search(r"limit is exceeded even [\d.]+° from all families", said)
    assert not re.search("any distance|One distance|more than needed", said)


def test_a_form_without_its_robot_and_an_arm_that_points_its_tool_nowhere_are_refused():
    read = pinsing.ClosedForm.from_json(pinsing.closed_form(pinsing.load("planar3r")).to_json())
    scara = pinsing.closed_form(pinsing.load("scara", task="tool-axis"))
    for form, said in ((read, "no robot"), (scara, r"3 of 5.* such as position")):
        with pytest.raises(OptionError, match=said):
            pinsing.zones(form, joint_speeds=[5] * form.arm.n)


def test_a_monitor_tells_in_which_zones_a_configuration_is():
    form = pinsing.closed_form(pinsing.load("scara"))
    found = pinsing.zones(form, joint_speeds=[5, 5, 1, 10])
    name, far = next((n, d) for n, d in found.distances.items() if d > 0)
    monitor = pinsing.Monitor(form, zones=found)
    assert monitor.update([0, far + 0.01, 0.1, 0]).zones == ()
    assert monitor.update([0, far - 0.01, 0.1, 0], [0, 1, 0, 0]).zones == (name,)
    assert pinsing.Monitor(form).update([0, 1, 0.1, 0]).zones is None
    monitor = pinsing.Monitor(form, zones=replace(found, lower=np.array([-1, *found.lower[1:]])))
    assert monitor.update([-1.5, 1, 0.1, 0]).zones is None
    up = replace(found, posture=("elbow up",), within=("elbow up",))
    planar = pinsing.closed_form(pinsing.load("planar3r"))
    for of, options, said in (
        (form, {"zones": up}, "give those of joint ranges"),
        (planar, {"zones": found}, "zones are of scara"),
        (form, {"zones": found, "weights": [1, 2, 1, 1]}, "without weights"),
    ):
        with pytest.raises(OptionError, match=said):
            pinsing.Monitor(of, **options)
    chain = flatten(form.loaded)
    moved = replace(chain, t=chain.t + 1e-5)  # as another calibration of the same robot
    other = on_chain(form.loaded, moved)
    for given in ({"zones": found}, {"forms": form}):
        with pytest.raises(OptionError, match="in other places, as by another calibration"):
            pinsing.export_guard(other, **given)


@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_an_arm_without_families_is_not_told_that_no_limit_is_exceeded(speed):
    turns = (-90, 0), (90, 90), (0, 0)
    rows = [(alpha, 0, 0, theta, "prismatic", (0, 1)) for alpha, theta in turns]
    form = pinsing.closed_form(dh_arm(rows, "position"))
    if speed < 1:
        assert pinsing.zones(form, linear=speed, joint_speeds=[1, 1, 1]).common == 0
    else:
        with pytest.raises(OptionError, match="may exceed a joint speed limit"):
            pinsing.zones(form, linear=speed, joint_speeds=[1, 1, 1])
