"""Sweeps of any size: reduced as they go, cut anywhere, in bounded memory, nothing lost unsaid."""

import sys
from pathlib import Path

import arms
import numpy as np
import pytest
from command_line import and_peak
from singular_sets import dips

from pinsing.errors import OptionError
from pinsing.plot import sigma_curves
from pinsing.sampling.analyze import singular_configurations
from pinsing.sampling.sweeps import CurveTable, SweepResult, load_npz, plan_sweep, run_sweep, sweep
from pinsing.sampling.tally import Pool, minima

SWEEP = sys.modules[run_sweep.__module__]  # the package has a function of that name


@pytest.fixture(scope="module")
def surgical() -> SweepResult:
    return sweep(arms.textbook("surgical7"))


# ---- curves by number


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


# ---- minima


def test_minima_are_neither_lost_nor_doubled(rng: np.random.Generator) -> None:
    """Rough curves with plateaus."""
    for _ in range(40):
        values = rng.integers(1, 6, 23).astype(float)
        expected = [
            i
            for i in range(23)
            if (i == 0 or values[i] < values[i - 1]) and (i == 22 or values[i] <= values[i + 1])
        ]
        assert dips(values).tolist() == expected


def test_a_singular_stretch_is_one_candidate() -> None:
    """In it all dips are rounding; a crossing keeps its own."""
    sigma = np.array([[3, 1, 2, 1e-17, 3e-17, 1e-17, 2e-17, 0, 1e-17, 2, 1e-12, 3, 0.5, 1e-10]])
    found = np.flatnonzero(minima(sigma, sigma / 3)[0])
    assert found.tolist() == [1, 5, 10, 13]
    one = np.full((1, 9), 1e-17) * [1, 2, 1, 3, 1, 2, 1, 1, 2]
    assert np.flatnonzero(minima(one, one)[0]).tolist() == [3]


def pooled(
    data: tuple[np.ndarray, ...], most: int, order: np.ndarray, cuts: list[int], tree: bool
) -> dict[str, np.ndarray]:
    whole = Pool(most)
    for rows in np.split(order, cuts):
        part = Pool(most) if tree else whole
        part.add(*(column[rows] for column in data))
        if tree:
            whole.join(part.record())
    return whole.record()


def test_candidates_that_are_kept_do_not_depend_on_the_chunks(rng: np.random.Generator) -> None:
    N = 30_000
    ratio = np.round(rng.random(N), 3)  # with ties
    kind = rng.geometric(0.05, N).astype(np.int64)
    data = (rng.permutation(N).astype(np.int64), kind, 2 * ratio, ratio)
    for most in (7, 500, N - 1, N, 2 * N):
        first = pooled(data, most, np.arange(N), [], False)
        assert int(first["dips_found"]) == N
        assert len(first["dip_number"]) == min(N, most)
        assert (np.diff(first["dip_number"]) > 0).all()
        for tree in (True, False):
            cuts = np.sort(rng.choice(N, 40, replace=False)).tolist()
            again = pooled(data, most, rng.permutation(N), cuts, tree)
            for name in first:
                np.testing.assert_array_equal(first[name], again[name])


def test_candidates_are_shared_out_among_kinds(rng: np.random.Generator) -> None:
    """By the definition, slowly: whoever is placed best within his kind goes first."""
    N, most = 2000, 300
    ratio, kind = rng.random(N), rng.choice([1, 2, 3, 50], N, p=[0.9, 0.08, 0.015, 0.005])
    number = rng.permutation(N)
    pool = Pool(most)
    pool.add(number, kind, ratio, ratio)
    places: dict[int, int] = {}
    keys = []
    for i in np.lexsort((number, ratio)).tolist():
        place = places.setdefault(int(kind[i]), 0)
        places[int(kind[i])] += 1
        keys.append((place, ratio[i], number[i]))
    expected = sorted(k[2] for k in sorted(keys)[:most])
    kept = pool.record()
    assert kept["dip_number"].tolist() == expected
    counts = {k: int((kept["dip_kind"] == k).sum()) for k in (1, 2, 3, 50)}
    assert counts[50] == (kind == 50).sum()  # the rare are all there
    assert counts[3] == (kind == 3).sum()
    assert abs(counts[1] - counts[2]) <= 1


# ---- what a sweep says of its curves


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


# ---- curves too large for a result


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


# ---- memory


def count_and_peak(step: int, levels: int, samples: int) -> tuple[int, float]:
    """Jacobians that a child process sweeps a Panda through, and its peak memory in MiB."""
    code = (
        "import math, pinsing\n"
        "from pinsing.sampling.sweeps import plan_sweep, run_sweep\n"
        "arm = pinsing.load('panda')\n"
        f"special = [math.radians(a) for a in range(-180, 180, {step})]\n"
        f"plan = plan_sweep(arm, special=special, levels=[{levels}], samples={samples})\n"
        "result = run_sweep(arm, plan, threads=2, keep=False)\n"
        "assert result.complete\n"
        "print(result.done)\n"
    )
    count, peak = and_peak(code)
    return int(count), peak


@pytest.mark.slow
def test_memory_does_not_grow_with_the_sweep() -> None:
    _, small = count_and_peak(90, 1, 101)
    count, large = count_and_peak(15, 2, 2401)
    assert count > 10_000_000  # whose curves take 160 MB
    assert large - small < 60
    assert large < 400
