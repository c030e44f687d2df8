"""What a map or sweep keeps of its values: counts, extremes, histograms, the worst few, dips.

Every part can be joined in any order and any grouping with the same outcome to the last bit:
numbers are counted or compared, never added up as floats, and ties go to the lower index. A tally
that comes from a file or from another machine is judged before it is joined: all that follows
from the number of configurations, and all that says the same thing twice, is compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pinsing._batch import engine
from pinsing.chunk_file import DamagedError, Record
from pinsing.errors import OptionError
from pinsing.measures import (
    NEAR_RTOL,
    ROUNDING,
    SINGULAR_RTOL,
    Array,
    Bool,
    Ints,
    NDArray,
    Status,
    status_of,
)

# A bin is a stretch of floats with the same exponent and leading digits: each octave in equal
# parts. Its number is read off the bits of the float, without a logarithm or rounding.
_DIGITS = 7
LOWEST, HIGHEST = -64, 32
"""Octaves of the histograms: from 2**LOWEST to 2**HIGHEST, with a bin below and one above."""
BINS = ((HIGHEST - LOWEST) << _DIGITS) + 2
QUANTILE_ERROR = 2.0 ** -(_DIGITS + 1)
"""Largest relative error of a quantile that is read off a histogram: half a bin."""

BLOCK = 4096
"""Configurations that are treated at a time; a chunk is a number of whole blocks."""

WORST = 20
"""Worst configurations that are kept unless asked otherwise."""

_SHIFT = np.finfo(float).nmant - _DIGITS
_FIRST = ((1023 + LOWEST) << _DIGITS) - 1

# Rows of the extremes.
SMALLEST, LARGEST = range(2)
MEASURES = ("sigma", "ratio")


def bin_numbers(values: Array) -> Ints:
    """Bin (N,) of each value >= 0 (N,)."""
    bins = np.right_shift(np.ascontiguousarray(values).view(np.int64), _SHIFT)
    bins -= _FIRST
    np.maximum(bins, 0, out=bins)  # np.clip takes three times as long as both
    return np.minimum(bins, BINS - 1, out=bins)


def count_values(values: Array, bins: Ints) -> tuple[int, int, int, int]:
    """Add values >= 0 (N,) to their ``bins`` (BINS,); return counts and places of extremes.

    How many are at most each tolerance of verdicts; where the first least, and greatest, one is.
    """
    if engine.available():
        tolerances = SINGULAR_RTOL, NEAR_RTOL
        return tuple(engine.module().count_values(values, _SHIFT, _FIRST, bins, *tolerances))
    numbers = bin_numbers(values)
    lowest = int(numbers.min())  # most of the bins are far from all values
    counts = np.bincount(numbers - lowest)
    bins[lowest : lowest + len(counts)] += counts
    low, high = (int(np.count_nonzero(values <= tol)) for tol in (SINGULAR_RTOL, NEAR_RTOL))
    return low, high, int(values.argmin()), int(values.argmax())


def bin_edges() -> Array:
    """Lower edge of each bin, and the upper edge of the last: (BINS + 1,)."""
    numbers = (np.arange(BINS - 1, dtype=np.int64) + _FIRST + 1) << _SHIFT
    return np.concatenate([[0.0], numbers.view(np.float64), [np.inf]])


_POINT = {"index": np.int64, "sigma": np.float64, "ratio": np.float64}
"""What is kept of one of the worst configurations."""

_ARRAYS = (
    *("counts", "value", "index"),
    *(f"worst_{name}" for name in _POINT),
    *(f"{name}_{part}" for name in MEASURES for part in ("bins", "counts")),
)


class Tally:
    """Running summary of singular values, or of the bounds of a distance.

    ``worst`` configurations are kept; ``prefix`` begins the names of arrays in a record; with
    ``ratios`` the second value is a ratio of at most 1, else both may be infinite. Of ``done``
    configurations so many are ``singular`` and ``near``. ``histogram`` (2, BINS) is of sigma_r, and
    of the ratio that verdicts stand on; ``value`` and ``index`` (2, 2) have the least and largest
    (columns) of both, and where; ``points`` (k,) are the worst few, smallest ratio first.
    """

    def __init__(self, worst: int, prefix: str = "", ratios: bool = True) -> None:
        self.worst, self.prefix, self.ratios = worst, prefix, ratios
        self.done = self.singular = self.near = 0
        self.histogram = np.zeros((2, BINS), dtype=np.int64)
        self.value = np.array([[np.inf, -np.inf], [np.inf, -np.inf]])
        self.index = np.full((2, 2), -1, dtype=np.int64)
        self.points = np.empty(0, dtype=[*_POINT.items()])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its arrays in a record."""
        return tuple(self.prefix + name for name in _ARRAYS)

    def room(self, count: int) -> int:
        """Bytes that its arrays take at most, of ``count`` configurations, with their headers."""
        return 24 * min(self.worst, count) + 2 * 16 * min(BINS, count) + 8192

    def add(self, start: int, last: Array, ratio: Array, numbers: Ints | None = None) -> None:
        """Count sigma_r (N,) and ratios (N,) from ``start`` on, or of ascending ``numbers``."""
        if not len(last):
            return
        both = (last, ratio)
        seen = [count_values(row, bins) for row, bins in zip(both, self.histogram, strict=True)]
        ends = np.array([extremes for _, _, *extremes in seen])
        full, known = len(self.points) == self.worst, self.points["ratio"]
        rows = np.flatnonzero(ratio <= known[-1]) if full else np.arange(len(ratio))
        if len(rows) > self.worst:  # no sorting of what cannot be among them
            rows = rows[ratio[rows] <= np.partition(ratio[rows], self.worst - 1)[self.worst - 1]]
        low, high, *_ = seen[1]
        counts = np.array([len(last), low, high - low])
        value = np.array([row[at] for row, at in zip(both, ends, strict=True)])
        index, where = (at + start if numbers is None else numbers[at] for at in (ends, rows))
        self._join(counts, value, index, where, last[rows], ratio[rows])

    def record(self) -> Record:
        """Everything as arrays, histograms without their empty bins."""
        arrays = [
            np.array([self.done, self.singular, self.near], dtype=np.int64),
            *(self.value, self.index, *(self.points[name] for name in _POINT)),
        ]
        for row in self.histogram:
            arrays += [np.flatnonzero(row), row[row > 0]]
        return dict(zip(self.names, arrays, strict=True))

    def join(self, record: Record) -> None:
        """Count what the tally of a record has seen, which `check` has judged."""
        part: Any = [record[name] for name in self.names]
        self._join(*part[:6])
        for row, bins, counts in zip(self.histogram, part[6::2], part[7::2], strict=True):
            row[bins] += counts

    def _join(self, counts: Ints, value: Array, index: Ints, *points: NDArray[Any]) -> None:
        """Take the numbers, the extremes and the worst of a part."""
        done, singular, near = counts.tolist()
        self.done += done
        self.singular += singular
        self.near += near
        better = np.stack([value[:, 0] < self.value[:, 0], value[:, 1] > self.value[:, 1]], axis=1)
        first = (value == self.value) & ((self.index < 0) | (index < self.index))
        taken = (better | first) & (index >= 0)
        self.value = np.where(taken, value, self.value)
        self.index = np.where(taken, index, self.index)
        worst = np.concatenate([self.points, np.rec.fromarrays(points, self.points.dtype)])
        self.points = worst[np.lexsort((worst["index"], worst["ratio"]))[: self.worst]]

    def check(
        self,
        record: Record,
        count: int,
        start: int,
        stop: int,
        measure: Callable[[list[int]], tuple[Array, Array]],
    ) -> None:
        """Judge a tally of ``count`` configurations; DamagedError says what is wrong."""
        # ``measure`` computes what stands for sigma_r and the ratio of the worst and the extremes
        # again, by their numbers.
        part = {name: record[self.prefix + name] for name in _ARRAYS}
        done, singular, near = whole(part, "counts", (3,), 0, count + 1).tolist()
        DamagedError.refuse_if(
            done != count or singular + near > done, f"it counts {done} configurations, not {count}"
        )
        if not count:
            for name, empty in Tally(self.worst).record().items():
                DamagedError.refuse_if(
                    part[name].dtype != empty.dtype or not np.array_equal(part[name], empty),
                    "it counts nothing, but has extremes",
                )
            return
        value = finite(part, "value", (2, 2), self.ratios)
        whole(part, "index", (2, 2), start, stop)
        above = self.ratios and value[1, LARGEST] > 1 + 1e-9  # a ratio that is 1, but for rounding
        DamagedError.refuse_if(
            (value[:, SMALLEST] > value[:, LARGEST]).any() or above,
            "its smallest and largest values contradict each other",
        )
        size = min(self.worst, count)
        index = whole(part, "worst_index", (size,), start, stop)
        sigma = finite(part, "worst_sigma", (size,), self.ratios)
        ratio = finite(part, "worst_ratio", (size,), self.ratios)
        ordered = np.lexsort((index, ratio))
        DamagedError.refuse_if(
            len(set(index.tolist())) < size or (ordered != np.arange(size)).any(),
            "its worst configurations are not in order",
        )
        DamagedError.refuse_if(
            ratio[0] != value[1, SMALLEST] or sigma.min() < value[0, SMALLEST],
            "its worst configurations and its smallest values differ",
        )
        DamagedError.refuse_if(
            np.count_nonzero(ratio <= SINGULAR_RTOL) != min(singular, self.worst),
            "its worst configurations and its number of singular ones differ",
        )
        for ends, name in zip(value, MEASURES, strict=True):
            bins = whole(part, f"{name}_bins", (None,), 0, BINS)
            counts = whole(part, f"{name}_counts", bins.shape, 1, count + 1)
            DamagedError.refuse_if(
                not len(bins) or (np.diff(bins) <= 0).any() or int(counts.sum()) != count,
                f"the histogram of {name} does not count {count} configurations",
            )
            DamagedError.refuse_if(
                bins[[0, -1]].tolist() != bin_numbers(ends).tolist(),
                f"the histogram of {name} does not end where its values do",
            )
        numbers = [*index.tolist(), *part["index"].ravel().tolist()]
        last, again = measure(numbers)
        found = [last[:size], again[:size], last[size : size + 2], again[size + 2 :]]
        said = np.concatenate([sigma, ratio, value.ravel()])
        # Arrays of other lengths are added up in another order.
        DamagedError.refuse_if(
            not np.allclose(np.concatenate(found), said, rtol=1e-8, atol=1e-11),
            "its worst configurations have other values than it says",
        )


