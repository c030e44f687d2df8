"""Maps over inputs and poses of a mechanism: the numbers of one configuration, many at a time."""

from __future__ import annotations

import json

import numpy as np
import pytest
from mechanisms import URDF, shipped

import pinsing
from pinsing.cli import main
from pinsing.errors import OptionError
from pinsing.maps import MechanismMap
from pinsing.mechanism import mechanism_at, refine
from pinsing.mechanism.batch import BatchLoops
from pinsing.mechanism.closure import random_closed
from pinsing.mechanism.measure_many import measure_many


@pytest.mark.parametrize("name", ["five_bar", "planar_3rrr", "gough_stewart", "agile_eye", "rssr"])
def test_many_at_once_equal_one_by_one(name, rng):
    mechanism = shipped(name).without_limits()
    Q = random_closed(mechanism, 6, rng)
    for kind in ("type 1", "type 2"):
        point = refine(mechanism, Q[0], kind)
        Q += [point.q] if point.converged else []
    found = measure_many(BatchLoops(mechanism), np.array(Q))
    kinds = found.kinds()
    for k, q in enumerate(Q):
        state = mechanism_at(mechanism, q)
        one = (state.output_ratio, state.input_ratio, state.constraint_ratio)
        many = (found.output_ratio[k], found.input_ratio[k], found.constraint_ratio[k])
        assert many == pytest.approx(one, rel=1e-7, abs=1e-11)
        assert kinds[k] == ("near" if state.near else state.kind)
    assert {"type 1", "type 2", "type 3"} & set(kinds.tolist()) or name == "gough_stewart"


@pytest.mark.parametrize("over", ["inputs", "poses"])
def test_a_map_keeps_loops_and_limits(over):
    mechanism = shipped("gough_stewart")
    found = pinsing.mechanism_map(mechanism, over, 128, seed=3)
    assert 0 < found.closed <= found.count == 128
    assert sum(found.kinds.values()) == found.closed - found.beyond > 0
    low, high = mechanism.lower[list(mechanism.actuated)], mechanism.upper[list(mechanism.actuated)]
    for w in found.worst:
        state = mechanism_at(mechanism, w.q)
        least = min(state.output_ratio, state.input_ratio, state.constraint_ratio)
        assert w.measure == pytest.approx(least, rel=1e-7)
        assert not mechanism.space.outside(w.q).any()
        assert ((low <= w.inputs) & (w.inputs <= high)).all()
    assert [w.measure for w in found.worst] == sorted(w.measure for w in found.worst)
    table = np.array([found.output_ratio, found.input_ratio, found.constraint_ratio])
    assert (np.diff(table, axis=1) >= 0).all()
    assert table[:, 0].min() == pytest.approx(found.worst[0].measure, rel=1e-9)


def test_the_same_seed_gives_the_same_map_and_json_keeps_it():
    mechanism = shipped("planar_3rrr")
    one, two = (pinsing.mechanism_map(mechanism, count=100, seed=5) for _ in range(2))
    assert one.to_json() == two.to_json()
    assert MechanismMap.from_dict(json.loads(one.to_json())).to_json() == one.to_json()
    assert one.to_json() != pinsing.mechanism_map(mechanism, count=100, seed=6).to_json()
    assert "\u00a0" not in str(one)


def test_more_actuators_than_freedoms_are_mapped_as_such():
    plain = shipped("planar_3rrr")
    extra = plain.with_actuated(["a1", "a2", "a3", "b1"])
    one, more = (pinsing.mechanism_map(m, count=100) for m in (plain, extra))
    assert more.closed == one.closed > 10
    # Held by one more, the output is held at least as well.
    assert (more.input_ratio >= one.input_ratio - 1e-12).all()


def test_what_cannot_be_mapped_is_said():
    five = shipped("five_bar")
    for options, words in (
        ({"over": "joints"}, "inputs or poses"),
        ({"count": 0}, "count must be 1 or more"),
        ({"count": 10**9}, "count must be at most 10000000"),
        ({"worst": 0}, "worst must be 1 or more"),
        ({"seed": -1}, "seed must be 0 or more"),
    ):
        with pytest.raises(OptionError, match=words):
            pinsing.mechanism_map(five, **options)


@pytest.mark.parametrize(
    ("more", "code", "words"),
    [
        (["--over", "poses", "--count", "1e2", "--deg"], 0, "100 poses of the output"),
        (["--steps", "5"], 2, "--steps does not go with --loops"),
        (["--count", "0.5"], 2, "not a whole number"),
        (["--sampling", "grid"], 2, "--sampling does not go with --loops"),
    ],
)
def test_the_command(more, code, words, capsys):
    tree, loops = (str(URDF / f"planar_3rpr.{x}") for x in ("urdf", "loops.yaml"))
    with pytest.raises(SystemExit) as ended:
        main(["map", tree, "--loops", loops, *more])
    assert ended.value.code == code
    told = capsys.readouterr()
    assert words in " ".join((told.out + told.err).split())


def test_over_is_an_option_of_mechanisms(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["map", "ur5", "--over", "poses"])
    assert ended.value.code == 2
    assert "--over goes with --loops" in capsys.readouterr().err
