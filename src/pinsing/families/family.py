"""A family of singular configurations: equations, points, distance."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from pinsing._types import Array
from pinsing.algebra.components import Component
from pinsing.algebra.equation import Equation
from pinsing.arguments import checked, real_numbers, whole_number
from pinsing.bounds.conditions import Conditions
from pinsing.bounds.nearest import GAP, SECONDS, SearchOptions
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families.at_once import AtOnce
from pinsing.families.html import families_table, family_row
from pinsing.families.nearness import Distance, near, nearest
from pinsing.families.parts import Branch, KindPart
from pinsing.families.points import spread
from pinsing.families.solved_for import SolvedFor
from pinsing.families.zero_set import ROUNDS
from pinsing.measures import Reachability
from pinsing.robot.joint_space import JointSpace
from pinsing.serialization import JsonResult

_MOST_POINTS = 10_000_000


@dataclass(frozen=True, eq=False)
class Family(JsonResult):
    """A component of the singular set of an arm, joined with its mirror images.

    Attributes
    ----------
    name : str
        ``F1``, ``F2``, ... in the order of the closed form.
    text, latex : str
        The condition in one line.
    branches : tuple of Branch
        The pieces whose union the family is.
    joints : tuple of str
        Names, in the model, of the joints involved.
    codimension : int
        Number of joints minus the dimension at a generic real point.
    proof : str
        "algebra" if every minor was shown to vanish by division; "generic points" if that was
        decided at random points of every component, exactly, modulo a prime of 62 bits.
    real : bool
        Whether a real point is known.
    reachability : Reachability
        A text too: "reachable" (with ``witness``), "at the joint limit" (beyond it by less
        than the angle tolerance, as by a rounded 1.5708; see ``limits_met``), "not reachable"
        (proven), or "none found".
    limit_tolerance : (n,) array or None
        By how much the limits count as wider; None: by nothing.
    limits_met : tuple of str
        Limits that the family lies a little beyond, with both numbers.
    witness : (n,) array or None
        A configuration of the family inside the joint limits, wider by ``limit_tolerance`` where
        the family is at them.
    generic : (n,) array or None
        A generic configuration of it; the witness where there is one.
    rank : int or None
        Rank of the task Jacobian at the generic point.
    lost : tuple of str
        The motion lost there, in words.
    kind : str
        "boundary", "interior" or "undecided" where all points that were looked at agree; else
        "varies", and ``kinds`` says where, or how often.
    kinds : tuple of KindPart
        Each kind that was met.
    reason : str
        Which joint axes are dependent there, and why.
    raw_ratio : float or None
        Largest sigma_r / sigma_1 over sample points, on the geometry as given in the file;
        None where it agrees with the nominal one.
    lower, upper : (n,) arrays
        Joint limits.
    prismatic : (n,) array of bool
        Which joints slide.
    length_scale : float
        Metres.
    components : tuple of Component
        The same in exact polynomials of the half-angles; not written to JSON.
    solved : tuple of SolvedFor
        Its long equations, each solved for a joint that enters once.
    at_once : tuple of AtOnce
        Of several long equations that hold at once: which joints can be chosen, and how the
        others follow; empty where there are none.
    """

    schema: ClassVar[str] = "pinsing/family/1"
    made_by: ClassVar[str] = "pinsing.closed_form(arm).families"

    name: str
    text: str
    latex: str
    branches: tuple[Branch, ...]
    joints: tuple[str, ...]
    codimension: int
    proof: str
    real: bool
    reachability: Reachability
    witness: Array | None
    generic: Array | None
    rank: int | None
    lost: tuple[str, ...]
    kind: str
    reason: str
    raw_ratio: float | None
    lower: Array
    upper: Array
    prismatic: npt.NDArray[np.bool_]
    length_scale: float
    kinds: tuple[KindPart, ...] = ()
    limit_tolerance: Array | None = None
    limits_met: tuple[str, ...] = ()
    components: tuple[Component, ...] = field(default=(), repr=False, metadata={"json": False})
    solved: tuple[SolvedFor, ...] = field(default=(), metadata={"optional": True})
    at_once: tuple[AtOnce, ...] = field(default=(), metadata={"optional": True})

    def __getstate__(self) -> dict[str, Any]:
        # Exact polynomials live in a ring of this process: like JSON, pickles go without them.
        return {**self.__dict__, "components": ()}

    @property
    def n(self) -> int:
        """Number of joints of the arm."""
        return len(self.lower)

    @cached_property
    def space(self) -> JointSpace:
        """Its joints alone, by number: limits, metric, values at random."""
        names = tuple(f"q{i + 1}" for i in range(self.n))
        return JointSpace(names, self.prismatic, self.lower, self.upper, self.length_scale)

    @property
    def is_reachable(self) -> bool | None:
        """True, False (proven), or None if no point within the limits was found."""
        return self.reachability.known

    @property
    def equations(self) -> tuple[Equation, ...]:
        """All equations of all branches; each is callable on arrays q (..., n)."""
        return tuple(e for b in self.branches for e in b.equations)

    @property
    def values(self) -> tuple[dict[int, float], ...]:
        """Fixed joint values of each branch, by joint index."""
        return tuple({v.joint: v.value for v in b.values} for b in self.branches)

    @checked
    def contains(self, q: npt.ArrayLike, tol: float = 1e-6) -> npt.NDArray[np.bool_]:
        """Tell for q (..., n) whether a point of the family is within ``tol`` of it.

        Revolute joints count modulo whole turns; limits are not considered.

        Parameters
        ----------
        q : (..., n) array_like
            Radians and metres.
        tol : float
            Distance in joint space (radians; metres over the length scale).

        Returns
        -------
        (...) array of bool
            True where the family is that near.

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite.

        Examples
        --------
        >>> import pinsing
        >>> wrist = pinsing.closed_form(pinsing.load("stanford")).families[2]  # q5 = 0, 180°
        >>> wrist.contains([[0, 1, 0.3, 1, 0, 0], [0, 1, 0.3, 1, 0.1, 0]])
        array([ True, False])
        """
        q = self._check(q)
        found = near(self.branches, self.space, q.reshape(-1, self.n), tol)
        return found.reshape(q.shape[:-1])

    @checked
    def distance(
        self,
        q: npt.ArrayLike,
        *,
        gap: float = GAP,
        seconds: float = SECONDS,
        within_limits: bool = False,
        weights: npt.ArrayLike | None = None,
        norm: str = "euclidean",
    ) -> Distance:
        """Distance from q (n,) to the family, with a proven lower bound, and the nearest point.

        Exact for families of joint values. Where equations are involved, boxes of
        configurations are ruled out by Taylor's theorem until the bounds are within ``gap``, or
        the time is over: then what was reached is returned.

        Parameters
        ----------
        q : (n,) array_like
            Radians and metres.
        gap : float
            Largest ``upper - lower`` at which the search ends by itself.
        seconds : float
            Time for the search.
        within_limits : bool
            Whether only configurations within the joint limits count, wider by
            ``limit_tolerance`` where the family is only at them; then revolute
            differences are not wrapped, and joints that do not matter to the family but are
            outside their limits count as well. The answer is infinite where there are none.
        weights : (n,) array_like, optional
            What joint differences are multiplied by, instead of 1 for revolute joints and
            1 / length scale for prismatic ones.
        norm : str
            "euclidean", or "max" for the largest weighted difference of a joint.

        Returns
        -------
        Distance
            ``lower`` and ``upper`` bounds, and the nearest point ``q`` (n,).

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite, or no real point is known at all.
        OptionError
            If an option makes no sense.

        Examples
        --------
        >>> import pinsing
        >>> wrist = pinsing.closed_form(pinsing.load("stanford")).families[2]  # q5 = 0, 180°
        >>> wrist.distance([0, 1, 0.3, 1, 0.25, 0]).value
        0.25
        """
        q = self._check(q)
        if q.ndim != 1:
            raise ConfigurationError(f"distance takes one configuration, got shape {q.shape}")
        options = SearchOptions(gap, seconds, within_limits)
        exact = all(not b.equations for b in self.branches)
        found = nearest(self.conditions(weights, norm), q, self.limits, options, exact)
        if found is None:
            raise ConfigurationError(f"family {self.name}: no real point was found on it")
        return found

    @checked
    def conditions(
        self, weights: npt.ArrayLike | None = None, norm: str = "euclidean"
    ) -> Conditions:
        """What holds on the family, as flat arrays that bounds are computed with.

        Parameters
        ----------
        weights, norm
            As in ``distance``.

        Returns
        -------
        Conditions
            Flat arrays of this family alone.

        Raises
        ------
        OptionError
            If an option makes no sense.
        """
        if weights is None and norm == "euclidean":
            return self._conditions
        weight = 1.0 / self.space.metric if weights is None else real_numbers(weights, "weights")
        if weight.shape != (self.n,):
            raise OptionError(f"weights needs {self.n} numbers, got shape {weight.shape}")
        return Conditions.of([self.branches], self.prismatic, weight, norm)

    @cached_property
    def _conditions(self) -> Conditions:
        return Conditions.of([self.branches], self.prismatic, 1.0 / self.space.metric)

    @checked
    def sample(self, n: int, rng: np.random.Generator) -> Array:
        """Configurations of the family inside the joint limits, to rounding (1e-9).

        Where the family is only at the joint limit, limits are wider by ``limit_tolerance``.

        Parameters
        ----------
        n : int
            How many.
        rng : np.random.Generator
            Where they are drawn from.

        Returns
        -------
        (k, n) array
            k is ``n``, or less (down to 0) where ``n`` were not found; ``reachability``
            says whether that there are none is proven.

        Raises
        ------
        OptionError
            If ``n`` is negative.

        Examples
        --------
        >>> import numpy as np, pinsing
        >>> family = pinsing.closed_form(pinsing.load("stanford")).families[0]
        >>> Q = family.sample(5, np.random.default_rng(0))
        >>> Q.shape, bool(family.contains(Q).all())
        ((5, 6), True)
        """
        return self.points(n, rng, within_limits=True)

    @checked
    def points(
        self,
        n: int,
        rng: np.random.Generator,
        within_limits: bool = False,
        rounds: int = ROUNDS,
    ) -> Array:
        """Configurations of the family, over whole circles unless ``within_limits``.

        Parameters
        ----------
        n : int
            How many.
        rng : np.random.Generator
            Where they are drawn from.
        within_limits : bool
            Whether only configurations within the joint limits count, as in ``sample``.
        rounds : int
            Number of batches of random starts after which a branch is given up.

        Returns
        -------
        (k, n) array
            k is ``n``, or less (down to 0) where ``n`` were not found. Sliding joints leave their
            limits where no point is found otherwise.

        Raises
        ------
        OptionError
            If ``n`` is negative.

        Examples
        --------
        >>> import numpy as np, pinsing
        >>> family = pinsing.closed_form(pinsing.load("ur5")).families[2]
        >>> Q = family.points(5, np.random.default_rng(0))
        >>> bool(abs(family.equations[0](Q)).max() < 1e-9)
        True
        """
        whole_number(n, "n", 0, _MOST_POINTS)
        if n == 0 or (within_limits and self.reachability is Reachability.OUTSIDE):
            return np.zeros((0, self.n))
        lower, upper = self.box(within_limits)
        box = (lower, upper) if within_limits else None
        usable = [(b, v) for b in self.branches for v in b.held(self.space, box)]
        for widen in (0.0, 1.0, 10.0):  # sliders may have to leave their limits
            far = np.where(self.prismatic, widen * self.length_scale, 0.0)
            found = spread(usable, lower - far, upper + far, n, rng, rounds)
            if len(found) or within_limits or not self.prismatic.any():
                break
        return found

    @checked
    def box(self, within_limits: bool) -> tuple[Array, Array]:
        """Range of each joint that points are drawn from: the limits, or whole circles.

        Where a limit is infinite, a whole turn (or two length scales) from the other one.

        Parameters
        ----------
        within_limits : bool
            The limits, instead of whole circles.

        Returns
        -------
        (n,) array, (n,) array
            Lower and upper ends, radians and metres.
        """
        lower, upper = self.space.range(not within_limits)
        if within_limits and self.limit_tolerance is not None:
            return lower - self.limit_tolerance, upper + self.limit_tolerance
        return lower, upper

    @property
    def limits(self) -> tuple[Array, Array]:
        """Limits (n,) that count for this family: those of the joints, perhaps a little wider.

        Wider by ``limit_tolerance`` where the family is "at the joint limit"; infinite for
        continuous joints.
        """
        if self.limit_tolerance is None:
            return self.lower, self.upper
        return self.lower - self.limit_tolerance, self.upper + self.limit_tolerance

    def __str__(self) -> str:
        return f"{self.name}: {self.text}"

    def _repr_latex_(self) -> str:
        """For notebooks."""
        return f"$${self.latex}$$"

    def _repr_html_(self) -> str:
        """For notebooks, which prefer it: the equations typeset, and what else is known."""
        involved = sorted({j for b in self.branches for j in b.involved})
        symbols = [f"{'d' if self.prismatic[j] else 'q'}{j + 1}" for j in involved]
        return families_table([html_row(self)], zip(symbols, self.joints, strict=False))

    def _check(self, q: npt.ArrayLike) -> Array:
        array = real_numbers(q, "q")
        if array.ndim == 0 or array.shape[-1] != self.n:
            raise ConfigurationError(
                f"q needs {self.n} values, got shape {array.shape}; arm.q_of(q) takes them out of "
                "a whole model's configuration",
                lengths=(self.n,),
            )
        if not np.isfinite(array).all():
            raise ConfigurationError("q has a value that is not finite")
        return array


def html_row(family: Family) -> tuple[str, ...]:
    """Its cells in a table of families."""
    varies = family.kind == "varies"
    kind = "; ".join(str(part) for part in family.kinds) if varies else family.kind
    short = family.text if family.solved or "terms]" in family.text else ""
    return family_row(family.name, family.latex, short, kind, family.reachability, family.reason)
