"""The paper's method: plan, levels, pruning, curves, interruption, files.

Sweeps of any size: reduced as they go, cut anywhere, in bounded memory, nothing lost unsaid.
"""

import itertools
import math
import signal
import sys
from collections import Counter
from pathlib import Path

import arms
import numpy as np
import pytest
from singular_sets import dips
from tiers import tiered

from pinsing.errors import OptionError, OutputError, ResultError
from pinsing.plot import sigma_curves
from pinsing.sampling import SweepPlan, SweepResult, plan_sweep, sweep
from pinsing.sampling.analyze import singular_configurations
from pinsing.sampling.sweeps import CurveTable, load_npz, run_sweep, save_npz
from pinsing.sampling.tally import Pool, minima

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


def uniform(result):
    """Where all joints are at one special value, by that in units of pi."""
    return {round(row.value / PI, 6): row for row in result.uniform}


def test_stanford_as_in_the_paper(stanford):
    """Section 3.2.1: pi/3 and d3 = 0.3; q1 and q6 without effect; the three families.

    Step (2): all joints at 0 and pi are singular, sigma_min = 0.209 at pi/2.
    """
    plan = stanford.plan
    np.testing.assert_allclose(plan.nominal, [PI / 3, PI / 3, 0.3, PI / 3, PI / 3, PI / 3])
    assert plan.nominal_origin == "pi/3"
    assert plan.nominal_sigma[-1] == pytest.approx(0.16316, abs=1e-5)
    assert [e.joint for e in plan.effects if not e.swept] == ["q1", "q6"]
    assert all((e.change > 0.01) if e.swept else (e.change < 1e-12) for e in plan.effects)
    values = ("q2", 0.0), ("q2", 1.0), ("d3", 0.0), ("q5", 0.0), ("q5", 1.0)
    assert sets(stanford) == {frozenset({value}) for value in values}
    rows = uniform(stanford)
    assert {k: row.status for k, row in rows.items()} == {
        0.0: "singular", 0.5: "regular", -0.5: "regular", 1.0: "singular"
    }  # fmt: skip
    assert rows[0.5].sigma_min == pytest.approx(0.209, abs=1e-4)


def test_surgical_arm_minimal_sets(surgical):
    """q4 in {0, pi}; {q2, q3} in {0, pi}^2; and none that is not minimal."""
    assert surgical.plan.nominal_sigma[-1] == pytest.approx(0.061141, abs=1e-6)
    pairs = itertools.product((0.0, 1.0), repeat=2)
    expected = {frozenset({("q4", v)}) for v in (0.0, 1.0)}
    assert sets(surgical) == expected | {frozenset({("q2", a), ("q3", b)}) for a, b in pairs}
    assert {e.joint for e in surgical.plan.effects if not e.swept} == {"d1", "q7"}
    assert uniform(surgical)[0.5].sigma_min == pytest.approx(0.040744, abs=1e-6)


@pytest.mark.parametrize("levels", [1, 2, 4])
def test_pruned_and_whole_sweeps_agree(levels):
    """Pruning leaves out exactly the sets that contain a forced one, and finds the same.

    Whole, as the paper's: C(5, k) 4^k sets, each with 5 - k moving joints.
    """
    arm = arms.textbook("surgical7")
    whole = plan_sweep(arm, levels=levels, prune=False)
    sets = [math.comb(5, k) * 4**k for k in range(1, levels + 1)]
    assert [len(p.values) for p in whole.levels] == sets
    assert whole.n_curves == 7 + sum(count * (5 - k) for k, count in enumerate(sets, 1))
    assert whole.n_jacobians == whole.n_curves * whole.samples + 4
    assert f"{whole.n_jacobians:,} Jacobians" in str(whole)
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


