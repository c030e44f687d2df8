"""Maps: where the configurations are, what is kept of them, and that nothing else decides it.

Also of the clearance: the bounds of each configuration, reduced; resumed; refused.
"""

import dataclasses
import itertools
import json
import math
import signal
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import arms
import numpy as np
import pytest
from command_line import and_peak, run
from hypothesis import given, strategies as st
from kernel import needs_kernel
from tiers import tiered, tiered_rows

from pinsing import clearance, closed_form, plot, singular_values
from pinsing._batch import engine as kernel
from pinsing.cli.output import Meter, duration, short
from pinsing.errors import EngineError, OutputError, WorkerError
from pinsing.kinematics.jacobian import fixed_batch, fixed_engine
from pinsing.measures import sigma_ratio
from pinsing.robot.load import load
from pinsing.sampling import MapResult, maps, plan_map, sigma_map
from pinsing.sampling.executors import local_processes
from pinsing.sampling.maps import BLOCK, grid_axis, grid_points, put_points, unit_points
from pinsing.sampling.tally import BINS, QUANTILE_ERROR, Tally, bin_edges, bin_numbers, count_values

N = 5 * BLOCK + 77


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The balance properties")
@pytest.mark.parametrize("dimension", [1, 2, 3, 7, 21, maps.MAX_DIMENSION])
def test_sobol_points_are_those_of_scipy(dimension: int) -> None:
    from scipy.stats import qmc

    expected = qmc.Sobol(dimension, scramble=False, bits=maps.BITS).random(5000)
    words = maps.sobol(0, 5000, dimension)
    np.testing.assert_array_equal(words * 2.0**-maps.BITS, expected)


