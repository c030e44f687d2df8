"""What a map or sweep keeps of its values: counts, extremes, histograms, the worst few.

Every part can be joined in any order and any grouping with the same outcome to the last bit:
numbers are counted or compared, never added up as floats, and ties go to the lower index.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing._batch import samples
from pinsing._batch.samples import ValueCounts
from pinsing._types import Array
from pinsing.chunk_file import Record
from pinsing.measures import NEAR_RTOL, SINGULAR_RTOL

Counts = npt.NDArray[np.int64]

# A bin is a stretch of floats with the same exponent and leading digits: each octave in equal
# parts. Its number is read off the bits of the float, without a logarithm or rounding.
_DIGITS = 7
LOWEST, HIGHEST = -64, 32
"""Octaves of the histograms: from 2**LOWEST to 2**HIGHEST, with a bin below and one above."""
BINS = ((HIGHEST - LOWEST) << _DIGITS) + 2
QUANTILE_ERROR = 2.0 ** -(_DIGITS + 1)
"""Largest relative error of a quantile that is read off a histogram: half a bin."""

_SHIFT = 52 - _DIGITS
_FIRST = ((1023 + LOWEST) << _DIGITS) - 1

# Rows of the extremes.
SMALLEST, LARGEST = 0, 1
MEASURES = ("sigma", "ratio")


def bin_numbers(values: Array) -> Counts:
    """Bin (N,) of each value >= 0 (N,)."""
    bins = np.right_shift(np.ascontiguousarray(values).view(np.int64), _SHIFT)
    bins -= _FIRST
    np.maximum(bins, 0, out=bins)  # np.clip takes three times as long as both
    return np.minimum(bins, BINS - 1, out=bins)


def count_values(values: Array, bins: Counts) -> ValueCounts:
    """Add values >= 0 (N,) to their ``bins`` (BINS,); the tolerances are those of verdicts."""
    if samples.available():
        return samples.count_values(values, _SHIFT, _FIRST, bins, (SINGULAR_RTOL, NEAR_RTOL))
    numbers = bin_numbers(values)
    lowest = int(numbers.min())  # most of the bins are far from all values
    counts = np.bincount(numbers - lowest)
    bins[lowest : lowest + len(counts)] += counts
    return ValueCounts(
        int(np.count_nonzero(values <= SINGULAR_RTOL)),
        int(np.count_nonzero(values <= NEAR_RTOL)),
        int(values.argmin()),
        int(values.argmax()),
    )


def bin_edges() -> Array:
    """Lower edge of each bin, and the upper edge of the last: (BINS + 1,)."""
    numbers = (np.arange(BINS - 1, dtype=np.int64) + _FIRST + 1) << _SHIFT
    return np.concatenate([[0.0], numbers.view(np.float64), [np.inf]])


class Tally:
    """Running summary of singular values.

    Parameters
    ----------
    worst : int
        How many configurations of smallest ratio are kept.

    Attributes
    ----------
    done, singular, near : int
        Configurations seen, and how many of them are singular, near-singular.
    histogram : (2, BINS) array of int
        Of sigma_r, and of the ratio that verdicts stand on.
    value, index : (2, 2) arrays
        Smallest and largest value (columns) of both, and where.
    worst_index, worst_sigma, worst_ratio : (k,) arrays
        The worst few, smallest ratio first.
    """

    def __init__(self, worst: int) -> None:
        self.worst = worst
        self.done = self.singular = self.near = 0
        self.histogram = np.zeros((2, BINS), dtype=np.int64)
        self.value = np.array([[np.inf, -np.inf], [np.inf, -np.inf]])
        self.index = np.full((2, 2), -1, dtype=np.int64)
        self.worst_index = np.empty(0, dtype=np.int64)
        self.worst_sigma = np.empty(0)
        self.worst_ratio = np.empty(0)

    def add(self, start: int, last: Array, ratio: Array, numbers: Counts | None = None) -> None:
        """Count sigma_r (N,) and the ratios (N,) of configurations from ``start`` on.

        With ``numbers`` (N,), ascending, of those instead.
        """
        if not len(last):
            return
        self.done += len(last)
        for k, values in enumerate((last, ratio)):
            found = count_values(values, self.histogram[k])
            for column, at in ((SMALLEST, found.least), (LARGEST, found.greatest)):
                if at >= 0:
                    number = start + at if numbers is None else int(numbers[at])
                    self._extreme(k, column, float(values[at]), number)
        self.singular += found.low  # of the ratios, which come last
        self.near += found.high - found.low
        full = len(self.worst_ratio) == self.worst
        rows = np.flatnonzero(ratio <= self.worst_ratio[-1]) if full else np.arange(len(ratio))
        if len(rows) > self.worst:  # no sorting of what cannot be among them
            limit = np.partition(ratio[rows], self.worst - 1)[self.worst - 1]
            rows = rows[ratio[rows] <= limit]
        if len(rows):
            places = start + rows if numbers is None else numbers[rows]
            self._worst(places, last[rows], ratio[rows])

    def join(self, other: Tally) -> None:
        """Count what ``other`` has seen."""
        self.done += other.done
        self.singular += other.singular
        self.near += other.near
        self.histogram += other.histogram
        for k in range(2):
            for column in (SMALLEST, LARGEST):
                if other.index[k, column] >= 0:
                    value, index = other.value[k, column], other.index[k, column]
                    self._extreme(k, column, float(value), int(index))
        self._worst(other.worst_index, other.worst_sigma, other.worst_ratio)

    def record(self) -> Record:
        """Everything as arrays, histograms without their empty bins."""
        found: Record = {
            "counts": np.array([self.done, self.singular, self.near], dtype=np.int64),
            "value": self.value,
            "index": self.index,
            "worst_index": self.worst_index,
            "worst_sigma": self.worst_sigma,
            "worst_ratio": self.worst_ratio,
        }
        for name, row in zip(MEASURES, self.histogram, strict=True):
            found[f"{name}_bins"] = np.flatnonzero(row)
            found[f"{name}_counts"] = row[row > 0]
        return found

    @classmethod
    def from_record(cls, record: Record, worst: int) -> Tally:
        """Rebuild from ``record``."""
        tally = cls(worst)
        tally.done, tally.singular, tally.near = (int(x) for x in record["counts"].tolist())
        tally.value = record["value"].astype(np.float64)
        tally.index = record["index"].astype(np.int64)
        tally.worst_index = record["worst_index"].astype(np.int64)
        tally.worst_sigma = record["worst_sigma"].astype(np.float64)
        tally.worst_ratio = record["worst_ratio"].astype(np.float64)
        for name, row in zip(MEASURES, tally.histogram, strict=True):
            row[record[f"{name}_bins"].astype(np.intp)] = record[f"{name}_counts"]
        return tally

    def _extreme(self, k: int, column: int, value: float, index: int) -> None:
        known, at = self.value[k, column], self.index[k, column]
        better = value < known if column == SMALLEST else value > known
        if better or (value == known and (at < 0 or index < at)):
            self.value[k, column], self.index[k, column] = value, index

    def _worst(self, index: Counts, sigma: Array, ratio: Array) -> None:
        index = np.concatenate([self.worst_index, index])
        sigma = np.concatenate([self.worst_sigma, sigma])
        ratio = np.concatenate([self.worst_ratio, ratio])
        order = np.lexsort((index, ratio))[: self.worst]
        self.worst_index, self.worst_sigma = index[order], sigma[order]
        self.worst_ratio = ratio[order]
