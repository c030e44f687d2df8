"""cuspidality: whether two inverse solutions of one pose are joined without a singularity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import ClassVar

import numpy as np

from pinsing.arguments import MAX_SEED, checked, typed, whole_number
from pinsing.errors import OptionError
from pinsing.families import ClosedForm, closed_form
from pinsing.kinematics.batch import picked, turn_left
from pinsing.kinematics.inverse import inverse
from pinsing.kinematics.jacobian import tip_placement
from pinsing.kinematics.ladder import ladder_of
from pinsing.kinematics.newton import one_sheet, regular_way
from pinsing.kinematics.verdict import generic_rank, ratios
from pinsing.measures import PRACTICAL, ROUNDING, Array
from pinsing.postures.aspects import PROVEN, aspects, missing, nearly
from pinsing.postures.connection import SAME, Connection, connect
from pinsing.proximity.watched import require_forms_of
from pinsing.robot.arm import Arm, ArmSummary, summarize
from pinsing.robot.nominal import nominal
from pinsing.serialization import JsonResult

POSES = 60

CUSPIDAL, NOT_CUSPIDAL, NO_EVIDENCE = "cuspidal", "not cuspidal", "no evidence"


_WITNESS = (
    "two inverse solutions of one pose are joined by a path on which no configuration is singular"
)
_CLEAR = "two inverse solutions of one pose are joined by a path that meets no family"
_THIN = (
    "the path is so near to singular configurations that a bound of how fast the Jacobian changes "
    "does not clear it; the equations of the closed form do"
)
_RANK = (
    "the rank along the path is proven from the Jacobian of the arm itself, with a bound of how "
    "fast it changes; no closed form is needed for that"
)


@dataclass(frozen=True, eq=False)
class Cuspidality(JsonResult):
    """Whether an arm can change its posture without meeting a singularity.

    Attributes
    ----------
    arm : ArmSummary
        The arm.
    answer : str
        "cuspidal": by ``witness``, or by ``reason``. "not cuspidal": proven, by ``reason``.
        "no evidence": nothing was found at ``poses`` poses.
    proven : bool
        Whether the answer is: a witness by its Jacobian alone, or by the certificate of a closed
        form that is complete.
    reason : str
        Why.
    witness : Connection or None
        Two inverse solutions of one pose, and a way from one to the other on which no
        configuration is singular.
    pose_error : float
        How much their poses differ, metres and radians; NaN without a witness.
    least_ratio : float
        Least sigma_r / sigma_1 at points of the way; NaN without.
    aspects : int or None
        Aspects without joint limits, where their count is proven.
    most_solutions : int
        Regular inverse solutions of one pose, at most, that were met.
    poses : int
        Poses that were looked at.
    notes : tuple of str
        What the answer rests on.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.cuspidality(pinsing.load("puma560"), poses=5).answer
    'not cuspidal'
    """

    schema: ClassVar[str] = "pinsing/cuspidality/1"
    made_by: ClassVar[str] = "pinsing.cuspidality(arm)"

    arm: ArmSummary
    answer: str
    proven: bool
    reason: str
    witness: Connection | None
    pose_error: float
    least_ratio: float
    aspects: int | None
    most_solutions: int
    poses: int
    notes: tuple[str, ...]

    @checked
    def text(self, degrees: bool = False) -> str:
        """Return the answer in lines of text.

        Parameters
        ----------
        degrees : bool
            Angles in degrees.

        Examples
        --------
        >>> import pinsing
        >>> found = pinsing.cuspidality(pinsing.load("puma560"), poses=3)
        >>> print(found.text().splitlines()[0][:59])
        puma560: not cuspidal, proven: three axes of the wrist meet
        """
        name = self.arm.name
        if self.answer == CUSPIDAL:
            lines = [f"{name}: cuspidal, {'' if self.proven else 'not '}proven: {self.reason}"]
        elif self.answer == NOT_CUSPIDAL:
            lines = [f"{name}: not cuspidal, proven: {self.reason}"]
        else:
            none = f"{name}: no evidence in {self.poses} poses that the arm is cuspidal"
            lines = [none, self.reason]
        if self.witness is not None and self.witness.path is not None:
            lines.append(
                f"path of {len(self.witness.path)} waypoints; poses differ by "
                f"{self.pose_error:.1e}; least sigma_r/sigma_1 on it {self.least_ratio:.3g}:"
            )
            prismatic = self.arm.prismatic
            lines += [f"  {typed(q, prismatic, degrees, digits=10)}" for q in self.witness.path]
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])


@checked
def cuspidality(
    arm: Arm, *, forms: ClosedForm | None = None, poses: int = POSES, seed: int = 0
) -> Cuspidality:
    """Look whether an arm is cuspidal: two regular inverse solutions of a pose in one aspect.

    Joint limits do not count (Wenger, 1992). That an arm is not cuspidal is proven where its
    inverse solution goes step by step, each with two answers that a sign tells apart
    (`pinsing.kinematics.ladder`), or where no point has more than two solutions.
    Poses are those of random configurations; of each
    all inverse solutions are found and told apart by their aspects. Where two share one, a way
    is found and proven to be regular throughout (`pinsing.kinematics.newton`); that is a
    witness. With fewer joints than a pose has conditions regular means that the rank is the number
    of joints; the tip must then be able to leave in the same directions from both ends. Where a
    pose has more regular solutions than there are aspects, two must share one; that is a reason
    without a way.

    Parameters
    ----------
    arm : Arm
        A serial arm with as many joints as its task has conditions.
    forms : ClosedForm, optional
        Of the arm, if at hand.
    poses : int
        Random poses.
    seed : int
        Of the poses.

    Returns
    -------
    Cuspidality
        An answer that is proven, or how many poses gave none.

    Raises
    ------
    OptionError
        If joints and conditions do not agree in number, or the form is of another arm.

    Examples
    --------
    >>> import pinsing
    >>> pinsing.cuspidality(pinsing.load("ur5"), poses=3).proven
    True
    """
    whole_number(poses, "poses", 1, 1_000_000)
    whole_number(seed, "seed", 0, MAX_SEED)
    rank = generic_rank(arm)
    OptionError.refuse_if(
        arm.n != rank,
        f"{arm.name} has {arm.n} joints and task {arm.task} {rank} conditions: whether an arm "
        "is cuspidal is asked where they are as many: choose joints or a task of pinsing.load",
    )
    if forms is not None:
        require_forms_of(forms, arm)
    form = closed_form(arm) if forms is None else forms
    found = aspects(form, limits=False)
    rng, notes = np.random.default_rng(seed), missing(form)
    sure = form.word == PROVEN
    most, tried, crowded = 0, 0, ""
    none = Cuspidality(
        arm=summarize(arm),
        answer=NO_EVIDENCE,
        proven=False,
        reason="no two inverse solutions are known to share an aspect",
        witness=None,
        pose_error=np.nan,
        least_ratio=np.nan,
        aspects=found.lower if found.proven else None,
        most_solutions=0,
        poses=poses,
        notes=tuple(notes),
    )
    for k, q in enumerate(arm.space.sample(poses, rng, True)):
        known = inverse(arm, tip_placement(arm, q).homogeneous, seed=seed, near=q)
        regular = [(found.of(s.q), s.q) for s in known if s.regular]
        most = max(most, len(regular))
        for (place, a), (other, b) in combinations(regular, 2):
            if place is None or place != other:
                continue
            tried += 1
            way = connect(form, a, b, limits=False, of=found)
            if way.answer != SAME or way.path is None:
                continue
            error, least = _checked(arm, way.path)
            if error > ROUNDING or not _ends(arm, way.path):
                continue
            if proven := regular_way(arm, way.path):
                reason, said = _WITNESS, [_RANK, *[_few(arm, error)] * (arm.n < len(arm.task.rows))]
            elif least < PRACTICAL:
                # Too thin for the bound: the families stand for it, by their certificate.
                proven, reason, said = sure, _CLEAR, [_THIN, *([] if sure else notes)]
            else:
                continue
            return replace(
                none, answer=CUSPIDAL, proven=proven, reason=reason, witness=way, pose_error=error,
                least_ratio=least, most_solutions=most, poses=k + 1,
                notes=(*said, *nearly(arm, least)),
            )  # fmt: skip
        if found.proven and nominal(arm).exact and known.certified > found.lower:
            crowded = (
                f"a pose has {known.certified} regular inverse solutions, each proven to exist, "
                f"and there are {found.lower} aspects: two of them share one"
            )
    none = replace(none, most_solutions=most)
    if crowded:
        said = [] if sure else notes
        return replace(none, answer=CUSPIDAL, proven=sure, reason=crowded, notes=tuple(said))
    if (ladder := ladder_of(nominal(arm))) is not None:
        # This stands on the chain alone, and not on the closed form.
        said = [] if nominal(arm).exact else ["this is about the nominal geometry"]
        return replace(
            none, answer=NOT_CUSPIDAL, proven=True, reason=ladder.reason, notes=tuple(said)
        )
    if tried:
        reason = f"{tried} pairs of solutions share an aspect, and no path was found"
        return replace(none, reason=reason)
    if found.proven:
        reason = (
            f"of each pose all inverse solutions are in different ones of {found.lower} aspects"
        )
        return replace(none, reason=reason)
    return none


def _ends(arm: Arm, path: Array) -> bool:
    apart = float(np.abs(arm.space.wrap(path[-1] - path[0])).max())
    return apart > 1e-3 and one_sheet(arm, path[0], path[-1])


def _few(arm: Arm, error: float) -> str:
    return (
        f"with {arm.n} joints regular means rank {arm.n}, and the tip has only the poses that "
        f"these reach; it can leave in the same {arm.n} directions from both ends, so this is no "
        "chance crossing of two sheets of poses; that the ends have one pose rests on numbers: "
        f"they differ by {error:.1e}, and no step could take away a difference in other directions"
    )


def _checked(arm: Arm, path: Array) -> tuple[float, float]:
    """Return how much the poses at the ends differ, and the least sigma_r / sigma_1 on the way."""
    first, last = (tip_placement(arm, q) for q in (path[0], path[-1]))
    R = np.array(first.rotation)
    turned = turn_left(arm.task, R[None], np.array(last.rotation))[0]
    apart = np.abs(
        picked(arm.task, np.append(last.translation - first.translation, turned)[:, None], R)
    )
    share = np.linspace(0, 1, max(2, 400 // len(path)))[:, None]
    fine = np.concatenate([a + share * (b - a) for a, b in pairwise(path)])
    return float(apart.max()), float(ratios(arm, fine).min())
