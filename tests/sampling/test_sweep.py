"""The paper's method: plan, levels, pruning, curves, interruption, files."""

import itertools
import signal

import arms
import numpy as np
import pytest
from tiers import tiered

from pinsing.errors import (
    ConfigurationError,
    OptionError,
    OutputError,
    ResultError,
    UnknownNameError as NoName,
)
from pinsing.sampling import SweepPlan, SweepResult, plan_sweep, sweep
from pinsing.sampling.sweeps import load_npz, run_sweep, save_npz

PI = np.pi
PAPER = [0.3, *[PI / 3] * 6]


@pytest.fixture(scope="module")
def stanford():
    return sweep(arms.textbook("stanford"))


@pytest.fixture(scope="module")
def surgical():
    """As in the paper: d1 = 0.3, outside its own range."""
    return sweep(arms.textbook("surgical7"), nominal=PAPER, ignore_limits=True)


def sets(result):
    """Forced sets as frozensets of (joint, value in units of pi)."""
    return {
        frozenset((name, round(value / PI, 9)) for name, value in fixed.items())
        for fixed in result.plan.forced
    }


def test_stanford_as_in_the_paper(stanford):
    """Section 3.2.1: pi/3 and d3 = 0.3; q1 and q6 without effect; the three families."""
    plan = stanford.plan
    np.testing.assert_allclose(plan.nominal, [PI / 3, PI / 3, 0.3, PI / 3, PI / 3, PI / 3])
    assert plan.nominal_origin == "pi/3"
    assert plan.nominal_sigma[-1] == pytest.approx(0.16316, abs=1e-5)
    assert [e.joint for e in plan.effects if not e.swept] == ["q1", "q6"]
    assert all(e.change < 1e-12 for e in plan.effects if not e.swept)
    assert min(e.change for e in plan.effects if e.swept) > 0.01
    assert sets(stanford) == {
        frozenset({("q2", 0.0)}),
        frozenset({("q2", 1.0)}),
        frozenset({("d3", 0.0)}),
        frozenset({("q5", 0.0)}),
        frozenset({("q5", 1.0)}),
    }


def test_all_joints_at_each_special_value(stanford):
    """Step (2): singular at 0 and pi, sigma_min = 0.209 at pi/2 as the paper has it."""
    rows = {round(row.value / PI, 6): row for row in stanford.uniform}
    assert set(rows) == {0.0, 0.5, -0.5, 1.0}
    assert rows[0.5].sigma_min == pytest.approx(0.209, abs=1e-4)
    assert rows[0.5].status == "regular"
    assert rows[0.0].status == rows[1.0].status == "singular"


def test_surgical_arm_minimal_sets(surgical):
    """q4 in {0, pi}; {q2, q3} in {0, pi}^2; and none that is not minimal."""
    assert surgical.plan.nominal_sigma[-1] == pytest.approx(0.061141, abs=1e-6)
    expected = {frozenset({("q4", v)}) for v in (0.0, 1.0)}
    expected |= {
        frozenset({("q2", a), ("q3", b)}) for a, b in itertools.product((0.0, 1.0), repeat=2)
    }
    assert sets(surgical) == expected
    left_out = {e.joint: e.reason for e in surgical.plan.effects if not e.swept}
    assert set(left_out) == {"d1", "q7"}
    rows = {round(row.value / PI, 6): row for row in surgical.uniform}
    assert rows[0.5].sigma_min == pytest.approx(0.040744, abs=1e-6)


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_pruned_and_whole_sweeps_agree(levels):
    """Pruning leaves out exactly the sets that contain a forced one, and finds the same."""
    arm = arms.textbook("surgical7")
    whole = plan_sweep(arm, levels=levels, prune=False)
    pruned = plan_sweep(arm, levels=levels)
    assert whole.forced == pruned.forced
    forced = [frozenset(f.items()) for f in whole.forced]

    def listed(plan):
        return {
            frozenset((arm.joints[j], v) for j, v in zip(js, vs, strict=True))
            for level in plan.levels
            for js, vs in zip(level.joints.tolist(), level.values.tolist(), strict=True)
        }

    left_out = listed(whole) - listed(pruned)
    assert all(any(f < s for f in forced) for s in left_out)
    assert not any(f < s for f in forced for s in listed(pruned))


def test_counts_without_pruning():
    """The numbers of the paper's scheme: C(5, k) 4^k sets, each with 5 - k moving joints."""
    plan = plan_sweep(arms.textbook("surgical7"), levels=4, prune=False, samples=50)
    expected = [(5, 1), (10, 2), (10, 3), (5, 4)]
    assert [len(p.values) for p in plan.levels] == [c * 4**k for c, k in expected]
    curves = 7 + sum(c * 4**k * (5 - k) for c, k in expected)
    assert plan.n_curves == curves
    assert plan.n_jacobians == curves * 50 + 4
    assert f"{plan.n_jacobians:,} Jacobians" in str(plan)


