"""What became of the search for a certificate, as it stands on a closed form."""

from __future__ import annotations

from dataclasses import field
from typing import Any

from pinsing._dataclass import dataclass


@dataclass(frozen=True)
class Proof:
    """What became of the search for a certificate.

    Attributes
    ----------
    accepted : bool
        Whether there is one, and the checker accepted it.
    reason : str
        Why there is none; empty where there is.
    size : int
        Bytes of the certificate; 0 if there is none.
    places : int
        Case splits and what ends them.
    seconds : float
        Time that finding it took.
    check_seconds : float
        Time that the checker took.
    primes : tuple of int
        Primes modulo which the families were found: what rests on, where there is none.
    certificate : dict or None
        It; not written to JSON with the rest, but to a file of its own.
    out_of_time : bool
        Whether there is none because the search was stopped; more time may find one.
    """

    accepted: bool
    reason: str
    size: int
    places: int
    seconds: float
    check_seconds: float
    primes: tuple[int, ...]
    certificate: dict[str, Any] | None = field(default=None, repr=False, metadata={"json": False})
    out_of_time: bool = field(default=False, metadata={"optional": True})