def test_curve_look_up(stanford):
    """The paper's Figures 2 to 4: level 0 for q1 and q6; q2 = -pi is q2 = pi.

    Figure 8a: q2 = q3 = 0 while q5 moves; and supersets such as q2 = q3 = q4 = 0.
    """
    assert np.ptp(stanford.curve({}, "q6").sigma_min) < 1e-14
    assert stanford.curve({"q2": -PI}, "q4") is stanford.curve({"q2": PI}, 3)
    options = {"levels": [2, 3], "ignore_limits": True, "prune": False}
    result = sweep(arms.textbook("surgical7"), PAPER, **options)
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
    for data in (whole[: len(whole) // 2], b"hello", b""):
        (tmp_path / "broken.npz").write_bytes(data)
        with pytest.raises(ResultError):
            load_npz(tmp_path / "broken.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(ResultError, match="not a saved sweep"):
        load_npz(tmp_path / "other.npz")


SWEEP = sys.modules[run_sweep.__module__]  # the package has a function of that name


@pytest.mark.parametrize("prune", [True, False])
def test_curves_by_number_are_those_of_the_plan(prune: bool) -> None:
    """Against the plain loops: level by level, set by set, joint by joint."""
    arm = arms.textbook("stanford")
    plan = plan_sweep(arm, levels=(1, 3), samples=11, joints=arm.joints[:5], prune=prune)
    expected = [((), (), i) for i in range(5)]
    for level in plan.levels:
        if level.swept:
            for js, vs in zip(level.joints.tolist(), level.values.tolist(), strict=True):
                expected += [(tuple(js), tuple(vs), m) for m in plan.swept if m not in js]
    table = CurveTable(plan)
    assert len(table) == len(expected) == plan.n_curves
    numbers = np.random.default_rng(0).permutation(len(table))
    rows = table.rows(numbers)
    known = [set(f.items()) for f in plan.forced]
    for k, number in enumerate(numbers.tolist()):
        joints, values, moving = expected[number]
        assert np.flatnonzero(rows.fixed[k]).tolist() == list(joints)
        assert rows.base[k, list(joints)].tolist() == list(values)
        rest = ~rows.fixed[k]
        assert (rows.base[k] == plan.nominal)[rest].all()
        assert rows.moving[k] == moving
        fixed = table.fixed_values(rows, k)
        assert rows.singular[k] == any(f <= set(fixed.items()) for f in known)
        assert rows.forced[k] == (fixed in plan.forced)
    for fixed, (row, of_set) in zip(plan.forced, table.forced(), strict=True):
        assert {arm.joints[j]: row[j] for j in np.flatnonzero(~np.isnan(row))} == fixed
        assert all(fixed == table.fixed_values(table.rows([c]), 0) for c in of_set)
        assert len(of_set) == (4 - len(fixed) if len(fixed) in (1, 3) else 0)
    assert rows.forced.sum() == sum(len(of_set) for _, of_set in table.forced())


def test_minima_are_neither_lost_nor_doubled(rng: np.random.Generator) -> None:
    """Rough curves with plateaus; a singular stretch, whose dips are rounding, is one."""
    for _ in range(40):
        values = rng.integers(1, 6, 23).astype(float)
        before, after = np.append(np.inf, values[:-1]), np.append(values[1:], np.inf)
        expected = np.flatnonzero((values < before) & (values <= after))
        np.testing.assert_array_equal(dips(values), expected)
    sigma = np.array([[3, 1, 2, 1e-17, 3e-17, 1e-17, 2e-17, 0, 1e-17, 2, 1e-12, 3, 0.5, 1e-10]])
    assert np.flatnonzero(minima(sigma, sigma / 3)[0]).tolist() == [1, 5, 10, 13]
    one = np.full((1, 9), 1e-17) * [1, 2, 1, 3, 1, 2, 1, 1, 2]
    assert np.flatnonzero(minima(one, one)[0]).tolist() == [3]


def kept(most: int, *columns: np.ndarray) -> list[int]:
    """Numbers of those that are kept, by the definition: the best placed of all kinds first."""
    number, kind, _, ratio = columns
    places: Counter[int] = Counter()
    keys = []
    for i in np.lexsort((number, ratio)).tolist():
        keys.append((places[kind[i]], ratio[i], number[i]))
        places[kind[i]] += 1
    return sorted(number for *_, number in sorted(keys)[:most])


@pytest.mark.parametrize("most", [7, 500, 5999, 6000, 12000])
def test_candidates_are_shared_out_among_kinds_whatever_the_chunks(most: int, rng) -> None:
    N = 6000
    ratio = np.round(rng.random(N), 3)  # with ties
    kind = rng.choice([1, 2, 3, 50], N, p=[0.9, 0.08, 0.015, 0.005])
    data = (rng.permutation(N).astype(np.int64), kind, 2 * ratio, ratio)
    expected = kept(most, *data)
    for tree in (True, False):
        pool = Pool(most)
        cuts = np.sort(rng.choice(N, 40, replace=False)).tolist()
        for rows in np.split(rng.permutation(N), cuts):
            part = Pool(most) if tree else pool
            part.add(*(column[rows] for column in data))
            if tree:
                pool.join(part.record())
        record = pool.record()
        assert int(record["dips_found"]) == N
        assert record["dip_number"].tolist() == expected
        by_number = np.argsort(data[0])[expected]
        for name, column in zip(("kind", "sigma", "ratio"), data[1:], strict=True):
            np.testing.assert_array_equal(record[f"dip_{name}"], column[by_number])


def test_summary_and_candidates_are_those_of_the_curves(surgical: SweepResult) -> None:
    curves = [c for c in surgical.curves if not c.forced]
    assert len(curves) < len(surgical.curves)
    sigma = np.array([c.sigma_min for c in curves])
    ratio = np.array([c.sigma_ratio for c in curves])
    found = surgical.summary
    assert found.count == ratio.size
    assert found.singular == (ratio <= 1e-9).sum()
    assert found.near_singular == (ratio <= 1e-2).sum() - found.singular
    assert found.sigma_min.smallest.value == sigma.min()
    assert found.ratio.largest.value == ratio.max()
    assert found.ratio.counts.sum() == ratio.size
    for p in (0.01, 0.1, 0.5, 0.9):
        exact = np.sort(ratio, axis=None)[int(np.ceil(p * ratio.size)) - 1]
        assert found.ratio.quantile(p) == pytest.approx(exact, rel=0.004)
    np.testing.assert_array_equal([w.ratio for w in found.worst], np.sort(ratio, axis=None)[:20])
    assert "near-singular" in str(found)
    samples = surgical.plan.samples
    worst = found.worst[-1]
    curve = surgical.curves[worst.index // samples]
    assert curve.sigma_ratio[worst.index % samples] == worst.ratio
    assert curve.x[worst.index % samples] == worst.q[curve.moving]

    places = zip(surgical.candidates.curve, surgical.candidates.sample, strict=True)
    expected = [(c.number, i) for c in curves for i in dips(c.sigma_min)]
    assert list(places) == expected
    assert surgical.candidates.found == len(expected)
    assert surgical.done == surgical.plan.n_jacobians


def test_few_candidates_are_the_same_however_it_is_cut(tmp_path: Path) -> None:
    arm = arms.textbook("puma560")
    plan = plan_sweep(arm, samples=61)
    options = {"candidates": 40, "worst": 3, "keep": False}
    one = run_sweep(arm, plan, **options)
    assert len(one.candidates) == 40 < one.candidates.found
    assert any("of which 40 are refined" in note for note in one.notes)
    assert len(one.summary.worst) == 3
    for chunk in (1, 3000, 10**6):
        again = run_sweep(arm, plan, **options, chunk=chunk, out=tmp_path / str(chunk))
        assert again.to_json() == one.to_json()
    whole = {str(f.condition) for f in singular_configurations(arm, run_sweep(arm, plan))}
    found = {str(f.condition) for f in singular_configurations(arm, one)}
    assert {"q5 = 0", "a relation between q2 and q3"} <= found <= whole


def test_curves_that_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SWEEP, "KEEP_BYTES", 1000)  # anything at all is too large for a result
    arm = arms.textbook("stanford")
    result = sweep(arm, levels=1, samples=41)
    assert result.curves == ()
    assert result.complete
    assert "the curves are not part of the result: they take" in " ".join(result.notes)
    for ask in (lambda: result.curve({}, "q2"), lambda: sigma_curves(result)):
        with pytest.raises(OptionError, match=r"not kept .*sweep fewer"):
            ask()
    plan = result.plan
    with pytest.raises(OptionError, match=r"take 0\.0282 MiB.*sweep fewer"):
        run_sweep(arm, plan, keep=True)
    run_sweep(arm, plan, out=tmp_path / "run")
    assert load_npz(tmp_path / "run" / "sweep.npz").to_json() == result.to_json()
