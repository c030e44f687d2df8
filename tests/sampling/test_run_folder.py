"""Folders of runs that somebody has been in: what is strange is named, nothing is believed."""

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import arms
import numpy as np
import pytest
from tiers import sampled

from pinsing.chunk_file import DamagedError, pack, read_arrays, read_bounded
from pinsing.errors import OutputError, ResultError
from pinsing.sampling import sigma_map
from pinsing.sampling.execute import RunFolder, recorded
from pinsing.sampling.maps import BLOCK
from pinsing.sampling.sweeps import load_npz

COUNT = 4 * BLOCK


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("map") / "run"
    sigma_map(arms.ur5(), count=COUNT, chunk=1, out=out)
    return out


@pytest.fixture
def run(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "run"))


def resume(run: Path, whole: Path) -> list[str]:
    """Go on with a run; what was told. All bytes are those of the run at one stretch."""
    told: list[str] = []
    (run / "result.json").unlink(missing_ok=True)
    result = sigma_map(arms.ur5(), count=COUNT, chunk=1, out=run, tell=told.append)
    assert result.complete
    assert (run / "result.json").read_bytes() == (whole / "result.json").read_bytes()
    for index in range(4):
        name = f"chunks/{index:06d}.npz"
        assert not (run / name).is_symlink()
        assert (run / name).read_bytes() == (whole / name).read_bytes()
    return told


@pytest.mark.parametrize("name", ["3.npz", "0000003.npz", "²²²²²².npz"])
def test_only_exact_names_count(run: Path, whole: Path, name: str) -> None:
    shutil.copy(run / "chunks" / "000003.npz", run / "chunks" / name)
    assert resume(run, whole) == ["4 of 4 chunks were done before"]
    (run / "chunks" / "000003.npz").unlink()
    assert resume(run, whole) == ["3 of 4 chunks were done before"]


def test_litter_of_killed_writes_is_removed(run: Path, whole: Path) -> None:
    litter = [run / ".plan.json.0123.part", run / "chunks" / ".000001.npz.0123.part"]
    for path in litter:
        path.write_bytes(b"half")
    resume(run, whole)
    assert not any(path.exists() for path in litter)


STRANGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "a link to a device": (lambda p: p.symlink_to("/dev/zero"), "it is a link"),
    "a link to another chunk": (lambda p: p.symlink_to("000001.npz"), "it is a link"),
    "a link to nothing": (lambda p: p.symlink_to("nothing"), "it is a link"),
    "a pipe": (lambda p: os.mkfifo(p), "a device or pipe"),
    "nothing at all": (lambda p: p.write_bytes(b""), "not as it was written"),
    "a terabyte of nothing": (lambda p: os.truncate(os.open(p, 65), 1 << 40), "more than the"),
}


@pytest.mark.parametrize("kind", STRANGE)
def test_what_is_no_chunk_is_named_and_done_again(run: Path, whole: Path, kind: str) -> None:
    path = run / "chunks" / "000002.npz"
    path.unlink()
    make, said = STRANGE[kind]
    make(path)
    told = resume(run, whole)
    assert told[0] == "3 of 4 chunks were done before"
    assert re.fullmatch(rf"damaged and done again: chunks 2 \(.*{said}.*\)", told[1])


def test_a_folder_in_place_of_a_chunk_is_an_error_before_anything_is_computed(run: Path) -> None:
    (run / "chunks" / "000002.npz").unlink()
    (run / "chunks" / "000002.npz").mkdir()
    with pytest.raises(OutputError, match=r"000002\.npz: it is a folder; remove it"):
        sigma_map(arms.ur5(), count=COUNT, chunk=1, out=run)


def test_chunks_that_are_deleted_during_the_run(tmp_path: Path) -> None:
    out = tmp_path / "run"

    def tidy(done: int, total: int) -> None:
        if done == 2 * BLOCK:
            shutil.rmtree(out / "chunks")

    assert sigma_map(arms.ur5(), count=COUNT, chunk=1, out=out, threads=1, progress=tidy).complete


@pytest.mark.parametrize("name", ["plan.json", "lock"])
@pytest.mark.parametrize("kind", ["a link to a device", "a pipe"])
def test_plans_and_locks_that_are_no_files(run: Path, name: str, kind: str) -> None:
    (run / name).unlink()
    STRANGE[kind][0](run / name)
    with pytest.raises(OutputError, match=f"cannot use .*(run|{name})"):
        sigma_map(arms.ur5(), count=COUNT, chunk=1, out=run)


