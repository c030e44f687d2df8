"""Singular loci over the pose of the output, as data."""

from __future__ import annotations

from dataclasses import field
from typing import ClassVar

from pinsing._dataclass import dataclass
from pinsing.loops.every_position import PoseFamily
from pinsing.loops.joint_forms import JointForms
from pinsing.loops.pose_equation import PoseEquation
from pinsing.serialization import JsonResult


@dataclass(frozen=True, eq=False)
class PoseLocus:
    """One irreducible locus.

    Attributes
    ----------
    kind : str
        ``type 1``, ``type 2``, ``constraint`` or ``type 2 or constraint``.
    words : str
        What the lines of the legs do there.
    equation : PoseEquation
        Zero exactly there, on poses that the mechanism has with the inputs that they need.
    real : bool
        Whether the equation changes its sign over real poses, or is a sum of squares with real
        zeros; otherwise it is zero at isolated or no real ones, as far as was looked.
    """

    kind: str
    words: str
    equation: PoseEquation
    real: bool

    def __str__(self) -> str:
        none = "" if self.real else " [no real points found]"
        return f"{self.kind}, {self.words}: {self.equation}{none}"


@dataclass(frozen=True, eq=False)
class PoseForms(JsonResult):
    """All singular loci of a mechanism over the pose of its output.

    Attributes
    ----------
    variables : tuple of str
        In which the equations are.
    architecture : str
        Why every pose is singular; empty where not.
    loci : tuple of PoseLocus
        Irreducible over the rationals (or those with the root of 3).
    everywhere : tuple of PoseFamily
        Orientations at which every position is singular; parts of the loci, said by themselves.
    level : tuple of PoseLocus
        The type 2 loci with the output turned as at home, where that is not turned at all.
    complete : bool
        Whether every singular pose is on one of the loci, but for legs without length and passive
        joints that move by themselves, which the notes name.
    notes : tuple of str
        What was assumed, and what else must hold.
    inputs : tuple of PoseLocus
        Type 2 over the inputs alone, the pose eliminated, where that was done: at inputs on it two
        poses of the output meet, real or complex ones.
    closing : tuple of PoseEquation
        What a pose and inputs that close the loops fulfil, where the loci are in both together:
        the lengths of the rods, and the planes that hinges keep their ends in.
    joint_forms : JointForms or None
        Those in the joint angles, which ``families --loops --json`` writes with them; elsewhere
        they are asked for by themselves, with `joint_forms`.
    """

    schema: ClassVar[str] = "pinsing/pose-forms/1"

    variables: tuple[str, ...]
    architecture: str
    loci: tuple[PoseLocus, ...]
    everywhere: tuple[PoseFamily, ...]
    level: tuple[PoseLocus, ...]
    complete: bool
    notes: tuple[str, ...]
    inputs: tuple[PoseLocus, ...] = field(default=(), metadata={"optional": True})
    closing: tuple[PoseEquation, ...] = field(default=(), metadata={"optional": True})
    joint_forms: JointForms | None = field(default=None, metadata={"optional": True})

    def __str__(self) -> str:
        lines = [self.architecture] if self.architecture else []
        lines += [str(x) for x in (*self.loci, *self.everywhere, *self.inputs)]
        return "\n".join([*lines, *self.notes])