CANDIDATES = 65_536
"""Dips that a sweep goes on with unless asked otherwise."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Dips of the curves, one for each wholly singular stretch, by their numbers.

    Curves whose special values alone are singular whatever the others have none.
    """

    found: int  # how many there were; more than are kept here if they were too many
    curve: Ints  # (K,) of int: numbers of their curves, ascending
    sample: Ints  # (K,) of int: which samples
    # sigma_min and sigma_ratio: (K,): sigma_r, and sigma_r / sigma_1 there
    sigma_min: Array
    sigma_ratio: Array

    def __len__(self) -> int:
        return len(self.curve)


def minima(sigma: Array, ratio: Array) -> Bool:
    """Return which samples of curves are candidates, (C, S).

    Local minima of sigma_r and sigma_r / sigma_1 (C, S), none of a flat curve. A singular stretch,
    which is rounding, has one, at a third: its middle may be special.
    """
    beside = np.pad(sigma, ((0, 0), (1, 1)), constant_values=np.inf)
    left, right = beside[:, :-2], beside[:, 2:]
    top = sigma.max(axis=1)
    bent = top - sigma.min(axis=1) > ROUNDING * top
    found: Bool = (sigma < left) & (sigma <= right) & bent[:, None]
    singular = ratio <= SINGULAR_RTOL
    inside = singular[:, :-2] & singular[:, 1:-1] & singular[:, 2:]
    for row in np.flatnonzero(inside.any(axis=1)):
        steps = np.diff(singular[row].astype(np.int8), prepend=0, append=0)
        for first, stop in zip(np.flatnonzero(steps > 0), np.flatnonzero(steps < 0), strict=True):
            if stop - first >= 3:  # singular samples in a row that are a stretch and no crossing
                found[row, first:stop] = False
                found[row, first + (stop - first) // 3] = True
    return found


class Pool:
    """Candidates as they come in, hardly more than ``most`` kept, of those ``found``.

    Every dip of sigma_r is a candidate for a singular configuration. Up to ``most`` candidates all
    are kept. Beyond, they are shared out: candidates are of one kind if the same joints are at
    special values, the same joint moves, and it stands in the same 64th of its range; of each kind
    the smallest sigma_r / sigma_1 come first, and all kinds get as many places as far as they go.
    So no family with many dips crowds out another. Kept is what has the smallest (place within its
    kind, ratio, number): the outcome is the same to the last bit however the candidates are
    grouped, since a candidate that stays out of a part stays out of the whole.
    """

    names = ("dips_found", "dip_number", "dip_kind", "dip_sigma", "dip_ratio")

    def __init__(self, most: int) -> None:
        self.most = most
        self.found = 0
        self._columns: list[Any] = [np.zeros(0, dtype=kind) for kind in (int, int, float, float)]

    def add(self, number: Ints, kind: Ints, sigma: Array, ratio: Array) -> None:
        """Take candidates (P,), all different, by the numbers of their Jacobians."""
        self._take(len(number), number, kind, sigma, ratio)

    def join(self, record: Record) -> None:
        """Take what `record` of another pool gave, which `check` has judged."""
        found, *columns = (record[name] for name in self.names)
        self._take(int(found), *columns)

    def check(self, record: Record, start: int, stop: int, regular: int) -> None:
        """Judge a pool of Jacobians from ``start`` to ``stop``, so many not of singular curves."""
        size = (min(int(whole(record, "dips_found", (), 0, regular + 1)), self.most),)
        DamagedError.refuse_if(
            (np.diff(whole(record, "dip_number", size, start, stop)) <= 0).any(),
            "its dips are not in order",
        )
        whole(record, "dip_kind", size, 0, 1 << 62)
        for name in ("dip_sigma", "dip_ratio"):
            finite(record, name, size)

    def record(self) -> Record:
        """Return what is kept, by number, as arrays."""
        self._reduce()
        return dict(zip(self.names, (np.array(self.found), *self._columns), strict=True))

    def candidates(self, samples: int) -> Candidates:
        """Return what is kept, of curves with so many samples."""
        self._reduce()
        number, _, sigma, ratio = self._columns
        return Candidates(self.found, number // samples, number % samples, sigma, ratio)

    def _take(self, found: int, *columns: NDArray[Any]) -> None:
        self.found += found
        self._columns = [np.append(*pair) for pair in zip(self._columns, columns, strict=True)]
        if len(self._columns[0]) > 2 * self.most + 4096:
            self._reduce()

    def _reduce(self) -> None:
        """Keep what has the smallest place within its kind, ratio and number; sort by number."""
        number, kind, _, ratio = self._columns
        chosen = np.argsort(number)
        if len(number) > self.most:
            order = np.lexsort((number, ratio, kind))
            sorted_kind = kind[order]
            starts = np.flatnonzero(np.diff(sorted_kind, prepend=sorted_kind[0] - 1))
            sizes = np.diff(starts, append=len(order))
            place = np.empty(len(order), dtype=np.int64)
            place[order] = np.arange(len(order)) - np.repeat(starts, sizes)
            first = np.lexsort((number, ratio, place))[: self.most]
            chosen = first[np.argsort(number[first])]
        self._columns = [column[chosen] for column in self._columns]


def array_of(
    record: Record, name: str, shape: tuple[int | None, ...], kind: type, low: float, high: float
) -> NDArray[Any]:
    """Array ``name`` of a record, from ``low`` to ``high``; DamagedError for anything else."""
    # A length of None is any.
    array: Any = record.get(name)
    DamagedError.refuse_if(array is None, f"it lacks {name}")
    DamagedError.refuse_if(array.dtype != kind, f"{name} has numbers of type {array.dtype}")
    fits = len(array.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    DamagedError.refuse_if(not fits, f"{name} has the shape {array.shape}")
    inside = np.all((array >= low) & (array <= high))  # what is no number is not
    DamagedError.refuse_if(not inside, f"{name} is outside {low} to {high}")
    return np.asarray(array)


def finite(record: Record, name: str, shape: tuple[int | None, ...], bounded: bool = True) -> Array:
    """Finite numbers of at least 0, or infinite ones too if not ``bounded``; as `array_of`."""
    return array_of(record, name, shape, np.float64, 0, np.finfo(float).max if bounded else np.inf)


def whole(record: Record, name: str, shape: tuple[int | None, ...], low: int, stop: int) -> Ints:
    """Whole numbers from ``low`` to before ``stop``; as `array_of`."""
    return array_of(record, name, shape, np.int64, low, stop - 1)


def check_names(record: Record, names: tuple[str, ...]) -> None:
    """Compare the names of the arrays."""
    other = min(set(record) ^ set(names), default=None)
    if other is not None:
        raise DamagedError(f"{other[:40]!r} is missing or does not belong there")


Locate = Callable[[int], Array]
"""Configuration (n,) of a number."""


@dataclass(frozen=True, eq=False)
class Extreme:
    """Smallest or largest value of a measure."""

    value: float  # the value
    index: int  # number of the configuration in the map or sweep; the first of equals
    q: Array  # (n,): the configuration, radians or metres


@dataclass(frozen=True, eq=False)
class Distribution:
    """Histogram of one measure, in bins of which each octave has 128."""

    # smallest and largest: exact
    smallest: Extreme
    largest: Extreme
    # lower and upper: (B,): edges of the bins that are not empty, ascending: lower <= value < upper
    lower: Array
    upper: Array
    counts: Ints  # (B,) of int: configurations in them

    def quantile(self, p: float) -> float:
        """Value that a share ``p`` of the configurations does not exceed.

        That of rank ceil(p N), up to half a bin: a relative error of at most 0.4 % (of
        values above 2**-64; below, at most 2**-64). Exact for p = 0 and 1.

        Raises
        ------
        OptionError
            If p is not between 0 and 1.
        """
        OptionError.refuse_if(not 0 <= p <= 1, f"a quantile lies between 0 and 1, not at {p}")
        if p in (0, 1):
            return self.largest.value if p else self.smallest.value
        cumulated = np.cumsum(self.counts)
        k = int(np.searchsorted(cumulated, max(1, math.ceil(p * int(cumulated[-1])))))
        low, high = float(self.lower[k]), float(self.upper[k])
        if math.isinf(high) and math.isinf(self.largest.value):
            return math.inf
        middle = (low + high) / 2 if math.isfinite(high) and low > 0 else low
        return min(max(middle, self.smallest.value), self.largest.value)


@dataclass(frozen=True, eq=False)
class WorstPoint:
    """One of the worst configurations."""

    index: int  # its number in the map or sweep
    q: Array  # (n,): radians or metres
    # sigma_min and ratio: sigma_r, and sigma_r / sigma_1
    sigma_min: float
    ratio: float
    status: Status  # ``singular``, ``near-singular`` or ``regular``


def distributions(tally: Tally, locate: Locate) -> tuple[Distribution, Distribution]:
    """Distributions of sigma_r and of sigma_r / sigma_1, of a tally that has seen something."""
    edges, out = bin_edges(), []
    for value, index, counts in zip(tally.value, tally.index, tally.histogram, strict=True):
        places = zip(value.tolist(), index.tolist(), strict=True)
        smallest, largest = (Extreme(v, i, locate(i)) for v, i in places)
        bins = np.flatnonzero(counts)
        found = Distribution(smallest, largest, edges[bins], edges[bins + 1], counts[bins])
        out.append(found)
    return out[0], out[1]


def worst_points(tally: Tally, locate: Locate) -> tuple[WorstPoint, ...]:
    """The worst few, smallest ratio first."""
    return tuple(
        WorstPoint(i, locate(i), sigma, ratio, status_of(ratio))
        for i, sigma, ratio in tally.points.tolist()
    )
