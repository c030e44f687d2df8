"""A gimbal lock of three hinges that are written for a ball is no singularity of the mechanism."""

import numpy as np
import pytest
from mechanisms import shipped
from tiers import tiered

from pinsing.loops import mechanism_at, pose_forms
from pinsing.loops.analysis import locus_distance
from pinsing.loops.closure import BatchLoops, newton
from pinsing.loops.motion import kinds_of, measure_many, motions


def _locked(name, middle, rng):
    """Closed configurations at which the middle hinge of a ball is at a right angle."""
    mechanism = shipped(name).without_limits()
    loops = BatchLoops(mechanism)
    Q = rng.uniform(-1, 1, (80, mechanism.n))
    slides = mechanism.prismatic
    Q[:, ~slides] *= np.pi
    k = mechanism.joints.index(middle)
    Q[:, k] = np.pi / 2
    free = np.arange(mechanism.n) != k
    found, error = newton(loops, Q, free)
    return mechanism, loops, found[error <= 1e-11]


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(["rps3", "delta", "gough_stewart"], {"rps3"}))
def test_a_gimbal_lock_is_singular_only_where_the_pose_is(name, rng):
    mechanism, loops, Q = _locked(name, "s1y", rng)
    assert len(Q) > 5
    ball = [mechanism.joints.index(x) for x in ("s1x", "s1y", "s1z")]
    forms = pose_forms(mechanism)
    many = measure_many(loops, Q)
    told = set()
    for q, kind, two in zip(Q, kinds_of(many), many[1], strict=True):
        # The hinges turn idly, the loops closed: as written this would be of type 2.
        columns = loops.closure(q[None])[1][0][:, ball]
        assert np.linalg.svd(columns, compute_uv=False)[-1] < 1e-9
        state = mechanism_at(mechanism, q)
        assert kind == ("near" if state.near else state.kind)
        assert two == pytest.approx(state.input_ratio, rel=1e-7, abs=1e-11)
        told.add(state.kind)
        if name != "delta":  # its equation is of the output that does not turn
            assert (state.kind != "regular") == (locus_distance(mechanism, forms, q) < 1e-9)
    # Hinges of the base across the ball's: a 3-RPS is of type 2 wherever that ball locks.
    assert ("type 2" in told) if name == "rps3" else (told == {"regular"})


def test_beside_a_lock_measures_go_on_smoothly(rng):
    """With balls whole a measure does not fall to zero with the angle to the lock."""
    mechanism, _, Q = _locked("gough_stewart", "s1y", rng)
    k = mechanism.joints.index("s1y")
    free = np.arange(mechanism.n) != k
    at = motions(mechanism, Q[0]).input_ratio
    for away in (1e-3, 1e-5, 1e-7):
        start = Q[:1].copy()
        start[0, k] += away
        q, error = newton(BatchLoops(mechanism), start, free)
        assert error[0] <= 1e-11
        assert motions(mechanism, q[0]).input_ratio == pytest.approx(at, rel=0.2)
