"""The interface under stress: threads, processes, pickles, inputs that must stay as they are."""

import copy
import json
import os
import pickle
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from arms import draw
from command_line import python
from tiers import tiered

from pinsing import Arm, analyze, at, closed_form, load, singular_values
from pinsing.kinematics import refine
from pinsing.sampling import sweep

ROBOTS = ("ur5", "panda", "stanford")


def points(arm: Arm, count: int) -> np.ndarray:
    return draw(arm, np.random.default_rng(3), count)


def plain(value: Any) -> Any:
    """Numbers of results, to the last bit; times aside."""
    text = json.dumps(value, default=lambda result: result.to_dict())
    kept = {"object_hook": lambda d: {k: v for k, v in d.items() if "seconds" not in k}}
    return json.loads(text, **kept)


def work(arm: Arm) -> dict[str, Any]:
    """Some of everything, of points that nothing may write to."""
    Q = points(arm, 40)
    Q.setflags(write=False)
    form = closed_form(arm, seconds=60)
    return plain(
        {
            "sigma": singular_values(arm, Q).tolist(),
            "state": [at(arm, q) for q in Q[:4]],
            "refined": refine(arm, Q[0]),
            "families": form,
            "inside": [family.contains(Q).tolist() for family in form.families],
            "sweep": sweep(arm, nominal=Q[0], samples=21, levels=1),
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("robot", tiered(["ur5", "stanford", "panda"], ("stanford",)))
def test_threads_share_an_arm(robot):
    arm = load(robot)
    alone = work(arm)
    with ThreadPoolExecutor(8) as pool:
        for together in pool.map(work, [arm] * 8):
            assert together == alone


@pytest.mark.slow
def test_threads_load_robots_side_by_side(capfd):
    """Loading catches what C++ prints to file descriptor 2, which all threads share."""
    with ThreadPoolExecutor(8) as pool:
        arms = list(pool.map(load, ROBOTS * 8))
    assert [a.name for a in arms] == list(ROBOTS) * 8
    os.write(2, b"still here\n")
    assert capfd.readouterr().err == "still here\n"


@pytest.mark.slow
def test_results_do_not_change_with_the_number_of_threads():
    code = (
        "import sys; from pinsing import load, singular_values, analyze; import numpy as np\n"
        "arm = load('ur5'); Q = np.random.default_rng(1).uniform(*arm.span, (3000, arm.n))\n"
        "a = analyze(arm, samples=31, random_starts=60, seconds=60)\n"
        "sys.stdout.write(singular_values(arm, Q).tobytes().hex())\n"
        "sys.stdout.write(''.join(s.configuration.q.tobytes().hex() for s in a.findings))\n"
        "sys.stdout.write(str(a.closed_form))\n"
    )
    found = set()
    for count in ("1", "2", "5"):
        names = [f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "PINSING")]
        env = {**os.environ, **dict.fromkeys(names, count)}
        found.add(python("-c", code, check=True, env=env).stdout)
    assert len(found) == 1
    assert len(found.pop()) > 1000


@pytest.mark.parametrize("robot", tiered(ROBOTS, {"stanford"}))
def test_pickles(robot):
    arm = load(robot)
    again = pickle.loads(pickle.dumps(arm))
    assert work(again) == work(arm)
    assert (again.joints, again.tip, again.task) == (arm.joints, arm.tip, arm.task)
    assert not any(one.lower.flags.writeable for one in (again, copy.deepcopy(arm)))
    q = points(arm, 1)[0]
    analysis = analyze(arm, nominal=q, samples=9, levels=1, random_starts=5)
    results = [at(arm, q), refine(arm, q), closed_form(arm), analysis]
    for again in (pickle.loads(pickle.dumps(results)), copy.deepcopy(results)):
        assert plain(again) == plain(results)


def test_inputs_are_never_modified():
    model = pin.buildSampleModelManipulator()
    before = model.copy()
    options = {"joints": [model.names[3], model.names[5]], "packages": {}, "xacro_args": {}}
    given = copy.deepcopy(options)
    arm, part = load(model), load(model, base=model.names[1], **options)
    assert options == given
    assert singular_values(part, points(part, 2)).shape == (2, 2)
    work(arm)
    for family in closed_form(arm).families:
        q = points(arm, 1)[0]
        q.setflags(write=False)  # any attempt would raise
        family.distance(q)
    assert model == before
    assert [f.name for f in model.frames] == [f.name for f in before.frames]
    model.jointPlacements[3] = pin.SE3.Random()  # nor does an arm follow later changes
    assert arm.source.full_model == part.source.full_model == before


@pytest.mark.slow
def test_the_same_seed_gives_the_same_analysis():
    arm = load("stanford")
    first, second = (analyze(arm, random_starts=40, seed=5) for _ in range(2))
    assert plain(first) == plain(second)
    # The global generator is nobody's business.
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    analyze(arm, random_starts=10, samples=9, levels=1)
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002
