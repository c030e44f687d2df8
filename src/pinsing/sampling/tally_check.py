"""What a tally must look like: shapes, ranges and counts that a chunk of the run can have.

A record that comes from a file or from another machine is judged before it is joined. All that
follows from the number of configurations, and all that says the same thing twice, is compared.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.chunk_file import Record
from pinsing.measures import SINGULAR_RTOL
from pinsing.sampling.tally import BINS, LARGEST, MEASURES, SMALLEST, bin_numbers

_SIGMA, _RATIO = range(len(MEASURES))
_ABOVE = 1 + 1e-9  # of a ratio that is 1, but for rounding
_HEADERS = 8192
_RELATIVE, _ABSOLUTE = 1e-8, 1e-11  # arrays of other lengths are added up in another order

TALLY = (
    *("counts", "value", "index", "worst_index", "worst_sigma", "worst_ratio"),
    *(f"{name}_{part}" for name in MEASURES for part in ("bins", "counts")),
)
"""Names of the arrays of a tally."""


def tally_room(worst: int, count: int) -> int:
    """Bytes that the arrays of a tally of ``count`` configurations take at most."""
    return 24 * min(worst, count) + 2 * 16 * min(BINS, count) + _HEADERS


def array_of(
    record: Record, name: str, shape: tuple[int | None, ...], whole: bool
) -> npt.NDArray[np.generic]:
    """Array ``name`` of a record, if it has that shape and holds whole numbers, or finite ones.

    Parameters
    ----------
    shape : tuple of int or None
        None stands for any number.
    whole : bool
        64-bit integers; 64-bit floats that are finite otherwise.

    Raises
    ------
    ValueError
        If it is not there or something else.
    """
    array = record.get(name)
    if array is None:
        raise ValueError(f"it lacks {name}")
    if array.dtype != (np.int64 if whole else np.float64):
        raise ValueError(f"{name} has numbers of type {array.dtype}")
    fits = len(array.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name} has the shape {array.shape}")
    return array


def finite(
    record: Record, name: str, shape: tuple[int | None, ...], bounded: bool = True
) -> npt.NDArray[np.float64]:
    """Finite numbers of at least 0, or infinite ones too if not ``bounded``; as `array_of`."""
    array = array_of(record, name, shape, whole=False).astype(np.float64, copy=False)
    if not ((np.isfinite(array).all() or not bounded) and (array >= 0).all()):
        raise ValueError(f"{name} is negative or not finite")
    return array


def whole(
    record: Record, name: str, shape: tuple[int | None, ...], low: int, stop: int
) -> npt.NDArray[np.int64]:
    """Whole numbers from ``low`` to before ``stop``; as `array_of`."""
    array = array_of(record, name, shape, whole=True).astype(np.int64, copy=False)
    if ((array < low) | (array >= stop)).any():
        raise ValueError(f"{name} is outside {low} to {stop - 1}")
    return array


def check_names(record: Record, names: tuple[str, ...]) -> None:
    """Compare the names of the arrays.

    Raises
    ------
    ValueError
        If there are others, or fewer.
    """
    if set(record) != set(names):
        other = sorted(set(record) ^ set(names))
        raise ValueError(f"{other[0][:40]!r} is missing or does not belong there")


def check_tally(
    record: Record, worst: int, count: int, start: int, stop: int, ratios: bool = True
) -> None:
    """Judge the tally of ``count`` configurations with numbers from ``start`` to ``stop``.

    Ratios are at most 1; without ``ratios`` its values are distances, some of them infinite.

    Raises
    ------
    ValueError
        If it cannot be that; the message says what is wrong.
    """
    done, singular, near = whole(record, "counts", (3,), 0, count + 1).tolist()
    if done != count or singular + near > done:
        raise ValueError(f"it counts {done} configurations, not {count}")
    if not count:
        return _check_empty(record)
    value = finite(record, "value", (2, 2), ratios)
    whole(record, "index", (2, 2), start, stop)
    above = ratios and value[_RATIO, LARGEST] > _ABOVE
    if (value[:, SMALLEST] > value[:, LARGEST]).any() or above:
        raise ValueError("its smallest and largest values contradict each other")
    _check_worst(record, min(worst, count), value, start, stop, ratios)
    if _singular(record) != min(singular, worst):
        raise ValueError("its worst configurations and its number of singular ones differ")
    for row, name in zip(value, MEASURES, strict=True):
        _check_histogram(record, name, row, count)
    return None


def check_values(
    record: Record,
    locate: Callable[[int], Array],
    measure: Callable[[Array], tuple[Array, Array]],
) -> None:
    """Compute the worst configurations and the extremes of a tally again.

    Parameters
    ----------
    record : Record
        As `check_tally` has judged it.
    locate : callable
        Configuration (n,) of a number.
    measure : callable
        Of configurations (N, n): what stands for sigma_r (N,) and for the ratio (N,).

    Raises
    ------
    ValueError
        If they have other values, rounding aside.
    """
    worst = record["worst_index"].tolist()
    numbers = [*worst, *record["index"].ravel().tolist()]
    if not worst:
        return
    sigma, ratio = measure(np.stack([locate(int(number)) for number in numbers]))
    n = len(worst)
    found = np.concatenate([sigma[:n], ratio[:n], sigma[n : n + 2], ratio[n + 2 :]])
    names = ("worst_sigma", "worst_ratio", "value")
    said = np.concatenate([record[name].ravel().astype(np.float64) for name in names])
    if not np.allclose(found, said, _RELATIVE, _ABSOLUTE):
        raise ValueError("its worst configurations have other values than it says")


def _singular(record: Record) -> int:
    return int(np.count_nonzero(record["worst_ratio"].astype(np.float64) <= SINGULAR_RTOL))


def _check_worst(
    record: Record,
    size: int,
    value: npt.NDArray[np.float64],
    start: int,
    stop: int,
    bounded: bool,
) -> None:
    index = whole(record, "worst_index", (size,), start, stop)
    sigma, ratio = (finite(record, f"worst_{name}", (size,), bounded) for name in MEASURES)
    ordered = np.lexsort((index, ratio))
    if len(set(index.tolist())) < size or (ordered != np.arange(size)).any():
        raise ValueError("its worst configurations are not in order")
    if ratio[0] != value[_RATIO, SMALLEST] or sigma.min() < value[_SIGMA, SMALLEST]:
        raise ValueError("its worst configurations and its smallest values differ")


def _check_histogram(record: Record, name: str, value: npt.NDArray[np.float64], count: int) -> None:
    bins = whole(record, f"{name}_bins", (None,), 0, BINS)
    counts = whole(record, f"{name}_counts", bins.shape, 1, count + 1)
    if not len(bins) or (np.diff(bins) <= 0).any() or int(counts.sum()) != count:
        raise ValueError(f"the histogram of {name} does not count {count} configurations")
    if bins[[0, -1]].tolist() != bin_numbers(value).tolist():
        raise ValueError(f"the histogram of {name} does not end where its values do")


def _check_empty(record: Record) -> None:
    if (array_of(record, "index", (2, 2), whole=True).astype(np.int64) != -1).any():
        raise ValueError("it counts nothing, but has extremes")
    for name in TALLY[3:]:
        array_of(record, name, (0,), whole=name not in ("worst_sigma", "worst_ratio"))
    ends = np.array([[np.inf, -np.inf], [np.inf, -np.inf]])
    if not np.array_equal(record["value"], ends):
        raise ValueError("it counts nothing, but has extremes")
