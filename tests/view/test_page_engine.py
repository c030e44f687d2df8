"""The page computes what Python computes: frames, singular values, verdicts, distances, words."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from arms import textbook
from dh_arms import dh_text
from node import ask, needs_node
from numpy.typing import NDArray
from singular_sets import terms
from tiers import tiered, tiered_rows
from urdf_text import J, Y, Z, frame, urdf

from pinsing import at, check_trajectory, closed_form, load, singular_values
from pinsing.kinematics.jacobian import frame_jacobian, ratios, status_of, tip_placement
from pinsing.measures import pure_ellipsoids
from pinsing.robot.arm import Arm
from pinsing.view import Viewer
from pinsing.view.scene import sizes
from pinsing.view.server import engine_script
from pinsing.view.viewer import Entry, engine_data, equation_data, family_entries

pytestmark = needs_node

Floats = NDArray[np.float64]

MIMIC = urdf([
    J("one", "base", "a", (0.1, 0, 0.2), Z, "revolute", (-3, 3)),
    J("two", "a", "b", (0.5, 0, 0), Y, "revolute", (-3, 3)),
    J("three", "b", "c", (0.3, 0, 0.1), Y, "revolute", (-7, 7),
      more='<mimic joint="two" multiplier="-2" offset="0.3"/>'),
    frame("tool", "c", (0.2, 0.05, 0)),
])  # fmt: skip


def engine(arm: Arm, poses: int = 1) -> tuple[dict[str, Any], tuple[Entry, ...]]:
    entries = family_entries(arm, closed_form(arm).families, poses)
    return engine_data(arm, entries, sizes(arm)), entries


def wave(frequencies: Any, cos: Any, sin: Any, powers: Any = 0) -> dict[str, Any]:
    """An equation of the page; frequencies are doubled, as in an Equation."""
    table = np.array(frequencies)
    rows = zip(table, 0 * table + powers, cos, sin, strict=True)
    return equation_data(terms(*rows))


def family_of(equations: Any, moved: Any, entry: int = 0, values: Any = ()) -> dict[str, Any]:
    """A family of the page, of one branch."""
    branch = {"values": values, "equations": equations}
    said = {"name": f"F{entry + 1}", "text": "here", "where": ["here"]}
    return {"entry": entry, **said, "moved": [*moved], "branches": [branch]}


RIGHT = np.pi / 2
ALIKE = wave([[2, 0], [0, 2]], [1, -1], [0, 0])
"""Zero where two joints have one cosine."""


def arm_of(name: str) -> Arm:
    if name == "mimic":
        return load(MIMIC, task="vx,vz")
    name, _, scale = name.partition(" at ")
    name, _, task = name.partition(" ")
    return load(name, task=task or "pose", length_scale=float(scale or 1))


def flat(place: pin.SE3) -> list[float]:
    return [*place.rotation.ravel(), *place.translation]


ARMS = (
    "ur5", "stanford", "surgical7", "panda", "kinova", "scara", "mimic", "puma560 tool-axis",
    "puma560 vz,wx@tip,wy@tip",
)  # fmt: skip
ODD = ("stanford at 3e8", "stanford vz,wx at 1e-3", "planar3r vx", "planar3r position at 3e8")


@pytest.mark.parametrize("name", tiered(ARMS + ODD, ("mimic",)))
def test_frames_singular_values_and_verdicts_agree(name: str) -> None:
    arm = arm_of(name)
    rng = np.random.default_rng(5)
    data = engine_data(arm, family_entries(arm, (), 0), sizes(arm))
    Q = rng.uniform(*arm.span, (300, arm.n))
    for family in closed_form(arm, prove=False).families:
        Q = np.concatenate([Q, family.sample(20, rng)])
    code = """Q.map((q) => {
      const { places, tip, sigma, status } = m.measure(data, q);
      return { places: [...places, tip].map(({ R, t }) => [...R.flat(), ...t]), sigma, status };
    })"""
    found = ask(code, data=data, Q=Q)
    sigma = singular_values(arm, Q)
    work = arm.model.createData()
    expected = []
    for q in Q:
        pin.forwardKinematics(arm.model, work, arm.model_q(q))
        tip = pin.updateFramePlacement(arm.model, work, arm.tip_id)
        expected.append([*(flat(place) for place in list(work.oMi)[1:]), flat(tip)])
    np.testing.assert_allclose([h["places"] for h in found], expected, atol=1e-12)
    mine = np.array([h["sigma"][: sigma.shape[1]] for h in found])
    assert (np.abs(mine - sigma) <= 1e-10 * sigma[:, :1]).all()
    statuses = [h["status"] for h in found]
    assert statuses == [status_of(float(x)) for x in ratios(arm, Q)]
    assert {"singular", "regular"} <= set(statuses)


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(ARMS, ("stanford",)))
def test_what_is_shown_is_what_python_shows(name: str) -> None:
    arm = arm_of(name)
    rng = np.random.default_rng(8)
    data, entries = engine(arm)
    Q = np.concatenate([rng.uniform(*arm.span, (4, arm.n)), arm.span[1][None] + 0.5])
    for entry in entries:
        singular = entry.family.sample(1, rng)
        Q = np.concatenate([Q, singular, singular + rng.normal(0, 1e-3, singular.shape)])
    found = ask("Q.map((q) => m.frameAt(data, q))", data=data, Q=Q)
    for q, here in zip(Q, found, strict=True):
        there = at(arm, q)
        hot = sorted({i for d in there.dependences for i in d.indices})
        assert (here["status"], here["rank"], here["hot"]) == (there.status, there.rank, hot)
        if there.status == "near-singular" and len(there.dependences) == 1:
            assert there.dependences[0].reason.endswith(*here["why"])  # Python may say more
        assert here["genericRank"] == there.generic_rank
        assert tuple(here["outside"]) == there.outside
        assert [m["kind"] for m in here["lost"]] == [m.kind for m in there.lost]
        for mine, m in zip(here["lost"], there.lost, strict=True):
            if told := re.search(r"\((\S+) \S+ at unit joint speed", mine["words"]):
                assert float(told[1]) == pytest.approx(m.speed, rel=1e-3, abs=1e-9)
        if there.singular:
            assert [m["words"] for m in here["lost"]] == [m.words for m in there.lost]
        every = (there.translational, there.rotational)
        for mode, pair in (("all", every), ("pure", pure_ellipsoids(there.J))):
            for mine, e in zip(here["ellipsoids"][mode].values(), pair, strict=True):
                np.testing.assert_allclose(mine["radii"], e.radii, atol=1e-4 * max(1, e.radii[0]))
                one = e.radii[2] <= 1e-5 * e.radii[0] < e.radii[1]
                assert (mine["flat"] is not None) == (one and there.status != "regular")
        if (allowed := there.tip_speeds) is not None:
            both = [here["speeds"]["linear"], here["speeds"]["angular"]]
            mine = [*(kind["speed"] for kind in both), here["speeds"]["share"]]
            mine = [np.inf if x is None else x for x in mine]  # JSON has no infinity
            expected = [allowed.linear, allowed.angular, allowed.share]
            np.testing.assert_allclose(mine, expected, rtol=1e-7, atol=1e-7)
            joints = [list(allowed.linear_joints), list(allowed.angular_joints)]
            assert there.singular or [kind["joints"] for kind in both] == joints
        reached = [e.family.distance(q) for e in entries if e.reachable is not False]
        mine, value = here["verdict"], min(d.value for d in reached)
        assert mine["lower"] <= value + 1e-9
        assert mine["value"] <= value * (1 + 1e-4) + 1e-7, (mine, value, q.tolist())
        assert mine["on"] == (value <= 1e-7)


def test_a_tip_that_cannot_move_has_no_speed() -> None:
    data, _ = engine(load("planar3r", task="vx"))
    data["speeds"] = {"basis": [[1]], "linear": [True], "limits": [1, 1, 1], "asked": [0.2, 0.5]}
    found = ask("m.frameAt(data, [0, 0, 0]).speeds", data=data)
    assert found["linear"]["speed"] == 0


@pytest.mark.slow
def test_a_path_is_read_as_it_stands_and_one_in_degrees_is_refused() -> None:
    limits = {"prismatic": False, "lower": -3.0, "upper": 3.0}
    joints = [{"name": "a", **limits}, {"name": "b", **limits, "lower": None, "upper": None}]
    expected = {
        "1,2\n3,4\n": [[1, 2], [3, 4]], "b,t,a\r\n2,9,1\r\n4,9,3\r\n": [[1, 2], [3, 4]],
        "# said first\n\nt,a,b\n0,1,2\n0.1,3,4": [[1, 2], [3, 4]], "1;2\n3;4": [[1, 2], [3, 4]],
        '"a"\t"b"\n1\t2e0\n3.\t4': [[1, 2], [3, 4]],
        "# units: rad\n0,1,2\n0.1,3,2": [[1, 2], [3, 2]], "7,400": [[7, 400]],
        "1,2\n-90,2\n": "line 2: a = -90 makes sense in degrees only: write radians",
    }  # fmt: skip
    code = """texts.map((text) => {
      try { return m.parseTrajectory(text, joints); } catch (error) { return error.message; } })"""
    assert ask(code, texts=list(expected), joints=joints) == list(expected.values())


@pytest.mark.slow
def test_what_a_path_crosses_is_what_the_check_says() -> None:
    """Families of one condition: by a joint's value, also at a sample, or by an equation's sign."""
    call = "m.crossings(families, rows, joints)"
    for name in ("stanford", "ur5", "scara", "puma560", "planar3r position"):
        arm = arm_of(name)
        form, (data, _) = closed_form(arm), engine(arm)
        rows = np.random.default_rng(3).uniform(*arm.span, (8, arm.n))
        value = next(v for f in form.families for b in f.branches for v in b.values)
        rows[4, value.joint] = value.value
        found = {f["name"]: f["at"] for f in ask(call, **data, rows=rows)}
        told = check_trajectory(form, rows).crossings
        assert len(told) > 0 or "position" in name  # whose one family has two conditions
        for family in form.families:
            there = [c.t for c in told if c.family == family.name]
            assert found.get(family.name, []) == pytest.approx(there, abs=1e-6)


def test_a_path_meets_an_equation_where_it_is_zero() -> None:
    """Where a way begins, where it ends, twice on it, near each other, and exactly at a look."""
    cosine, near = wave([[2]], [1], [0]), wave([[2], [0]], [1, -np.cos(0.05)], [0, 0])
    cases = [
        (cosine, [[RIGHT], [RIGHT + 1]], []), (cosine, [[RIGHT - 1], [RIGHT]], [1]),
        (cosine, [[RIGHT - 3.5], [RIGHT + 0.5]], [(3.5 - np.pi) / 4, 0.875]),
        (near, [[-0.07], [0.07]], [1 / 7, 6 / 7]), (ALIKE, [[0.1, 0.9], [0.9, 0.1]], [0.5]),
    ]  # fmt: skip
    code = """cases.map(([e, rows]) => m.crossings([{ branches: [{ values: [], equations: [e] }] }],
      rows, [{}, {}]).flatMap((f) => f.at))"""
    found = ask(code, cases=[case[:2] for case in cases])
    for times, (*_, parts) in zip(found, cases, strict=True):
        assert times == pytest.approx(parts, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(["ur5", "stanford", "panda", "scara"], ("scara",)))
def test_paths_lead_in_and_along(name: str) -> None:
    arm = load(name)
    data, entries = engine(arm)
    code = """data.families.map((f, k) => poses[k] && ({
      into: m.into(data, f.moved, poses[k]), along: m.along(data, f, poses[k]) }))"""
    found = ask(code, data=data, poses=[e.poses[0] if e.poses else None for e in entries])
    assert any(found)
    for entry, paths in zip(entries, found, strict=True):
        if not entry.poses:  # out of the limits
            continue
        into = ratios(arm, np.array(paths["into"]))
        assert into[0] > 1e-3
        assert into[-1] <= 1e-9
        assert paths["into"][-1] == entry.poses[0].tolist()
        assert ratios(arm, np.array(paths["along"])).max() <= 1e-8
        assert arm.within_limits(paths["along"]).all()
        assert np.ptp(paths["along"], axis=0).max() > 0.05


@pytest.mark.slow
def test_ticks_are_where_a_family_is_met_by_one_joint() -> None:
    data, entries = engine(textbook("puma560"))
    q = [0.3, 0.2, 0.4, 0.5, 0.7, 0.1]
    each = "q.map((_, j) => m.meetings(f, q, j, -Math.PI, Math.PI, false))"
    found = ask(f"data.families.map((f) => {each})", data=data, q=q)
    grid, ticks = np.linspace(-np.pi, np.pi, 2001), 0

    def moved(joint: int, values: Any) -> Floats:
        return np.where(np.arange(6) == joint, np.array(values)[:, None], q)

    for entry, per_joint in zip(entries, found, strict=True):
        for j, values in enumerate(per_joint):
            if entry.family.equations:
                signs = np.sign(entry.family.equations[0](moved(j, grid)))
                assert len(values) == int((np.diff(signs) != 0).sum())
            if values:
                assert entry.family.contains(moved(j, values), 1e-6).all()
            ticks += len(values)
    assert ticks > 6


def test_singular_values_of_hard_matrices() -> None:
    """By the script that pages in a browser run: it holds all modules, and says `Engine`."""
    rng = np.random.default_rng(2)
    cases: list[Floats] = [
        np.zeros((6, 6)), np.ones((6, 7)), np.eye(6), np.diag([1, 1, 1, 1e-9, 1e-9, 0]),
    ]  # fmt: skip
    for _ in range(60):
        m, n = rng.integers(1, 7), rng.integers(1, 9)
        A = rng.normal(size=(m, n)) * 10.0 ** rng.integers(-12, 4, (m, 1))
        if rng.random() < 0.4 and m > 1:
            A[-1] = A[0]
        cases.append(A)
    code = "((e) => [Object.keys(e), cases.map((A) => e.svd(A))])((0, eval)(script))"
    names, found = ask(code, cases=cases, script=f"{engine_script()}; Engine")
    assert {"frameAt", "svd", "distance", "into", "along", "meetings"} <= set(names)
    for A, here in zip(cases, found, strict=True):
        sigma = np.linalg.svd(A, compute_uv=False)
        np.testing.assert_allclose(here["sigma"], sigma, atol=1e-14 * max(sigma[0], 1e-300) * 50)
        U = np.array(here["left"])
        np.testing.assert_allclose(U @ U.T, np.eye(len(A)), atol=1e-13)


def test_what_is_said_of_the_distance_is_no_more_than_is_known() -> None:
    """Several equations: what is found is an upper bound, which the words call one."""
    data = {"joints": [{"prismatic": False}] * 2, "task": {"lengthScale": 1}}
    both, slide = wave([[2, 2], [2, 0]], [0, 0], [1, 0.4]), wave([[2, 0]], [0], [1], [[0, 1]])
    lone, bent = family_of([], (0, 1), 0, [{"joint": 0, "value": 0}]), family_of([both], (0, 1))
    free = family_of([slide], (0, 1), 1)
    call = "asked.map((f) => m.nearestFamily(data, q, f, terms))"
    given = {"data": data, "asked": [[lone], [bent], [free], [lone, free]], "q": [0.3, 0.9]}
    found = ask(call, **given, terms=0)
    said = ("17.2° from F1: here", "between ", "at most ", "at most ")
    assert all(f["text"].startswith(words) for f, words in zip(found, said, strict=True))
    assert found[1]["lower"] < found[1]["value"]
    assert found[3]["least"] == 0
    assert not found[1]["sure"]
    # With some work both bounds are one: the slide is 0.3 rad from where its angle is zero.
    found = ask(call, **given, terms=20000)
    assert [f["sure"] for f in found] == [True] * 4
    assert [found[k]["text"] for k in (1, 3)] == ["44° from F1: here", "17.2° from F1: here"]
    assert abs(found[2]["least"] - 0.3) < 1e-6


def test_equations_that_hold_at_once_bound_the_distance_together() -> None:
    """By each of them alone it is 0.652 to 0.668 with as much work."""
    both = [wave([[4, 4, 2, 2, 2]], [0], [1]), wave([[4, 2, 4, 2, -2]], [0], [1])]
    data = {"joints": [{"prismatic": False}] * 5, "task": {"lengthScale": 1}}
    f, q = family_of(both, range(5)), [0.3, 0.4, -0.2, 0.5, 0.3]
    found = ask("m.nearestFamily(data, q, [f], 30000)", data=data, f=f, q=q)
    assert found["lower"] > 0.665
    assert found["value"] == pytest.approx(0.668069, abs=1e-6)


PROVEN = ["ur5", "puma560", "surgical7", "panda", "stanford"]


@pytest.mark.parametrize("name", tiered(PROVEN, ("puma560",)))
def test_distances_bound_those_that_the_program_proves(name: str) -> None:
    """Of each family, of the nearest with enough work for both bounds to meet, and by a pose."""
    arm = load(name)
    data, entries = engine(arm)
    Q = np.random.default_rng(4).uniform(*arm.span, (6, arm.n))
    code = """Q.map((q) => ({ each: data.families.map((f) => m.distance(data, f, q)),
      all: m.nearestFamily(data, q, data.families, 3e6), pose: m.nearestSingular(data, q) }))"""
    for q, here in zip(Q, ask(code, data=data, Q=Q), strict=True):
        there = [e.family.distance(q) for e in entries]
        for mine, d in zip(here["each"], there, strict=True):
            assert mine["lower"] <= d.upper + 1e-9
            assert d.lower - 1e-9 <= mine["upper"]
        reached = [d for d, e in zip(there, entries, strict=True) if e.reachable is not False]
        assert here["all"]["sure"]
        assert abs(here["all"]["least"] - min(d.lower for d in reached)) < 3e-6
        assert abs(here["all"]["value"] - min(d.upper for d in reached)) < 3e-6
        assert arm.within_limits(here["pose"]["q"])
        assert at(arm, here["pose"]["q"]).singular
        assert here["pose"]["least"] <= min(d.upper for d in reached) + 1e-9


@pytest.mark.slow
def test_only_singular_poses_count_where_equations_hold_at_others_too() -> None:
    """sin(q1) sin(q5) = 0 holds at q1 = 0, where the arm is regular."""
    arm = load("ur5")
    data, _ = engine(arm)
    q = [0.2, -1.2, 1.1, -0.4, 0.7, 0.3]
    waves = [[2, 0, 0, 0, -2, 0], [2, 0, 0, 0, 2, 0]]
    family = family_of([wave(waves, [0.5, -0.5], [0, 0])], (0, 4))
    asked = [[family], [{**family, "confirm": True}]]
    call = "asked.map((f) => m.nearestFamily(data, q, f))"
    either, own = ask(call, data=data, asked=asked, q=q)
    assert either["text"] == "11.5° from F1: here"  # to where the arm is regular
    assert abs(own["value"] - 0.7) < 1e-6
    assert at(arm, own["q"]).singular
    assert own["least"] <= 0.2 + 1e-9
    assert own["text"] == "between 11.5° and 40° from F1: here"


def test_what_is_lost_is_told_from_what_is_missing_everywhere(tmp_path: Path) -> None:
    """Four joints: two motions are missing everywhere, and a third where the arm is singular."""
    path = tmp_path / "four.dh.yaml"
    rows = [(0, 0, 0.4), (-90, 0.1, 0, -90), (0, 0.45, 0)]
    rows.append((-90, 0.05, 0.4, 0, "prismatic", (0.1, 0.5)))
    path.write_text(dh_text(rows, (-120, 120), "modified"))
    arm = load(path)
    data, entries = engine(arm)
    rng = np.random.default_rng(6)
    singular = entries[0].family.sample(3, rng)
    Q = [*singular, *rng.uniform(arm.lower, arm.upper, (3, arm.n))]
    found = ask("Q.map((q) => m.frameAt(data, q))", data=data, Q=Q)
    for q, here in zip(Q, found, strict=True):
        assert here["mixed"] == 0
        assert len(here["always"]) == 2
        assert len(here["lost"]) == (here["status"] == "singular")
        if here["status"] != "singular":
            continue
        # A short way off, whichever way, the force on the line lost needs torque again.
        (lost,) = here["lost"]
        assert lost["kind"] == "line"
        force = pin.Quaternion(np.array(lost["turn"])).matrix()[:, 2]

        def torque(q: Floats, force: Floats = force, at: Any = lost["at"]) -> float:
            J, place = frame_jacobian(arm, q), np.array(tip_placement(arm, q).translation)
            return float(np.abs(J.T @ [*force, *np.cross(at - place, force)]).max())

        assert torque(q) < 1e-9
        assert min(torque(q + step * np.eye(4)[2]) for step in (1e-4, -1e-4)) > 1e-5


CURVE = """((branch) => {
  const held = q.slice();
  for (const v of branch.values) held[v.joint] = v.value;
  const [i, j] = branch.involved.slice(-2);
  return { i, j, held, lines: m.locus(branch.equation, held, i, j, [-3.1, 3.1], [-3, 3.1]) };
})(m.curveBranch(families.find((f) => f.entry === entry), q, joints))"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "name"), tiered_rows([("ur5", "F3"), ("panda", "F5")], [("ur5", "F3")])
)
def test_every_end_of_the_curve_is_singular(robot: str, name: str) -> None:
    arm = load(robot)
    families = closed_form(arm).families
    viewer = Viewer(arm, families, skeleton=True)
    page = viewer._page(live=False)
    entry = [e["name"] for e in page["entries"]].index(name)
    q = page["entries"][entry]["q"][0]
    found = ask(CURVE, **page["engine"], entry=entry, q=q)
    assert len(found["lines"]) > 20
    held, both = np.array(found["held"]), [found["i"], found["j"]]
    branch = next(
        b for b in families[entry].branches if b.equations
        and all(abs(held[v.joint] - v.value) < 1e-9 for v in b.values)
    )  # fmt: skip
    (equation,) = branch.equations
    ends = np.concatenate(found["lines"])
    Q = np.tile(held, (len(ends), 1))
    Q[:, both] = ends
    assert np.abs(equation(Q)).max() < 1e-4 * np.hypot(equation.cos, equation.sin).sum()
    # Nothing is missed: along rows between the grid's, each change of sign has an end near it.
    across = np.linspace(-3.05, 3.05, 600)
    for v in np.linspace(-2.9, 2.9, 7):
        row = np.tile(held, (600, 1))
        row[:, both] = np.column_stack([across, np.full(600, v)])
        f = equation(row)
        for k in np.flatnonzero(np.sign(f[:-1]) != np.sign(f[1:])):
            assert np.linalg.norm(ends - [across[k], v], axis=1).min() < 0.12


def test_a_curve_through_points_of_the_grid_passes_through_them() -> None:
    lines = ask("m.locus(e, [0, 0], 0, 1, [-3, 3], [-3, 3])", e=ALIKE)
    assert np.ptp(np.cos(lines), axis=-1).max() < 1e-4
