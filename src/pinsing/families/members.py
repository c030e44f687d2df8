"""Which configurations belong to a family: tests, distances, samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pinsing._types import Array, Bool
from pinsing.algebra.conditions import Conditions
from pinsing.algebra.nearest import GAP, SECONDS, SearchOptions
from pinsing.arguments import checked, columns_of, real_numbers, whole_number
from pinsing.errors import ConfigurationError, OptionError
from pinsing.families.nearness import ON, Confirm, Distance, Starts, near, nearest, own_nearest
from pinsing.families.parts import Branch
from pinsing.families.zero_set import ROUNDS, Stop, search
from pinsing.measures import Reachability
from pinsing.robot.arm import Arm
from pinsing.robot.joint_space import JointSpace, require_values


def spread(
    held: Sequence[tuple[Branch, Array]],
    lower: Array,
    upper: Array,
    count: int,
    rng: np.random.Generator,
    rounds: int,
    stop: Stop | None = None,
) -> Array:
    """Up to ``count`` points (k, n) in a box, about as many of each branch.

    Parameters
    ----------
    held : sequence of (Branch, (n,) array)
        Branches with the values of their fixed joints.
    lower, upper : (n,) arrays
        The box.
    count : int
        How many.
    rng : np.random.Generator
        Where they are drawn from.
    rounds : int
        Number of batches of random starts after which a branch is given up.
    stop : callable, optional
        As in ``search``.
    """
    alive = [held[i] for i in rng.permutation(len(held))]
    parts = [np.zeros((0, len(lower)))]
    missing = count
    for _ in range(4):  # what one branch lacks, the others give in the next pass
        share = np.full(len(alive), missing // max(1, len(alive)))
        share[: missing - share.sum()] += 1
        for (branch, fixed), some in zip(tuple(alive), share, strict=True):
            if some == 0:
                continue
            free = np.ones(len(lower), dtype=bool)
            free[[v.joint for v in branch.values]] = False
            part = search(branch.equations, lower, upper, free, fixed, int(some), rng, rounds, stop)
            parts.append(part)
            missing -= len(part)
            if not len(part):
                alive = [a for a in alive if a[1] is not fixed or a[0] is not branch]
        if missing == 0 or not alive or (stop is not None and stop()):
            break
    return np.concatenate(parts)


_AGAIN = 3
"""Times that points are looked for again, where some were not the family's own; or in vain."""