def test_a_plan_without_end(tmp_path: Path) -> None:
    with open(tmp_path / "plan.json", "wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(OutputError, match="more than the"):
        recorded(tmp_path)
    (tmp_path / "plan.json").write_text("[" * 100_000)
    with pytest.raises(OutputError, match="damaged"):
        recorded(tmp_path)
    (tmp_path / "plan.json").write_text('{"identity": {"a": NaN}, "sha256": "", "schema": 1}')
    with pytest.raises(OutputError, match="damaged"):
        recorded(tmp_path)


# ---- whole files of the right run, with contents that no chunk has


WRONG: dict[str, tuple[str, Callable[[np.ndarray], object]]] = {
    "counts too many": ("counts", lambda a: np.add(a, [1, 0, 0])),
    "counts of a whole run": ("counts", lambda a: [COUNT, 0, 0]),
    "negative": ("counts", lambda a: a * [1, -1, -1]),
    "more singular than seen": ("counts", lambda a: [BLOCK, BLOCK, 1]),
    "singular ones that are not among the worst": ("counts", lambda a: np.add(a, [0, 1, 0])),
    "a count of floats": ("counts", lambda a: a.astype(float)),
    "a scalar": ("counts", lambda a: 4096),
    "not a number": ("value", lambda a: a * np.nan),
    "infinite": ("worst_sigma", lambda a: a + np.inf),
    "a number of another chunk": ("index", lambda a: a + BLOCK),
    "worst of another chunk": ("worst_index", lambda a: a + BLOCK),
    "worst twice": ("worst_index", lambda a: a * 0 + 2 * BLOCK),
    "worst not in order": ("worst_ratio", lambda a: a[::-1].copy()),
    "fewer of the worst": ("worst_ratio", lambda a: a[:-1]),
    "a better worst": ("worst_ratio", lambda a: a * 0),
    "bins that are not there": ("sigma_bins", lambda a: a + 10**6),
    "bins before the first": ("sigma_bins", lambda a: a - 10**6),
    "bins twice": ("ratio_bins", lambda a: a // 2),
    "a histogram of more": ("ratio_counts", lambda a: a + 1),
    "a histogram of nothing": ("ratio_counts", lambda a: a * 0),
    "a histogram of another shape": ("ratio_counts", lambda a: [BLOCK]),
    "a histogram elsewhere": ("sigma_bins", lambda a: a + 1),
    "another worst configuration": (
        "worst_index", lambda a: np.sort(a) // BLOCK * BLOCK + np.arange(20)
    ),
    "another sigma of the worst": ("worst_sigma", lambda a: a * 1.001),
    "another place of the largest": ("index", lambda a: a // BLOCK * BLOCK),
    "text": ("worst_sigma", lambda a: ["a"] * 20),
    "large numbers": ("index", lambda a: np.full((2, 2), 2**62)),
    "no such array": ("value", lambda a: None),
    "an array more": ("sigma", lambda a: [1.0]),
}  # fmt: skip


@pytest.mark.parametrize("kind", sampled(WRONG))
def test_contents_that_no_chunk_has(run: Path, whole: Path, kind: str) -> None:
    identity = recorded(run)
    folder = RunFolder(run, identity, 4)
    record = folder.read(2)
    name, changed = WRONG[kind]
    value = changed(record.pop(name, np.zeros(0)))
    folder.save(2, record if value is None else {**record, name: np.asarray(value)})
    folder.read(2)  # its bytes are whole
    told = resume(run, whole)
    assert told[0] == "3 of 4 chunks were done before"
    assert told[1].startswith("damaged and done again: chunks 2 (")


def test_a_whole_chunk_of_another_run(run: Path, whole: Path, tmp_path: Path) -> None:
    sigma_map(arms.ur5(), count=COUNT, chunk=1, seed=1, out=tmp_path / "other")
    shutil.copy(tmp_path / "other" / "chunks" / "000001.npz", run / "chunks")
    assert "chunks 1 (it belongs to another run)" in resume(run, whole)[1]
    shutil.copy(run / "chunks" / "000001.npz", run / "chunks" / "000000.npz")
    assert "chunks 0 (it belongs to another place)" in resume(run, whole)[1]


def test_arrays_larger_than_they_may_be_are_not_read() -> None:
    bomb = pack({"a": np.zeros(5_000_000)}, "run", 0)  # 40 MB
    assert len(bomb) < 50_000
    with pytest.raises(DamagedError, match="too large"):
        read_arrays(bomb, 1 << 20)
    with pytest.raises(DamagedError, match="holds 70 arrays"):
        read_arrays(pack({f"a{i}": np.zeros(1) for i in range(68)}, "run", 0), 1 << 20)


def test_arrays_that_hold_objects_are_not_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", a=np.array([{}, print], dtype=object), allow_pickle=True)
    with pytest.raises(DamagedError, match="kind 'O'"):
        read_arrays((tmp_path / "x.npz").read_bytes(), 1 << 20)


def test_headers_are_not_believed(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", a=np.zeros(3))
    data = (tmp_path / "x.npz").read_bytes()
    for wrong in (b"(9,),", b"(-3,)"):
        # Stored as it is: the header can be changed, and then the sum over it is wrong too.
        with pytest.raises(DamagedError):
            read_arrays(data.replace(b"(3,),", wrong), 1 << 20)


def test_reading_never_waits(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises((DamagedError, OSError)):
            read_bounded(path, 100, follow=True)
        with pytest.raises(ResultError):
            load_npz(path)
