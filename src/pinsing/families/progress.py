"""How far a search by neighbouring axes went."""

from __future__ import annotations

from pinsing._dataclass import dataclass


@dataclass
class Progress:
    """What was looked at.

    Attributes
    ----------
    places : int
        Sets of joint values.
    waiting : int
        Places that there was no time for.
    unseen : int
        Systems of equations of which no real point was met.
    mixed : int
        Systems that hold at regular configurations too, and are stated with the rank.
    uncut : int
        Systems with a regular part that no minor of near joints cut.
    too_long : int
        Minors that were too long.
    """

    places: int = 0
    waiting: int = 0
    unseen: int = 0
    mixed: int = 0
    uncut: int = 0
    too_long: int = 0

    def gaps(self, n: int) -> list[str]:
        """What was left open in a chain of n joints, in sentences."""
        sets = "one set" if self.places == 1 else f"{self.places} sets"
        out = [
            f"for {n} joints only what neighbouring axes tell was looked for, at {sets} of joint "
            "values (the empty one is the general case); that nothing else is singular is not shown"
        ]
        if self.waiting:
            out.append(
                f"{self.waiting} more sets of joint values were waiting when the time was over: "
                "more time looks at them"
            )
        if self.unseen:
            out.append(f"no real point was met on {_systems(self.unseen)}, left out here")
        if self.uncut or self.too_long:
            out.append(f"{_systems(self.uncut + self.too_long)} could not be searched further")
        return out


def _systems(count: int) -> str:
    return "one system of equations" if count == 1 else f"{count} systems of equations"