class Members:
    """The set of configurations that a family is, made of its branches.

    Attributes
    ----------
    name, branches, reachability, limit_tolerance, lower, upper, prismatic, length_scale, confirm
        As ``Family`` has them.
    arm : Arm or None
        The arm, where it is known.
    """

    name: str
    branches: tuple[Branch, ...]
    reachability: Reachability
    limit_tolerance: Array | None
    lower: Array
    upper: Array
    prismatic: npt.NDArray[np.bool_]
    length_scale: float
    arm: Arm | None
    confirm: Confirm | None

    @property
    def n(self) -> int:
        """Number of joints of the arm."""
        return len(self.lower)

    @cached_property
    def space(self) -> JointSpace:
        """Its joints alone, by number: limits, metric, values at random."""
        names = tuple(f"q{i + 1}" for i in range(self.n))
        return JointSpace(names, self.prismatic, self.lower, self.upper, self.length_scale)

    @checked
    def contains(self, q: npt.ArrayLike, tol: float = 1e-6) -> npt.NDArray[np.bool_]:
        """Tell for q (..., n) whether a point of the family is within ``tol`` of it.

        Revolute joints count modulo whole turns; limits are not considered.

        Parameters
        ----------
        q : (..., n) or (..., nq) array_like
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
        found = near(self.branches, self.space, q.reshape(-1, self.n), tol, self.confirm)
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
        q : (n,) or (nq,) array_like
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
        if self.confirm is None or within_limits or weights is not None or norm != "euclidean":
            return found
        return own_nearest(found, self.branches, self.space, q, self.confirm)

    @checked
    def gradient(self, q: npt.ArrayLike) -> Array:
        """Gradient (n,) of the distance from q (n,) to the family: the way that leads off it.

        Parameters
        ----------
        q : (n,) or (nq,) array_like
            Radians and metres.

        Returns
        -------
        (n,) array
            Radians (metres over the length scale) per radian or metre; zero on the family.

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite, or no real point is known at all.

        Examples
        --------
        >>> import pinsing
        >>> wrist = pinsing.closed_form(pinsing.load("stanford"))["wrist"]  # q5 = 0, 180°
        >>> wrist.gradient([0, 1, 0.3, 1, -0.25, 0])
        array([ 0.,  0.,  0.,  0., -1.,  0.])
        """
        q = self._check(q)
        away = self.space.wrap(q - self.distance(q).q) / self.space.metric
        size = float(np.linalg.norm(away))
        return away / self.space.metric / size if size > ON else np.zeros(self.n)

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
            k is ``n``, or less (down to 0) where a bounded number of random starts did not find
            ``n``: compare ``len`` with ``n``. ``reachability`` says whether that there are none is
            proven. Where the equations alone hold at regular points as well, as of long chains,
            only singular points are taken, so that k is less more often.

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
        stop: Callable[[], bool] | None = None,
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
        stop : callable, optional
            Asked now and then; once it returns True the search ends with what it has. A first look
            at short equations is taken all the same.

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
        whole_number(n, "n", 0, 10_000_000)
        if n == 0 or (within_limits and self.reachability is Reachability.OUTSIDE):
            return np.zeros((0, self.n))
        lower, upper = self.box(within_limits)
        box = (lower, upper) if within_limits else None
        usable = [(b, v) for b in self.branches for v in b.held(self.space, box)]
        below, above = self._loose_ends(within_limits)
        for widen in (0.0, 1.0, 10.0):  # sliders may have to leave their limits
            far = widen * self.length_scale
            low, high = lower - far * below, upper + far * above
            found = self._own(spread(usable, low, high, n, rng, rounds, stop))
            if len(found) < n and self.confirm is not None:
                starts = Starts(usable, self.space, low, high, within_limits)
                more = starts.own(self.confirm, n - len(found), rng, stop)
                found = np.concatenate([found, more])
            idle = 0
            # The same where nothing limits the time.
            again = _AGAIN if stop is not None else 40
            for _ in range(again if len(found) and self.confirm is not None else 0):
                if len(found) == n or idle == _AGAIN or (stop is not None and stop()):
                    break
                more = self._own(spread(usable, low, high, n, rng, rounds, stop))
                idle = 0 if len(more) else idle + 1
                found = np.concatenate([found, more])[:n]
            if len(found) or not (below.any() or above.any()):
                break
        return self._sharpened(found, within_limits)

    def _sharpened(self, points: Array, within_limits: bool) -> Array:
        """Its own points (k, n) to all digits, without those that leave the limits for that."""
        if self.confirm is None or not len(points):
            return points
        free = np.ones(self.n, dtype=bool)
        free[[v.joint for branch in self.branches for v in branch.values]] = False
        sharp = self.confirm.sharpened(points, free)
        stays = near(self.branches, self.space, sharp, ON)  # else another singular set is near
        sharp = np.where(stays[:, None], sharp, points)
        if not within_limits:
            return sharp
        lower, upper = self.limits
        return sharp[((sharp >= lower - 1e-9) & (sharp <= upper + 1e-9)).all(axis=-1)]

    def _loose_ends(self, within_limits: bool) -> tuple[Bool, Bool]:
        """Which sliders may go on below and above the range that points are drawn from."""
        if not within_limits:
            return self.prismatic, self.prismatic
        below, above = np.isinf(self.lower), np.isinf(self.upper)
        return self.prismatic & below, self.prismatic & above

    def _own(self, points: Array) -> Array:
        """Those of some points (N, n) of the equations that are the family's own."""
        if self.confirm is None or not len(points):
            return points
        return np.asarray(points[self.confirm(points)])

    @checked
    def box(self, within_limits: bool) -> tuple[Array, Array]:
        """Range of each joint that points are drawn from: the limits, or whole circles.

        Where a limit is infinite, a whole turn (or two length scales) from the other one; a slider
        without a limit goes as far beyond as a value takes it that a branch fixes it at.

        Parameters
        ----------
        within_limits : bool
            The limits, instead of whole circles.

        Returns
        -------
        (n,) array, (n,) array
            Lower and upper ends, radians and metres.
        """
        lower, upper = (np.array(end) for end in self.space.range(not within_limits))
        below, above = self._loose_ends(within_limits=True)
        for value in (v for branch in self.branches for v in branch.values):
            j = value.joint
            if below[j]:
                lower[j] = min(lower[j], value.value - self.length_scale)
            if above[j]:
                upper[j] = max(upper[j], value.value + self.length_scale)
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

    def _check(self, q: npt.ArrayLike) -> Array:
        if self.arm is not None:
            return self.arm.check(q)
        array = real_numbers(columns_of(q, self.space.names, "q"), "q")
        require_values(array, self.space.names, "q")
        return array
