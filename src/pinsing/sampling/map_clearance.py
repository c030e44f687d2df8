"""What a map keeps of the clearance: both bounds of the distance to the nearest family."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import fields

import numpy as np

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.two_sided import two_sided
from pinsing.chunk_file import Record
from pinsing.errors import OptionError
from pinsing.families.solve import form_to_measure
from pinsing.kinematics.engine import PINOCCHIO
from pinsing.proximity.watched import Forms, require_forms_of, watch
from pinsing.robot.arm import Arm
from pinsing.sampling.distribution import Distribution, distributions
from pinsing.sampling.tally import Tally
from pinsing.sampling.tally_check import TALLY, check_tally, tally_room

_PREFIX = "clearance_"

CLEARANCE_TALLY = tuple(_PREFIX + name for name in TALLY)
"""Names of the arrays of the tally of the clearance in a record."""


@dataclass(frozen=True, eq=False)
class ClearancePoint:
    """One of the configurations nearest to a family.

    Attributes
    ----------
    index : int
        Its number in the map.
    q : (n,) array
        Radians or metres.
    lower, upper : float
        Bounds of the distance to the nearest family, radians (metres over the length scale);
        ``upper`` is infinite where the closed formula gives none.
    family : str
        The family of the least lower bound.
    """

    index: int
    q: Array
    lower: float
    upper: float
    family: str


@dataclass(frozen=True, eq=False)
class ClearanceSpread:
    """How the clearance is distributed over a map.

    Attributes
    ----------
    families : tuple of str
        The families that distances are taken to: all with real points, whatever the limits.
    complete : bool
        Whether the closed form is complete. Otherwise a singular configuration that belongs to
        no family may be nearer than ``lower``.
    lower, upper : Distribution
        Of the proven lower bound, and of the upper bound, as ``pinsing.clearance`` gives them.
        Radians; of joints that slide, metres over the length scale.
    nearest : tuple of ClearancePoint
        The configurations of smallest lower bound, smallest first.
    """

    families: tuple[str, ...]
    complete: bool
    lower: Distribution
    upper: Distribution
    nearest: tuple[ClearancePoint, ...]


@dataclass(frozen=True, eq=False)
class Nearness:
    """The families of a map as flat arrays: small, and able to be pickled.

    Attributes
    ----------
    names : tuple of str
        Of the families.
    complete : bool
        Whether the closed form is complete.
    conditions : Conditions
        The families.
    """

    names: tuple[str, ...]
    complete: bool
    conditions: Conditions

    @classmethod
    def of(cls, arm: Arm, forms: Forms | None) -> Nearness:
        """Families of ``forms``, by default of the closed form of ``arm``.

        Raises
        ------
        OptionError
            If they are of another arm, or there is no family at all.
        """
        if forms is None:
            forms = form_to_measure(arm)
        require_forms_of(forms, arm)
        watched = watch(forms)
        if not watched.names:
            raise OptionError(
                f"{arm.name} has no known family of singular configurations, so that every "
                "clearance is infinite: map sigma instead"
            )
        return cls(watched.names, watched.complete, watched.conditions)

    def fingerprint(self) -> str:
        """SHA-256 of the names and of every number of the families."""
        digest = hashlib.sha256(repr(self.names).encode())
        for f in fields(self.conditions):
            value = getattr(self.conditions, f.name)
            data = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
            digest.update(f"{f.name}:{len(data)};".encode() + data)
        return digest.hexdigest()

    def add(self, tally: Tally, first: int, Q: Array, engine: str) -> None:
        """Count the bounds at configurations Q (N, n) with numbers from ``first`` on."""
        tally.add(first, *self.bounds(Q, engine))

    def bounds(self, Q: Array, engine: str) -> tuple[Array, Array]:
        """Return the upper and lower bounds (N,) at configurations Q (N, n)."""
        compiled = engine != PINOCCHIO
        found = two_sided(
            self.conditions, Q, compiled=compiled, threads=1, isa=engine if compiled else None
        )
        return found.upper, found.lower

    def spread(self, tally: Tally, locate: Callable[[int], Array]) -> ClearanceSpread:
        """Turn a tally that has seen something into a result."""
        upper, lower = distributions(tally, locate)
        numbers = tally.worst_index.tolist()
        Q = np.stack([locate(i) for i in numbers])
        family = two_sided(self.conditions, Q).family
        rows = zip(numbers, Q, tally.worst_ratio, tally.worst_sigma, family, strict=True)
        return ClearanceSpread(
            families=self.names,
            complete=self.complete,
            lower=lower,
            upper=upper,
            nearest=tuple(
                ClearancePoint(i, q, float(low), float(high), self.names[k])
                for i, q, low, high, k in rows
            ),
        )


def put_clearance(record: Record, tally: Tally) -> None:
    """Put a tally of the clearance into the record of a chunk."""
    record.update({_PREFIX + name: array for name, array in tally.record().items()})


def clearance_part(record: Record) -> Record:
    """The arrays of the clearance of a record, under their plain names."""
    start = len(_PREFIX)
    return {name[start:]: a for name, a in record.items() if name.startswith(_PREFIX)}


def check_clearance(record: Record, worst: int, start: int, stop: int) -> None:
    """Raise a ValueError that says why the clearance of a record cannot be that of a chunk."""
    try:
        check_tally(clearance_part(record), worst, stop - start, start, stop, ratios=False)
    except ValueError as error:
        raise ValueError(f"of the clearance, {error}") from None


def clearance_room(worst: int, count: int) -> int:
    """Bytes that the clearance takes in a record at most."""
    return tally_room(worst, count) + 4096