def test_curve_look_up(stanford):
    """The paper's Figures 2 to 4: level 0 for q1 and q6; q2 = -pi is q2 = pi."""
    flat = stanford.curve({}, "q6")
    assert np.ptp(flat.sigma_min) < 1e-14
    assert stanford.curve({"q2": -PI}, "q4") is stanford.curve({"q2": PI}, 3)
    with pytest.raises(NoName, match="q9"):
        stanford.curve({"q9": 0.0}, "q4")
    with pytest.raises(OptionError, match="q2 = 0, q4 = 0"):
        stanford.curve({"q2": 0.0, "q4": 0.0}, "q5")


def test_prune_false_keeps_what_the_figures_need():
    """Figure 8a: q2 = q3 = 0 while q5 moves; and supersets such as q2 = q3 = q4 = 0."""
    result = sweep(
        arms.textbook("surgical7"), PAPER, levels=[2, 3], ignore_limits=True, prune=False
    )
    assert result.curve({"q2": 0.0, "q3": 0.0}, "q5").sigma_ratio.max() < 1e-12
    assert result.curve({"q2": 0.0, "q3": 0.0, "q4": 0.0}, "q5").level == 3
    assert not any(c.level == 1 for c in result.curves)


def test_progress_and_interruption():
    arm = arms.textbook("surgical7")
    plan = plan_sweep(arm)
    calls: list[tuple[int, int]] = []
    whole = run_sweep(arm, plan, lambda done, total: calls.append((done, total)))
    assert calls[-1] == (plan.n_jacobians, plan.n_jacobians)
    assert [d for d, _ in calls] == sorted({d for d, _ in calls})

    def stop(done: int, total: int) -> None:
        signal.raise_signal(signal.SIGINT)  # as Ctrl-C does

    part = run_sweep(arm, plan, stop)
    assert not part.complete
    assert 0 < len(part.curves) < plan.n_curves
    assert f"stopped after {len(part.curves)} of {plan.n_curves} curves" in part.notes
    for curve in part.curves:  # chunks may be done in any order
        same = whole.curve(curve.fixed, curve.moving)
        np.testing.assert_array_equal(curve.sigma_min, same.sigma_min)


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(["stanford", "surgical"], {"stanford"}))
def test_json_and_npz_round_trips(name, tmp_path, request):
    result = request.getfixturevalue(name)
    text = result.to_json()
    assert SweepResult.from_json(text).to_json() == text
    assert SweepPlan.from_json(result.plan.to_json()).to_json() == result.plan.to_json()
    path = save_npz(result, tmp_path / "sweep.npz")
    assert load_npz(path).to_json() == text
    with np.load(path) as plain:
        assert plain["sigma_min"].shape == (result.plan.n_curves, 181)
    assert save_npz(result, tmp_path / "bare").name == "bare.npz"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bare.npz", "sweep.npz"]


def test_damaged_files_and_missing_folders(stanford, tmp_path):
    with pytest.raises(OutputError, match="cannot write"):
        save_npz(stanford, tmp_path / "nowhere" / "sweep.npz")
    with pytest.raises(ResultError, match="cannot read"):
        load_npz(tmp_path / "missing.npz")
    whole = save_npz(stanford, tmp_path / "sweep.npz").read_bytes()
    for name, data in (("cut", whole[: len(whole) // 2]), ("text", b"hello"), ("empty", b"")):
        (tmp_path / f"{name}.npz").write_bytes(data)
        with pytest.raises(ResultError):
            load_npz(tmp_path / f"{name}.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(ResultError, match="not a saved sweep"):
        load_npz(tmp_path / "other.npz")


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"nominal": PAPER}, ConfigurationError, "limits of d1.*ignore_limits"),
        ({"nominal": [0.05, 1, 1, 0, 1, 1, 1]}, ConfigurationError, "singular"),
        ({"nominal": [0, 0]}, ConfigurationError, "needs 7 values"),
        ({"levels": 7}, OptionError, "between 1 and 6"),
        ({"levels": [0]}, OptionError, "between 1 and 6"),
        ({"levels": []}, OptionError, "none"),
        ({"samples": 2}, OptionError, "at least 3"),
        ({"joints": ["q22"]}, NoName, "q22"),
        ({"special": {"q22": [0.0]}}, NoName, "q22"),
        ({"special": (0.0, np.nan)}, ConfigurationError, "not finite"),
        ({"special": {"d1": [0.3]}}, ConfigurationError, "d1.*ignore_limits"),
        ({"special": np.linspace(-3, 3, 40), "levels": 5}, OptionError, "too many"),
    ],
)
def test_wrong_input(options, error, words):
    with pytest.raises(error, match=words):
        sweep(arms.textbook("surgical7"), **options)
