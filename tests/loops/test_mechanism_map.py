"""Maps over inputs and poses of a mechanism: the numbers of one configuration, many at a time."""

import json

import numpy as np
import pytest
import yaml
from command_line import run
from mechanisms import URDF, shipped
from tiers import sampled

import pinsing
from pinsing.loops import MechanismMap, mechanism_at, refine
from pinsing.loops.closure import BatchLoops, random_closed
from pinsing.loops.map import cannot_close
from pinsing.loops.motion import kinds_of, measure_many


@pytest.mark.parametrize(
    "name", sampled(["five_bar", "planar_3rrr", "gough_stewart", "agile_eye", "rssr"])
)
def test_many_at_once_equal_one_by_one(name, rng):
    mechanism = shipped(name).without_limits()
    Q = random_closed(mechanism, 6, rng)
    for kind in ("type 1", "type 2"):
        point = refine(mechanism, Q[0], kind)
        Q += [point.q] if point.converged else []
    found = measure_many(BatchLoops(mechanism), np.array(Q))
    kinds = kinds_of(found)
    for k, q in enumerate(Q):
        state = mechanism_at(mechanism, q)
        one = (state.output_ratio, state.input_ratio, state.constraint_ratio)
        assert found[:, k] == pytest.approx(one, rel=1e-7, abs=1e-11)
        assert kinds[k] == ("near" if state.near else state.kind)
    assert {"type 1", "type 2", "type 3"} & set(kinds.tolist()) or name == "gough_stewart"


def test_the_same_seed_gives_the_same_map_and_json_keeps_it():
    mechanism = shipped("planar_3rrr")
    one, two = (pinsing.loops.mechanism_map(mechanism, count=100, seed=5) for _ in range(2))
    assert one.to_json() == two.to_json()
    assert MechanismMap.from_dict(json.loads(one.to_json())).to_json() == one.to_json()
    assert one.to_json() != pinsing.loops.mechanism_map(mechanism, count=100, seed=6).to_json()
    assert "\u00a0" not in str(one)


def test_more_actuators_than_freedoms_are_mapped_as_such():
    plain = shipped("planar_3rrr")
    extra = plain.with_actuated(["a1", "a2", "a3", "b1"])
    one, more = (pinsing.loops.mechanism_map(m, count=100) for m in (plain, extra))
    assert more.closed == one.closed > 10
    # Held by one more, the output is held at least as well.
    assert (more.input_ratio >= one.input_ratio - 1e-12).all()


@pytest.mark.parametrize(
    ("more", "code", "words"),
    [
        (["--over", "poses", "--count", "1e2", "--deg"], 0, "100 poses of the output"),
        (["--steps", "5"], 2, "--steps does not go with --loops"),
        (["--count", "0.5"], 2, "not a whole number"),
        (["--sampling", "grid"], 2, "--sampling does not go with --loops"),
    ],
)
def test_the_command(more, code, words):
    done = run("map", URDF / "planar_3rpr.urdf", "--loops", *more)
    assert done.exit_code == code
    assert words in " ".join(done.output.split())


@pytest.mark.parametrize(
    "name",
    sampled(["gough_stewart", "stewart_6_3", "planar_3rrr", "planar_3rpr", "hexaglide", "delta"]),
)
def test_what_closes_is_never_said_to_be_impossible(name, rng):
    mechanism = shipped(name).without_limits()
    actuated = list(mechanism.actuated)
    closed = np.array(random_closed(mechanism, 40, rng))[:, actuated]
    assert len(closed) > 5
    assert not cannot_close(mechanism, closed).any()


def _circle(row):
    angles = np.radians(np.array(row["angles"], dtype=float))
    return row["radius"] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def test_impossible_inputs_of_a_platform_are_those_of_the_triangle(rng):
    """The points of the 6-3 are pairs that share one: the triangle's inequality, from the table."""
    mechanism = shipped("stewart_6_3")
    table = yaml.safe_load((URDF / "stewart_6_3.mechanism.yaml").read_text(encoding="utf-8"))
    base, top = (_circle(table[x]) for x in ("base", "platform"))
    inputs = rng.uniform(0.3, 2.5, (300, 6))
    open_ = np.zeros(300, dtype=bool)
    for i in range(6):
        for j in range(i):
            sides = np.array(
                [
                    [np.linalg.norm(base[i] - base[j]), np.linalg.norm(top[i] - top[j]), a, b]
                    for a, b in inputs[:, [i, j]]
                ]
            )
            open_ |= 2 * sides.max(axis=1) > sides.sum(axis=1) + 1e-9
    assert 100 < open_.sum() < 300
    assert (cannot_close(mechanism, inputs) == open_).all()


@pytest.mark.slow
def test_poses_are_drawn_where_the_limits_let_the_platform_go():
    found = pinsing.loops.mechanism_map(shipped("gough_stewart"), "poses", 300)
    assert found.closed - found.beyond > 100
    two = found.near["type 2"]
    assert two > 0
    share = 100 * two / (found.closed - found.beyond)
    assert f"type 2 {two} ({share:.3g} %)" in " ".join(str(found).split())