@given(start=st.integers(0, 10**15), length=st.integers(0, 9000))
def test_any_stretch_of_the_sobol_sequence(start: int, length: int) -> None:
    found = maps.sobol(start, start + length, 3)
    v = maps.directions(3)
    for i in {0, length // 2, length - 1} - {-1}:
        if i < length:
            gray = (start + i) ^ ((start + i) >> 1)
            digits = [j for j in range(maps.BITS) if gray >> j & 1]
            np.testing.assert_array_equal(found[i], np.bitwise_xor.reduce(v[digits], axis=0))


@pytest.mark.parametrize("sampling", ["sobol", "random"])
@pytest.mark.parametrize("dimension", [1, 2, 5, 7])
def test_a_sample_is_the_same_in_any_stretches(sampling: str, dimension: int) -> None:
    whole = unit_points(sampling, 0, 3000, dimension, seed=4)
    assert whole.shape == (3000, dimension)
    assert ((whole >= 0) & (whole < 1)).all()
    cuts = [0, 1, 2, 7, 1000, 1003, 2999, 3000]
    parts = [unit_points(sampling, a, b, dimension, 4) for a, b in itertools.pairwise(cuts)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert not np.array_equal(unit_points(sampling, 0, 3000, dimension, 5), whole)


@needs_kernel
@given(
    start=st.one_of(st.integers(0, 10**15), st.integers(0, 5000)),
    length=st.integers(0, 300),
    n=st.integers(1, 12),
    seed=st.integers(0, 9),
)
def test_the_kernel_puts_the_same_bits(start: int, length: int, n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, n + 1))
    columns = rng.permutation(n)[:k].tolist() if seed % 2 else list(range(k))
    low = rng.normal(size=k)
    ranges = np.stack([low, low + rng.uniform(1e-3, 10, k)], axis=1)
    u = unit_points("sobol", start, start + length, k, seed)
    expected = np.full((length, n), 7.0)
    expected[:, columns] = u * (ranges[:, 1] - ranges[:, 0]) + ranges[:, 0]
    for missing in (kernel._missing, "not there"):
        found = np.full((length, n), 7.0)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(kernel, "_missing", missing)
            put_points(found, columns, "sobol", start, ranges, seed)
        np.testing.assert_array_equal(found, expected)


@needs_kernel
def test_the_kernel_refuses_what_is_not_there() -> None:
    words, columns, ones = np.zeros((2, 3), dtype=np.uint64), np.arange(3), np.ones(3)
    good = [words, words, 1, columns, ones, ones, np.empty((2, 3))]
    put_words = kernel.module().put_words
    put_words(*good)
    for wrong, said in (
        ({1: words[:1], 2: 2}, "not as long"),
        ({1: words[:1], 2: 3}, "not as long"),
        ({2: 0, 3: columns + 1}, "columns must be in"),
        ({2: 0, 4: ones[:2]}, "must have shape"),
        ({1: words[:, :2].copy(), 2: 0}, "heads must have shape"),
    ):
        with pytest.raises(ValueError, match=said):
            put_words(*(wrong.get(i, value) for i, value in enumerate(good)))


@pytest.mark.parametrize("sampling", ["sobol", "random"])
def test_a_sample_fills_the_cube(sampling: str) -> None:
    u = unit_points(sampling, 0, 1 << 14, 6, seed=1)
    # Every box of a grid of 4 x 4 in every pair of coordinates, within 6 standard deviations.
    for a, b in itertools.combinations(range(6), 2):
        box = np.bincount((u[:, a] * 4).astype(int) * 4 + (u[:, b] * 4).astype(int), minlength=16)
        assert np.abs(box - 1024).max() < (2 if sampling == "sobol" else 6 * 32)


@pytest.mark.parametrize("sizes", [(3,), (4, 3, 5), (2, 1, 7, 300, 3), (300, 400), (2, 70_000)])
def test_a_grid_has_its_last_joint_fastest(sizes: tuple[int, ...]) -> None:
    axes = [grid_axis(-1.0, 2.0 + k, size, True) for k, size in enumerate(sizes)]
    count = math.prod(sizes)
    rows = np.random.default_rng(0).integers(0, count, 200)
    expected = np.stack([a[i] for a, i in zip(axes, np.unravel_index(rows, sizes), strict=True)], 1)
    found = np.concatenate([grid_points(axes, i, i + 1) for i in rows.tolist()])
    np.testing.assert_array_equal(found, expected)
    whole = grid_points(axes, 0, count)
    np.testing.assert_array_equal(whole[rows], expected)
    third = count // 3
    pieces = [grid_points(axes, 0, third), grid_points(axes, third, count)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_the_axis_of_a_grid() -> None:
    np.testing.assert_array_equal(grid_axis(-1, 2, 4, False), [-1, 0, 1, 2])
    np.testing.assert_array_equal(grid_axis(-1, 2, 1, False), [0.5])
    turn = grid_axis(-math.pi, math.pi, 4, False)  # its end is its beginning
    np.testing.assert_allclose(turn, [-math.pi, -math.pi / 2, 0, math.pi / 2], atol=1e-15)
    assert grid_axis(-math.pi, math.pi, 4, True)[-1] == pytest.approx(math.pi)


def test_joints_that_change_nothing_are_left_out() -> None:
    plan = plan_map(arms.ur5())
    assert plan.moving == (1, 2, 3, 4)
    assert "shoulder_pan_joint, wrist_3_joint" in plan.notes[0]
    named = plan_map(arms.ur5(), ranges={"shoulder_pan_joint": (-1.0, 1.0)})
    assert named.moving == (0, 1, 2, 3, 4)
    rows = plan_map(arms.ur5().with_task("vx,vz"))
    assert 0 in rows.moving  # rows alone are not the same seen from another side


def test_configurations_are_within_their_ranges() -> None:
    arm = arms.textbook("stanford")
    q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    for sampling in ("sobol", "random", "grid"):
        plan = plan_map(arm, sampling, count=3000, joints=("q5", "d3"), q=q, ranges={"q5": (1, 2)})
        Q = plan.configurations(0, plan.count)
        assert Q.shape == (plan.count, 6)
        assert (Q[:, [0, 1, 3, 5]] == [0.1, 0.2, 0.4, 0.6]).all()
        assert ((Q[:, 4] >= 1) & (Q[:, 4] <= 2)).all()
        assert ((Q[:, 2] >= arm.lower[2]) & (Q[:, 2] <= arm.upper[2])).all()
        assert np.ptp(Q[:, 4]) > 0.9
        assert np.ptp(Q[:, 2]) > 0.9 * (arm.upper[2] - arm.lower[2])
    assert plan.steps == (54, 54)
    np.testing.assert_allclose(Q[1] - Q[0], [0, 0, Q[1, 2] - Q[0, 2], 0, 0, 0])  # d3, named last
    assert "54 x 54 = 2,916" in str(plan)


def test_bins_hold_what_their_edges_say() -> None:
    edges = bin_edges()
    assert len(edges) == BINS + 1
    assert (np.diff(edges) > 0).all()
    rng = np.random.default_rng(0)
    drawn, below = 10.0 ** rng.uniform(-25, 12, 20_000), np.nextafter(edges[1:-1], 0)
    values = np.concatenate([drawn, edges[:-1], below, [0.0, 5e-324, 1e300]])
    bins = bin_numbers(values)
    assert ((edges[bins] <= values) & (values < edges[bins + 1])).all()
    inner = edges[1:-1]  # without the bins that end at zero and at infinity
    assert (np.diff(inner) / inner[:-1] <= 2 * QUANTILE_ERROR).all()


@needs_kernel
@given(
    values=st.lists(
        st.one_of(st.floats(0, 4), st.sampled_from([0.0, 1e-9, 1e-2, 2.0**-64, 2.0**32, 1e300])),
        min_size=1,
        max_size=50,
    ),
    stride=st.integers(1, 3),
)
def test_the_kernel_counts_the_same(values: list[float], stride: int) -> None:
    column = np.repeat(np.array(values)[:, None], stride, axis=1)[:, -1]
    bins, expected = np.zeros(BINS, dtype=np.int64), np.zeros(BINS, dtype=np.int64)
    found = count_values(column, bins)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernel, "_missing", "not there")
        assert count_values(column, expected) == found
    np.testing.assert_array_equal(bins, expected)


def brute_force(sigma: np.ndarray, worst: int) -> dict[str, object]:
    ratio = sigma_ratio(sigma)
    order = np.lexsort((np.arange(len(ratio)), ratio))[:worst]
    return {
        "singular": int((ratio <= 1e-9).sum()),
        "near": int(((ratio > 1e-9) & (ratio <= 1e-2)).sum()),
        "worst": order.tolist(),
        "index": [[int(x.argmin()), int(x.argmax())] for x in (sigma[:, -1], ratio)],
    }


@pytest.mark.slow
@given(
    data=st.lists(
        st.sampled_from([0.0, 1e-12, 1e-5, 0.25, 0.5, 1.0, 3.0]), min_size=1, max_size=60
    ),
    worst=st.integers(1, 9),
    cuts=st.sets(st.integers(1, 59)),
    seed=st.integers(0, 99),
)
def test_tallies_join_in_any_order(data, worst, cuts, seed):
    sigma = np.stack([np.full(len(data), 4.0), np.array(data)], axis=1)
    ends = [0, *sorted(c for c in cuts if c < len(data)), len(data)]
    parts, serial, whole = [], Tally(worst), Tally(worst)
    for a, b in itertools.pairwise(ends):
        tally = Tally(worst)
        for each in (tally, serial):
            each.add(a, sigma[a:b, -1], sigma_ratio(sigma[a:b]))
        parts.append(tally.record())
    np.random.default_rng(seed).shuffle(parts)
    for part in parts:
        whole.join(part)
    expected = brute_force(sigma, worst)
    assert whole.done == len(data)
    assert (whole.singular, whole.near) == (expected["singular"], expected["near"])
    assert whole.points["index"].tolist() == expected["worst"]
    assert whole.index.tolist() == expected["index"]
    assert whole.histogram.sum(axis=1).tolist() == [len(data)] * 2
    for name, array in serial.record().items():
        np.testing.assert_array_equal(array, whole.record()[name])


MEASURED = [("sobol", "sigma"), ("random", "sigma"), ("grid", "sigma"), ("random", "clearance")]


@pytest.mark.parametrize(("sampling", "measure"), tiered_rows(MEASURED, MEASURED[:3]))
def test_a_map_is_what_all_its_values_say(sampling: str, measure: str) -> None:
    arm = arms.textbook("puma560") if measure == "sigma" else arms.ur5()
    result = sigma_map(arm, sampling, measure=measure, count=N, worst=30)
    plan = result.plan
    Q = plan.configurations(0, plan.count)
    sigma = singular_values(arm, Q)
    ratio = sigma_ratio(sigma)
    expected = brute_force(sigma, 30)
    assert result.done == plan.count
    assert result.complete
    assert result.singular == expected["singular"]
    assert result.near_singular == expected["near"]
    assert [p.index for p in result.worst] == expected["worst"]
    for point in result.worst:
        np.testing.assert_array_equal(point.q, Q[point.index])
        assert point.ratio == ratio[point.index]
        assert point.sigma_min == sigma[point.index, -1]
    measured = [(sigma[:, -1], result.sigma_min), (ratio, result.ratio)]
    if measure == "clearance":
        near, spread = clearance(closed_form(arm), Q), result.clearance
        measured += [(near.lower, spread.lower), (near.upper, spread.upper)]
        assert spread.families == near.names
        assert spread.complete
        order = np.lexsort((np.arange(plan.count), near.lower))[:30]
        nearest = [(i, near.lower[i], near.upper[i], near.nearest[i]) for i in order]
        assert [(p.index, p.lower, p.upper, p.family) for p in spread.nearest] == nearest
        text = result.text(degrees=True)
        assert "distance to the nearest of F1, F2, F3, in degrees" in text
        assert f"{math.degrees(near.lower.min()):.4g}" in text
        assert MapResult.from_json(result.to_json()).to_json() == result.to_json()
    else:
        old = result.to_dict()
        assert old.pop("clearance") is None  # as the version before wrote it
        assert MapResult.from_dict(old).clearance is None
    for values, found in measured:
        assert found.smallest.value == values.min()
        assert found.largest.value == values.max()
        np.testing.assert_array_equal(found.largest.q, Q[found.largest.index])
        assert found.counts.sum() == plan.count
        for p in (0.0, 1e-9, 0.001, 0.1, 0.5, 0.77, 0.999, 1.0):
            exact = np.sort(values)[max(0, math.ceil(p * len(values)) - 1)]
            assert found.quantile(p) == pytest.approx(exact, rel=QUANTILE_ERROR, abs=2.0**-64)


class Backwards(Executor):
    """Does the work at once, and hands it over in the wrong order."""

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@pytest.mark.parametrize("engine", [*kernel.isa_names(), "pinocchio"])
@pytest.mark.parametrize("robot", tiered(["ur5", "coupled", "position"], ("coupled",)))
def test_chunks_and_threads_do_not_change_a_bit(engine: str, robot: str) -> None:
    arm = arms.ur5() if robot != "position" else arms.ur5().with_task("position", 0.3)
    if robot == "coupled":
        matrix = np.random.default_rng(5).uniform(-1, 1, (6, 4))
        arm = arms.coupled(arm, matrix, np.full(6, 0.1))
    count = N if engine != "pinocchio" else 2 * BLOCK + 9

    def text(**options) -> str:
        result = sigma_map(arm, count=count, engine=engine, **options)
        assert result.engine == engine
        same = dataclasses.replace(result.plan, chunk=0)
        return dataclasses.replace(result, plan=same).to_json()

    one = text(threads=1)
    assert text(threads=2, chunk=1) == one
    assert text(threads=7, chunk=2 * BLOCK) == one
    with ThreadPoolExecutor(3) as executor:
        assert text(executor=executor, chunk=BLOCK) == one
    assert text(executor=Backwards(), chunk=BLOCK, parallel=3) == one


def test_workers_that_die_or_have_not_the_instruction_set_say_so(monkeypatch) -> None:
    with local_processes(1) as (executor, _):
        victim = executor.submit(signal.raise_signal, signal.SIGKILL)
        assert victim.exception() is not None
        with pytest.raises(WorkerError, match="a worker process died"):
            sigma_map(arms.ur5(), count=100, executor=executor)
    work = fixed_batch(arms.ur5(), "auto")
    monkeypatch.setattr(kernel, "isa_names", lambda: ("baseline",))
    if work.engine in ("baseline", "pinocchio"):
        pytest.skip("only one instruction set here")
    with pytest.raises(EngineError, match=f"planned for {work.engine}.*runs baseline"):
        work.sigma(np.zeros((1, 6)))
    with pytest.raises(EngineError, match="does not run on this machine"):
        fixed_engine(arms.ur5(), work.engine)


# By how many MiB, and a small and a large run: one number of each of the latter takes 76 MiB.
GROWS = {
    "sigma_map(arm, count={}, threads=2)": (40, [10**4], [10**7]),
    "run_sweep(arm, plan_sweep(arm, special={}, samples={}), threads=2, keep=False)": (
        60, ["[0.0], levels=[1]", 101], ["radians(range(-180, 180, 15)), levels=[2]", 2401],
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("run", GROWS)
def test_memory_does_not_grow_with_a_run(run: str) -> None:
    code = "from numpy import radians\nfrom pinsing import load\n"
    code += "from pinsing.sampling.sweeps import plan_sweep, run_sweep\n"
    code += "from pinsing.sampling import sigma_map\narm = load('panda')\nprint({}.done)\n"
    most, *sizes = GROWS[run]
    (_, small), (done, large) = (and_peak(code.format(run.format(*size))) for size in sizes)
    assert int(done) >= 10**7
    assert large - small < most
    assert large < 400


def test_the_command_takes_options_of_a_grid() -> None:
    words = "map stanford --sampling grid --steps q5=5,d3=3 --map-joints d3,q5 --deg"
    ranges = ["--range", "q5=-90,90", "--q", "0,60,0.1,0,0,0", "-o", "-"]
    done = run(*words.split(), *ranges)
    assert (done.exit_code, run(*words.split(), *ranges, "--fail-if-singular").exit_code) == (0, 1)
    data = json.loads(done.stdout)
    assert data["plan"]["steps"] == [3, 5]
    assert data["plan"]["ranges"][1] == pytest.approx([-math.pi / 2, math.pi / 2])
    assert data["plan"]["base"][1] == pytest.approx(math.pi / 3)
    assert data["singular"] == 7  # q5 = 0 at three d3, d3 = 0 at five q5


def test_ctrl_c_on_the_command(tmp_path, monkeypatch) -> None:
    seen = []

    def progress(self, done: int, total: int) -> str:
        seen.append(done)
        if len(seen) == 2:
            signal.raise_signal(signal.SIGINT)
        return ""

    monkeypatch.setattr(Meter, "text", progress)
    words = ["map", "ur5", "--count", "2**15", "--chunk", "1", "--worst", "3"]
    done = run(*words)
    assert done.exit_code == 130
    assert "stopped after" in done.stdout
    assert "with -o FOLDER" in done.stderr
    seen.clear()
    out = str(tmp_path / "run")
    done = run(*words, "-o", out)
    assert done.exit_code == 130
    assert f"what is done is in {out}: run the same command to resume" in done.stderr
    monkeypatch.undo()
    kept = len(list((tmp_path / "run" / "chunks").iterdir()))
    assert 2 <= kept < 8
    done = run(*words, "-o", out, "-o", str(tmp_path / "a.json"))
    assert done.exit_code == 0
    assert f"{kept} of 8 chunks were done before" in done.stderr
    assert "near-singular" in done.stdout
    whole = sigma_map(load("ur5"), count=2**15, chunk=1, worst=3)
    assert (tmp_path / "a.json").read_text().rstrip() == whole.to_json().rstrip()


def test_rate_and_remaining_time() -> None:
    times = iter([100.0, 104.0, 105.0])
    meter = Meter(lambda: next(times))
    assert meter.text(40_000_000, 100_000_000) == "40 M of 100 M"  # that a folder had already
    assert meter.text(60_000_000, 100_000_000) == "60 M of 100 M, 5 M/s, 8 s left"
    assert meter.text(100_000_000, 100_000_000) == "100 M of 100 M, 12 M/s, 0 s left"
    assert [short(x) for x in (7, 12_345, 3.2e9, 1e12)] == ["7", "12.3 k", "3.2 G", "1 T"]
    said = [duration(s) for s in (59, 200, 18_600, 187_200)]
    assert said == ["59 s", "3 min 20 s", "5 h 10 min", "2 d 4 h"]


def test_a_map_of_the_clearance_goes_on_in_its_folder(tmp_path: Path) -> None:
    options: dict[str, Any] = {"count": 3 * BLOCK, "chunk": 1, "out": tmp_path / "run"}
    arm = arms.textbook("stanford")
    whole = sigma_map(arm, measure="clearance", **options).to_json()
    (tmp_path / "run" / "chunks" / "000001.npz").unlink()
    told: list[str] = []
    assert sigma_map(arm, measure="clearance", **options, tell=told.append).to_json() == whole
    assert told == ["2 of 3 chunks were done before"]
    with pytest.raises(OutputError):  # the same folder without the clearance is another run
        sigma_map(arm, **options)


def test_unknown_bounds_are_said_and_not_counted_as_numbers() -> None:
    form = closed_form(load("puma560"))
    # Of its shoulder alone the closed formula knows no upper bound.
    only = dataclasses.replace(form, families=form.families[2:])
    result = sigma_map(load("puma560"), measure="clearance", forms=only, count=BLOCK)
    spread = result.clearance
    assert np.isinf(spread.upper.largest.value)
    assert spread.upper.quantile(1.0) == np.inf
    row = next(line for line in str(result).splitlines() if line.split()[:1] == ["largest"])
    assert row.split()[-1] == "-"


def test_a_plane_shows_the_proven_bound_of_each_configuration() -> None:
    arm = arms.ur5()
    q = np.array([0.1, -1.2, 1.3, -1.6, -1.4, 0.3])
    axes = plot.sigma_plane(
        arm, "elbow_joint", "wrist_2_joint", q=q, measure="clearance", samples=31
    )
    shown = np.asarray(axes.collections[0].get_array()).reshape(31, 31)
    x, y = np.linspace(-np.pi, np.pi, 31), np.linspace(-2 * np.pi, 2 * np.pi, 31)
    for i, k in ((3, 5), (15, 2), (30, 29)):
        there = q.copy()
        there[2], there[4] = x[k], y[i]
        bound = math.degrees(float(clearance(closed_form(arm), there).lower))
        assert shown[i, k] == pytest.approx(bound, abs=1e-9)
