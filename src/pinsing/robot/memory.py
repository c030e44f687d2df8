"""What follows from the fields of a frozen object, kept with it once it was computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any, TypeVar, cast

from pinsing._dataclass import dataclass

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Memory:
    """Mixin of frozen dataclasses: one place for what other modules have computed of them.

    Attributes
    ----------
    known : dict
        By name; no part of what `dataclasses.replace` copies.
    """

    known: dict[str, Any] = field(
        default_factory=dict, init=False, repr=False, metadata={"json": False}
    )

    def __getstate__(self) -> dict[str, Any]:
        # What was computed may hold functions, and is computed again where it is wanted.
        return {**self.__dict__, "known": {}}

    def once(self, name: str, compute: Callable[[], T]) -> T:
        """Compute what depends on the fields alone the first time; later take it from `known`.

        Parameters
        ----------
        name : str
            What it is kept under.
        compute : callable
            Called without arguments, the first time.
        """
        if name not in self.known:
            self.known[name] = compute()
        return cast("T", self.known[name])
