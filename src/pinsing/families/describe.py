"""From components to their real pieces, and to families with points, limits, kinds and words.

Configurations that show a family well, and the name that a roboticist gives it: wrist, elbow,
shoulder, decided from the geometry.

Only the full pose is named, and only where the geometry makes each condition below singular. With
C the wrist center:

- six joints whose axes 4, 5, 6 meet in one point C (spherical wrist), or whose axes 2, 3, 4 are
  parallel while axes 5 and 6 meet in C (offset wrist, as of a UR5): *wrist* where axes 4, 5 and 6
  are parallel to one plane, so that axes 4 and 6 line up in all usual wrists;
- if also axes 2 and 3 are parallel and axis 1 is not: *elbow* where C (with an offset wrist, axis
  4) lies in the plane of axes 2 and 3, with the links stretched or folded; *shoulder* where C lies
  in the plane through axis 1 parallel to axis 2, above axis 1 where the arm has no lateral offset.
  A prismatic third joint at right angles to axis 2 has a shoulder, and no elbow;
- seven revolute joints, of which the first three meet in S and the last three in C: *shoulder*
  and *wrist* where the three axes are parallel to one plane, *elbow* where S, C and axis 4 are in
  one plane.

A family has the name of the one condition that holds all over it, else none: two conditions at
once are no name. Legs have no names: their joints are hips, knees and ankles.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from pinsing.algebra.budget import Budget, BudgetExceeded
from pinsing.algebra.components import Component, inside
from pinsing.algebra.conditions import Branch, Conditions, JointValue, two_sided
from pinsing.algebra.equation import (
    Equation,
    angles_text,
    equation,
    scale_to_lengths,
    symbol_text,
)
from pinsing.algebra.real_roots import (
    AlgebraicValue,
    NotFinite,
    Solution,
    changes_sign,
    isolated_zeros,
    real_roots,
    real_solutions,
)
from pinsing.algebra.ring import MadeOnce, Poly, Ring, Value
from pinsing.families.at_once import LONG, at_once, long_form, long_ones, rank_of
from pinsing.families.family import Family, KindPart, values_reached
from pinsing.families.zero_set import (
    ROUNDS,
    OwnPoints,
    SearchBox,
    fix_joint,
    near,
    never_zero,
    none_within,
    project,
    proven_empty,
    search,
    system_of,
    thrown,
)
from pinsing.kinematics.at import Loss, State, loss_at
from pinsing.kinematics.jacobian import PINOCCHIO, Batch, generic_rank, own_shares, ratios
from pinsing.kinematics.lost_motion import STRUCTURE_TOL, JointAxes, arm_centres, generic_axes
from pinsing.kinematics.refine import kinds_many
from pinsing.measures import ALIKE, SEED, Array, Reachability
from pinsing.prose import listed
from pinsing.robot.arm import Arm, kept
from pinsing.robot.mimic import own_rows
from pinsing.robot.nominal import Nominal


def joint_symbols(arm: Arm) -> tuple[str, ...]:
    """Return q1, q2, d3, ...: the joint's number from the base, d for prismatic joints."""
    return tuple(f"{'d' if s else 'q'}{i}" for i, s in enumerate(arm.prismatic, 1))


@dataclass(frozen=True, eq=False)
class SolvedPiece:
    """One component, its univariate equations solved."""

    branches: tuple[Branch, ...]  # one for each choice of roots
    # the univariate equations whose roots the branches have, for print
    solved: tuple[Equation, ...]
    real: bool  # whether a real point is known
    codimension: int  # joints minus the dimension: real where only that is known to be smaller
    component: Component  # what it was made of, exactly


class PieceMaker:
    """Turns components into pieces, for one arm."""

    def __init__(
        self,
        geometry: Nominal,
        ring: Ring,
        time: Budget,
        angle_tol: float,
    ) -> None:
        self.geometry, self.ring, self.time, self.angle_tol = geometry, ring, time, angle_tol
        self.symbols = joint_symbols(geometry.arm)
        self.offset = geometry.offset[own_rows(geometry)]
        self.rng = np.random.default_rng(20)
        self.unsolved = 0
        """Systems that stay equations because time was over."""
        self.confirm: OwnPoints | None = None
        """Which points of equations are singular, where that is to be asked; see ``Family``."""
        self.products = False
        """Whether relations may be products, whose roots are not to be listed."""
        self._made = MadeOnce()
        arm = geometry.arm
        self.space = arm.space
        flat = [float(x) for row in geometry.translation for x in row]
        self.lengths = [abs(x) for x in flat if x != 0]
        # A family is as real outside the limits: sliders range over the size of the arm at least.
        reach = np.where(arm.prismatic, sum(self.lengths) or 1.0, np.pi)
        slides = [arm.prismatic & np.isfinite(limit) for limit in (arm.lower, arm.upper)]
        self.lower = np.where(slides[0], np.minimum(arm.lower, -reach), -reach)
        self.upper = np.where(slides[1], np.maximum(arm.upper, reach), reach)

    def make(self, component: Component) -> list[SolvedPiece]:
        """Return the pieces of a component; none if proven not to have a real point."""
        # What is neither proven empty nor has a known point is a piece, too.
        fixed = [self._value(j, v) for j, v in component.values.items()]
        solved, others = list[Poly](), list(component.relations)
        if not self.products:
            solved, others = self._solvable(component)
        alone = len(others) == 1 and not solved
        sure = alone and changes_sign(others[0], self.ring)
        codimension, minimal, found = component.codimension, list[Equation](), None
        if alone and not sure and not self.products:
            with contextlib.suppress(NotFinite, BudgetExceeded):
                found = isolated_zeros(others[0], self.ring, self.time)
        if found is None:
            found, minimal, unsolved = self._solutions(solved)
            others += unsolved
        else:  # smaller than the set of complex zeros
            codimension = len(fixed) + len(self.ring.joints_of(others[0]))
            others = []
        equations = [self.equation_of(p) for p in others]
        alive: dict[bool | None, list[Branch]] = {True: [], None: [], False: []}
        for solution in found:
            values, left = [self._algebraic(j, v) for j, v in solution.items()], equations
            for v in values:
                put = (fix_joint(e, v.joint, v.value) for e in left)
                left = _distinct([e for e in put if e is not None])
            held = sorted([*fixed, *values], key=lambda v: v.joint)
            branch = Branch(tuple(held), tuple(left))
            real = self._real(branch)
            alive[True if real is None and sure else real].append(branch)
        return [
            SolvedPiece(tuple(alive[real]), tuple(minimal), bool(real), codimension, component)
            for real in (True, None)
            if alive[real]
        ]

    def pieces(self, component: Component, components: Sequence[Component]) -> list[SolvedPiece]:
        """Return its pieces without what other components have, too; none if all is theirs."""
        others = [c for c in components if c is not component]
        # What is simpler or larger has isolated values to itself.
        first = [
            c
            for c in others
            if c.codimension < component.codimension
            or (c.codimension == component.codimension and component.relations and not c.relations)
        ]
        found = []
        for piece in self.make(component):
            own = tuple(b for b in piece.branches if not self._at_exact_values(b, first))
            found += [replace(piece, branches=own)] if own else []
        # Real points may be isolated where complex ones are not.
        if any(p.codimension != component.codimension for p in found) and all(
            self._at_exact_values(b, others) for p in found for b in p.branches
        ):
            return []
        return found

    def _at_exact_values(self, branch: Branch, components: Sequence[Component]) -> bool:
        """Return True if exact joint values put a branch of nothing else into a component."""
        values = {v.joint: v.exact for v in branch.values if v.exact is not None}
        if branch.equations or len(values) < len(branch.values):
            return False
        here = Component(values, (), False, len(values))
        return any(inside(here, c, self.ring) for c in components)

    def _solvable(self, component: Component) -> tuple[list[Poly], list[Poly]]:
        """Return the relations that fix joint values, and the others."""
        # A joint has finitely many values where it is alone in a relation, or alone with others of
        # these; or all joints do, where there are as many of them as the component has equations.
        relations = list(component.relations)
        joints = [set(self.ring.joints_of(p)) for p in relations]
        fixed = set().union(*joints)
        if len(fixed) != component.codimension - len(component.values):
            fixed = set()
            while new := next((j - fixed for j in joints if len(j - fixed) == 1), None):
                fixed |= new
        solved = [p for p, j in zip(relations, joints, strict=True) if j <= fixed]
        return solved, [p for p in relations if p not in solved]

    def _solutions(
        self, polys: Sequence[Poly]
    ) -> tuple[list[Solution], list[Equation], list[Poly]]:
        """Real values of joints, one equation a joint for print, and what was not solved."""
        together = [p for p in polys if len(self.ring.joints_of(p)) > 1]
        if together:
            try:
                return real_solutions(polys, self.ring, self.time), [], []
            except NotFinite:
                pass  # they stay equations
            except BudgetExceeded:
                self.unsolved += 1
        lines: dict[int, Poly] = {}
        for p in polys:
            if len(joints := self.ring.joints_of(p)) == 1:
                before = lines.get(joints[0], self.ring.zero)
                lines[joints[0]] = p if before == 0 else self.ring.gcd(before, p)
        roots = {j: real_roots(p, j, self.ring) for j, p in lines.items()}
        unlike = [
            self.equation_of(p)
            for j, p in lines.items()  # else the values say as much
            if any(v.exact(self.ring.prismatic[j]) is None for v in roots[j])
        ]
        choices = itertools.product(*roots.values())
        return [dict(zip(roots, c, strict=True)) for c in choices], unlike, together

    def _algebraic(self, joint: int, value: AlgebraicValue) -> JointValue:
        slides = self.ring.prismatic[joint]
        if (exact := value.exact(slides)) is not None:
            return replace(self._value(joint, exact), minimal=value.minimal)
        shown = float(value.ball) if slides else wrap(value.angle() - float(self.offset[joint]))
        return JointValue(joint, shown, False, value.minimal)

    def find(self, branch: Branch, count: int, rounds: int = 6) -> Array:
        """Return up to ``count`` points (k, n) of a branch over whole circles."""
        box = SearchBox.of(branch, self.lower, self.upper)
        # A few points may all be regular ones of the equations, many seldom.
        for some in (count, max(32, count)):
            batches = 1 if self.time.over else rounds
            found = search(branch.equations, box, some, self.rng, batches, self.time.stop)
            if self.confirm is None:
                return found
            if len(own := found[self.confirm(found)]):
                return own[:count]
        found = self.thrown(branch, 40)
        return found if self.confirm is None else found[self.confirm(found)][:count]

    def thrown(self, branch: Branch, count: int) -> Array:
        """Return points (k, n) that random starts converge to, so that all real parts are met."""
        box = SearchBox.of(branch, self.lower, self.upper)
        found = thrown(branch.equations, box, count, self.rng, self.time.stop)
        return self.space.wrap(found)  # starts go several turns round

    def branch_of(self, values: Mapping[int, Value], relations: Sequence[Poly]) -> Branch:
        """Joints at exact values, and polynomials that vanish, as what points are found on."""
        held = sorted((self._value(j, v) for j, v in values.items()), key=lambda v: v.joint)
        return Branch(tuple(held), tuple(self.equation_of(p) for p in relations))

    def off(self, q: Array, values: Mapping[int, Value], relations: Sequence[Poly] = ()) -> Array:
        """How far (N,) configurations are from joint values and, in equations' sizes, relations."""
        branch = self.branch_of(values, relations)
        metric = self.space.metric[[v.joint for v in branch.values]]
        parts = [branch.off(q, self.space) * metric]
        parts += [system_of(branch.equations).values(q)] if branch.equations else []
        return np.asarray(np.abs(np.concatenate(parts, axis=1)).max(axis=1, initial=0.0))

    def _value(self, joint: int, value: Value) -> JointValue:
        if self.ring.prismatic[joint]:
            return JointValue(joint, float(value[0]), True, exact=value)
        x, y = (float(v) for v in value)
        angle = wrap(2 * math.atan2(y, x) - float(self.offset[joint]))
        return JointValue(joint, angle, True, exact=value)

    def equation_of(self, poly: Poly) -> Equation:
        """A polynomial as an equation in the joints, made once."""
        given = self.ring, self.symbols, self.offset
        return self._made.of(  # type: ignore[no-any-return]
            poly, lambda p: scale_to_lengths(equation(p, *given), self.lengths)
        )

    def _real(self, branch: Branch) -> bool | None:
        """Return whether a branch has a real point; None where none is found, and may be."""
        equations = branch.equations
        # A constant is far above rounding: its root goes with another one.
        if any(not e.involved or never_zero(e) for e in equations):
            return False
        if (not equations and self.confirm is None) or self.find(branch, 1).size:
            return True
        # No box holds all values of a slider.
        if not equations or self.time.over or any(e.powers.any() for e in equations):
            return None
        return False if proven_empty(equations, self.lower, self.upper) else None


def _distinct(equations: Sequence[Equation]) -> list[Equation]:
    """Equations, without those that say the same as an earlier one."""
    kept: dict[tuple[object, ...], Equation] = {}
    for e in equations:
        order = sorted(range(len(e.cos)), key=lambda t: (*e.frequencies[t], *e.powers[t]))
        numbers = np.concatenate([e.cos[order], e.sin[order]])
        largest = numbers[int(np.argmax(np.abs(numbers) > 0.999 * np.abs(numbers).max()))]
        key = (
            *(tuple(e.frequencies[t]) for t in order),
            *(tuple(e.powers[t]) for t in order),
            *np.round(numbers / largest, 9) + 0.0,
        )
        kept.setdefault(key, e)
    return list(kept.values())


def wrap(angle: float) -> float:
    """Angle in (-pi, pi], values within rounding of a multiple of 15 degrees put there."""
    step = math.pi / 12
    nearest = round(angle / step)
    if abs(angle - nearest * step) < 1e-14 * max(1.0, abs(angle)):
        angle = nearest * step
    angle = math.remainder(angle, 2 * math.pi)
    return math.pi if angle <= -math.pi else angle


def mirror_key(piece: SolvedPiece) -> object:
    """Equal for pieces that are mirror images: values up to sign and half turns."""
    if len(piece.solved) > 1:
        return object()
    values = {
        (v.joint, round(abs(math.remainder(v.value, math.pi)), 9))
        for b in piece.branches
        for v in b.values
    }
    relations = sorted(_signature(e) for b in piece.branches for e in b.equations)
    solved = sorted(_signature(e) for e in piece.solved)
    return (
        tuple(sorted(values)),
        tuple(relations[: len(piece.branches[0].equations)]),
        tuple(solved),
    )


def _signature(equation: Equation) -> tuple[tuple[tuple[int, ...], tuple[int, ...], float], ...]:
    size = np.hypot(equation.cos, equation.sin)
    size = size / size.max()
    return tuple(
        sorted(
            (tuple(int(k) for k in np.abs(f)), tuple(int(k) for k in p), round(float(c), 8))
            for f, p, c in zip(equation.frequencies, equation.powers, size, strict=True)
        )
    )


def statement(
    branches: Sequence[Branch],
    solved: Sequence[Equation],
    symbols: Sequence[str],
    prismatic: Sequence[bool],
    latex: bool = False,
) -> str:
    """The condition of a family in one line."""
    # Branches of which only one sum of angles differs are stated together.
    alike: dict[object, list[Branch]] = {}
    for b in branches:
        sums, key = [e for e in b.equations if e.angle_sum is not None], object()
        if len(sums) == 1:
            rest = tuple(e.text() for e in b.equations if e is not sums[0])
            values = tuple((v.joint, round(v.value, 12)) for v in b.values)
            key = values, rest, sums[0].frequencies.tobytes()
        alike.setdefault(key, []).append(b)
    groups: dict[tuple[str, ...], list[Branch]] = {}
    for members in alike.values():
        first, equations, said = members[0], members[0].equations, tuple[str, ...]()
        if len(members) > 1:
            one = next(e for e in equations if e.angle_sum is not None)
            angles = [e.angle_sum for b in members for e in b.equations if e.angle_sum is not None]
            said = (one.angle_sum_text(angles, latex),)
            equations = tuple(e for e in equations if e is not one)
        groups.setdefault((*said, *_written(equations, latex)), []).append(first)
    joint, either = (r",\ ", r"\ \text{or}\ ") if latex else (" and ", "; or ")
    return either.join(
        joint.join([*values, *texts])
        for texts, members in groups.items()
        for values in _value_texts(members, solved, symbols, prismatic, latex)
    )


def _written(equations: Sequence[Equation], latex: bool) -> tuple[str, ...]:
    """Equations that hold at once: the short ones, and of several long ones how many."""
    # Those that put one joint at 0 or 180 degrees, sin q = 0: twice the multiple of an angle that
    # occurs as itself.
    straight = [
        e
        for e in equations
        if len(e.cos) == len(e.involved) == 1
        and not (e.powers.any() or e.cos.any() or e.shift[e.involved[0]])
        and abs(int(e.frequencies[0][e.involved[0]])) == 2
    ]
    # Beyond so many these are not listed one by one.
    if len(straight) > 3:
        joints = enumerate(sorted(e.involved[0] for e in straight))
        said = list[str]()
        for _, run in itertools.groupby(joints, lambda at: at[1] - at[0]):
            ends = [symbol_text(straight[0].joints[j], latex) for _, j in run]
            to = r"\ \text{to}\ " if latex else " to "
            said += [f"{ends[0]}{to}{ends[-1]}"] if len(ends) > 2 else ends
        text = f"{listed(said)} each 0° or 180°"
        if latex:
            text = rf"{', '.join(said)}\ \text{{each}}\ 0^\circ\ \text{{or}}\ 180^\circ"
        return (text, *_written([e for e in equations if e not in straight], latex))
    long = long_ones(equations)
    if len(long) < 2:
        return tuple(_write(e, latex, len(equations) == 1) for e in equations)
    names = [long[0].joints[j] for j in sorted({j for e in long for j in e.involved})]
    sizes = sorted({len(e.cos) for e in long})
    size = f"{sizes[0]} to {sizes[-1]}" if len(sizes) > 1 else f"{sizes[0]}"
    text = f"{len(long)} equations at once in {listed(names)} [{size} terms]"
    if latex:
        within = ", ".join(symbol_text(name, latex) for name in names)
        text = rf"{len(long)}\ \text{{equations at once in}}\ {within}"
    return (*(_write(e, latex, False) for e in equations if e not in long), text)


def _write(equation: Equation, latex: bool, alone: bool) -> str:
    if alone and (form := long_form(equation)) is not None:
        return form.latex if latex else form.text()
    if len(equation.cos) > LONG and not latex:
        names = ", ".join(equation.joints[j] for j in equation.involved)
        return f"f({names}) = 0 [{len(equation.cos)} terms]"
    return equation.line(latex)


def _value_texts(
    branches: Sequence[Branch],
    solved: Sequence[Equation],
    symbols: Sequence[str],
    prismatic: Sequence[bool],
    latex: bool,
) -> list[list[str]]:
    """Conditions on single joints; one list if all combinations occur, else one a branch."""
    rounded = [{v.joint: round(v.value, 12) for v in b.values} for b in branches]
    sets = {j: sorted({x[j] for x in rounded if j in x}) for j in rounded[0]}
    combinations = {tuple(values.values()) for values in rounded}
    said = [sets]
    if combinations != set(itertools.product(*sets.values())):
        said, solved = [{v.joint: [v.value] for v in b.values} for b in branches], ()
    return [
        [_joint_text(symbols[j], x, prismatic[j], solved, latex) for j, x in values.items()]
        for values in said
    ]


def _joint_text(
    symbol: str, values: Sequence[float], slides: bool, solved: Sequence[Equation], latex: bool
) -> str:
    """``d3 = 0``, or ``sin q6 = -0.2 (q6 = ...)`` where its values are those of an equation."""
    name = symbol_text(symbol, latex)
    if slides:
        unit, either = (r"\,\mathrm{m}", r"\ \text{or}\ ") if latex else (" m", " or ")
        return f"{name} = {either.join(f'{v:.6g}{unit}' if v else '0' for v in values)}"
    known = f"{name} = {angles_text(values, latex)}"
    for e in solved:
        (j,) = e.involved
        q = np.zeros((len(values), len(e.joints)))
        q[:, j] = values
        # A mirror image has roots of its own, which the equation of the other one has not.
        if e.joints[j] != symbol or (np.abs(e(q)) >= 1e-9 * e.size).any():
            continue
        written = e.line(latex)
        moving = np.abs(e.frequencies).sum(axis=1).tolist()
        if sorted(moving) == [0, 2] and not e.shift[j]:  # a sin q + b = 0, or with cos
            at = moving.index(2)
            used = [(f, head) for f, head in (("cos", e.cos[at]), ("sin", e.sin[at])) if head]
            if len(used) == 1:
                ((function, head),) = used
                written = f"{function} {name} = {-e.cos[1 - at] / head:.10g}"
                written = "\\" * latex + written
        return f"{written}\\ ({known})" if latex else f"{written} ({known})"
    return known


ORDER = ("wrist", "elbow", "shoulder", "")
"""Names in the order in which people are told of families."""

_LEG = re.compile("hip|knee|ankle|(^|_)leg", re.IGNORECASE)

Holds = Callable[[JointAxes, float], bool]


def title_of(arm: Arm, points: Array) -> str:
    """Return the name of the family that has these points (N, n), all over it; "" if none."""
    conditions = _conditions(arm)
    if not conditions or not len(points):
        return ""
    J = Batch(arm, PINOCCHIO).frame_jacobians(points)
    axes = JointAxes.each(J, arm.prismatic, np.zeros(3))
    found = [name for name, holds in conditions.items() if all(holds(a, ALIKE) for a in axes)]
    return found[0] if len(found) == 1 else ""


@kept
def _conditions(arm: Arm) -> Mapping[str, Holds]:
    """The conditions that have a name for an arm; none where its geometry does not warrant it."""
    turns = ~arm.prismatic
    legs = any(_LEG.search(joint) for joint in arm.joints)
    if arm.task.name != "pose" or arm.coupling is not None or legs or arm.n not in (6, 7):
        return {}
    samples, centres = generic_axes(arm), {c.ids for c in arm_centres(arm)}

    def parallel(*ids: int) -> bool:
        return all(a.parallel(ids, STRUCTURE_TOL) for a in samples)

    if arm.n == 7:
        usual = turns.all() and centres >= {(0, 1, 2), (4, 5, 6)}
        names = {"wrist": _flat(4, 5, 6), "elbow": _stretched, "shoulder": _flat(0, 1, 2)}
        return names if usual else {}
    if not turns[3:].all():
        return {}
    spherical, offset = (3, 4, 5) in centres, turns[1:].all() and parallel(1, 2, 3)
    crossing = offset and all(a.meeting_point((4, 5), STRUCTURE_TOL) is not None for a in samples)
    found: dict[str, Holds] = {"wrist": _flat(3, 4, 5)} if spherical or crossing else {}
    across = all(abs(a.direction[1] @ a.direction[2]) <= STRUCTURE_TOL for a in samples)
    planar = parallel(1, 2) if turns[2] else across
    if not planar or not turns[:2].all() or parallel(0, 1):
        return found
    if spherical:
        found |= {"shoulder": _above, "elbow" if turns[2] else "": _moves_center_one_way}
    elif offset:
        found["elbow"] = lambda a, tol: a.in_one_plane((1, 2, 3), tol)
        found |= {"shoulder": _above} if crossing else {}
    return found


def _flat(*ids: int) -> Holds:
    """Three axes are parallel to one plane."""
    return lambda a, tol: abs(np.linalg.det(a.direction[list(ids)])) <= tol


def _center(a: JointAxes, *ids: int) -> Array:
    met = a.meeting_point(ids, STRUCTURE_TOL)
    return np.full(3, np.nan) if met is None else met  # parallel there: no condition holds


def _above(a: JointAxes, tol: float) -> bool:
    """Axis 1 does not move the wrist center along axis 2."""
    return abs(float(a.twists((0,), _center(a, 4, 5))[0, :3] @ a.direction[1])) <= tol


def _moves_center_one_way(a: JointAxes, tol: float) -> bool:
    """Joints 2 and 3 move the wrist center in one direction only, or not at all."""
    center = _center(a, 4, 5)
    return bool(np.isfinite(center).all()) and a.velocity_rank((1, 2), center, tol) < 2


def _stretched(a: JointAxes, tol: float) -> bool:
    """The centers of shoulder and wrist and axis 4 lie in one plane."""
    centers = _center(a, 0, 1, 2), _center(a, 4, 5, 6)
    return all(np.isfinite(c).all() for c in centers) and a.in_one_plane((3,), tol, *centers)


_APART = 0.12  # radians, about seven degrees


def telling_poses(
    arm: Arm, family: Family, count: int, others: Sequence[Family] = ()
) -> tuple[Array, ...]:
    """Return up to ``count`` configurations that show a family well, the same at every call."""
    # Preferably away from ``others``, above the floor, untwisted, and unlike each other.
    rng = np.random.default_rng(4)
    Q = family.sample(80, rng)
    witness = getattr(family, "witness", None)
    if not len(Q):
        return () if witness is None else (np.array(witness, dtype=float),)
    lower, upper = arm.span
    turns = np.where(arm.prismatic, 0.0, 2 * np.pi * np.round(Q / (2 * np.pi)))
    Q = np.where((Q - turns >= lower) & (Q - turns <= upper), Q - turns, Q)
    apart = _apart(arm, others, Q)
    alone = apart >= min(_APART, float(apart.max()))
    Q, apart = Q[alone], apart[alone]
    share = own_shares(arm, Q)
    # The singular value that should survive at a generic point of the family.
    drop = max(1, int(np.median((share <= 1e-7).sum(axis=1))))
    healthy = share[:, -1 - drop] if share.shape[1] > drop else 1.0
    half_turn = np.where(arm.prismatic | (lower > np.pi) | (upper < -np.pi), np.inf, np.pi)
    lower, upper = np.maximum(lower, -half_turn), np.minimum(upper, half_turn)
    middle, half = (lower + upper) / 2, np.maximum((upper - lower) / 2, 1e-9)
    twisted = np.abs((Q - middle) / half).mean(axis=1)
    score = np.minimum(healthy / 0.1, 1.0) + 2.0 * _above_floor(arm, Q) - 0.8 * twisted
    score += 0.5 * np.minimum(apart / (3 * _APART), 1.0)
    chosen = [int(np.argmax(score))]
    reach = np.where(arm.prismatic, half, np.pi)
    for _ in range(min(count, len(Q)) - 1):
        gap = np.min([np.linalg.norm((Q - Q[c]) / reach, axis=1) for c in chosen], axis=0)
        gap[chosen] = -np.inf
        chosen.append(int(np.argmax(score + 1.2 * np.minimum(gap, 1.0))))
    return tuple(Q[c] for c in chosen)


def _apart(arm: Arm, others: Sequence[Family], Q: Array) -> Array:
    """At least how far other families are from Q (N, n); (N,), radians."""
    if not others:
        return np.full(len(Q), np.inf)
    weight = np.where(arm.prismatic, 1 / arm.length_scale, 1.0)
    conditions = Conditions.of([f.branches for f in others], np.asarray(arm.prismatic), weight)
    return two_sided(conditions, Q).lower


def _above_floor(arm: Arm, Q: Array) -> Array:
    """1 where no joint and no tip is below the base, 0 from a tenth of the height on; (N,)."""
    data, heights = arm.model.createData(), []
    for q in Q:
        pin.framesForwardKinematics(arm.model, data, arm.model_q(q))
        z = [data.oMi[j].translation[2] for j in range(1, arm.model.njoints)]
        heights.append([*z, data.oMf[arm.tip_id].translation[2]])
    spread = float(np.ptp(heights)) or 1.0
    return np.asarray(np.clip(1 + 10 * np.min(heights, axis=1) / spread, 0.0, 1.0))


_SHORT = 60
"""Characters that a condition may have to be named as the place of a kind."""


def kinds_of(family: Family, points: Array, arm: Arm, maker: PieceMaker) -> tuple[KindPart, ...]:
    """Return the kinds of singularity at points (N, n), by branches, or as shares of the points."""
    found = kinds_many(arm, points)
    counts, total = Counter(found), len(found)
    if len(counts) == 1:
        return (KindPart(found[0], "", 1.0, total),)
    owners = list(zip(found, _owners(family, points), strict=True))
    by_kind = {k: list(dict.fromkeys(b for kind, b in owners if kind == k)) for k in counts}
    slides = [bool(p) for p in maker.ring.prismatic]
    if sorted(itertools.chain(*by_kind.values())) == [*range(len(family.branches))]:
        places = {
            kind: statement([family.branches[b] for b in own], (), maker.symbols, slides)
            for kind, own in by_kind.items()
        }
        longest = max(places, key=lambda k: len(places[k]))
        if len(places[longest]) > _SHORT:
            places[longest] = ""  # named by what the others are not
        if all(len(place) <= _SHORT for place in places.values()):
            return tuple(
                KindPart(k, places[k] or "all other points", counts[k] / total, total)
                for k in sorted(places, key=lambda k: places[k] == "")
            )
    return tuple(KindPart(k, "", n / total, total) for k, n in counts.most_common())


def _owners(family: Family, points: Array) -> list[int]:
    """The branch that each point lies on."""
    off = np.empty((len(family.branches), len(points)))
    for i, branch in enumerate(family.branches):
        off[i] = np.linalg.norm(branch.off(points, family.space), axis=-1)
        if branch.equations:
            off[i] += np.abs(system_of(branch.equations).values(points)).max(axis=-1)
    return [int(i) for i in off.argmin(axis=0)]


def readable(family: Family, branch: Branch, q: Array, arm: Arm, within_limits: bool) -> Array:
    """Return a configuration near q (n,) on a branch, as singular, with round values where free."""
    # Joints in equations are solved for, one an equation. It is q itself if none was found.
    turned = q - 2 * np.pi * np.round(q / (2 * np.pi))
    inside = (turned >= family.lower) & (turned <= family.upper) | (not within_limits)
    start = np.where(~family.prismatic & inside, turned, q)
    # Steps (n,) of round values are powers of ten: the range of a joint has a hundred at least.
    lower, upper = family.box(within_limits=True)
    span = np.where(upper > lower, np.minimum(upper - lower, 2 * np.pi), 1.0)
    span = np.where(family.prismatic & (upper > lower), upper - lower, span)
    grid = 10.0 ** np.floor(np.log10(span / 100))
    rounded = np.round(start / grid) * grid
    # Zero is where other families are.
    rounded = np.where(rounded == 0, np.where(start < 0, -1, 1) * grid, rounded)
    # The floats nearest to the decimals that are meant.
    places = -np.log10(grid).round().astype(int)
    rounded = np.array([round(float(v), int(k)) for v, k in zip(rounded, places, strict=True)])
    held = [v.joint for v in branch.values]
    rounded[held] = start[held]
    rank = generic_rank(arm)
    for found in [rounded] if not branch.equations else _solved(branch, rounded):
        if within_limits and arm.space.unreachable(found).any():
            continue
        # One of the same rank, the first to all digits.
        sigma = Batch(arm, PINOCCHIO).sigma(np.stack([found, q]))[:, :rank]
        ratio = sigma / sigma[:, :1].clip(min=1e-300)
        zeros = ratio <= 1e-8
        if (zeros[0] == zeros[1]).all() and (ratio[0][zeros[0]] <= 1e-11).all():
            return np.asarray(found)
    return q


def _solved(branch: Branch, start: Array) -> Iterator[Array]:
    """Points of a branch that differ from ``start`` in as few joints as it has equations."""
    joints = sorted({j for e in branch.equations for j in e.involved})
    count = min(len(branch.equations), len(joints))
    slope = np.abs(system_of(branch.equations).gradients(start[None])[0]).sum(axis=0)
    order = sorted(joints, key=lambda j: -slope[j])
    for chosen in itertools.islice(itertools.combinations(order, count), 8):
        free = np.zeros(len(start), dtype=bool)
        free[list(chosen)] = True
        moved, ok = project(branch.equations, start[None], free)
        if ok[0]:
            yield np.where(free, moved[0], start)


_WITNESSES = 32
_LOOKS = 0.4, 0.6
"""Shares of a family's time by which looks within its limits, and a little beyond them, have ended:
what is left is for points anywhere."""


def describe(
    group: Sequence[SolvedPiece], maker: PieceMaker, arm: Arm, confirm: OwnPoints | None = None
) -> Family:
    """Return the family of mirrored pieces; ``confirm`` makes its points singular and sharp."""
    draft, rng, exact = stated(group, maker, arm), np.random.default_rng(SEED), maker.geometry.arm
    draft = draft if confirm is None else replace(draft, confirm=confirm)

    def points(of: Family, within: bool, time: Budget, count: int = _WITNESSES) -> Array:
        batches = 1 if maker.time.over else ROUNDS
        return of.points(count, rng, within, batches, time.stop)

    if not draft.real:
        # No less may be said than samples show.
        look = maker.time.part(_LOOKS[0])
        if not any(len(points(draft, within, look)) for within in (True, False)):
            return draft
        draft = replace(draft, real=True)
    looks = [maker.time.part(share) for share in _LOOKS]
    inside = points(draft, True, looks[0])
    reachability = Reachability.INSIDE if len(inside) else Reachability.UNKNOWN
    if not len(inside):
        # Metres by which a family may lie beyond the limit of a prismatic joint and be at it.
        wider = replace(draft, limit_tolerance=np.where(arm.prismatic, 1e-6, maker.angle_tol))
        inside = points(wider, True, looks[1])
        if len(inside):
            draft = replace(wider, limits_met=_limits_met(wider, inside[0], maker.symbols))
            reachability = Reachability.AT_LIMIT
        elif not maker.time.over:
            outside = none_within(wider.conditions(), *wider.limits)
            reachability = Reachability.OUTSIDE if outside else Reachability.UNKNOWN
    draft = replace(draft, reachability=reachability)
    found = inside if len(inside) else points(draft, False, maker.time)
    # Points have half of their digits only where an equation touches zero: sigma_r / sigma_1 of one
    # that has all is less.
    drawn = draft.confirm is None and any(b.equations for b in draft.branches)
    if drawn and (ratios(exact, found, PINOCCHIO) > 1e-9).any():
        return describe(group, maker, arm, OwnPoints(exact))
    if not len(found):
        return draft

    def is_on(branch: Branch, some: Array) -> bool:
        # Distance in joint space up to which a point is on a branch.
        return bool(near((branch,), draft.space, some, 1e-6, draft.confirm).any())

    def met(branch: Branch) -> bool:
        alone = replace(draft, branches=(branch,))
        return is_on(branch, inside) or bool(len(points(alone, True, maker.time, 1)))

    several = draft.branches if len(draft.branches) > 1 else ()
    branch = next((b for b in several if is_on(b, found[:1])), draft.branches[0])
    strictly = reachability is Reachability.INSIDE
    generic = readable(draft, branch, found[0], exact, within_limits=strictly)
    loss = loss_at(exact, generic, rtol=1e-8)
    kinds = kinds_of(draft, found, exact, maker)
    rng = np.random.default_rng(SEED)
    reach = values_reached(draft, met)
    return replace(
        draft,
        title=title_of(exact, found[::4]),
        value_reach=reach,
        at_once=() if (said := at_once(branch, generic, maker.symbols)) is None else (said,),
        codimension=_codimension(branch, generic, draft.codimension),
        witness=generic if len(inside) else None,
        generic=generic,
        rank=loss.rank,
        lost=(*(motion.words for motion in loss.lost), *missing_everywhere(loss)),
        kind=kinds[0].kind if len(kinds) == 1 else "varies",
        kinds=kinds,
        reason="; ".join(d.reason for d in loss.dependences),
        raw_ratio=None if maker.geometry.exact else float(ratios(arm, found, PINOCCHIO).max()),
    )


def stated(group: Sequence[SolvedPiece], maker: PieceMaker, arm: Arm) -> Family:
    """The family of some pieces as far as its condition goes: no points, and not what is lost."""
    branches = tuple(b for p in group for b in p.branches)
    solved = group[0].solved
    prismatic = [bool(p) for p in arm.prismatic]
    involved = sorted({j for b in branches for j in b.involved})
    # Long equations that stand alone on a branch: those leave the other joints free.
    forms = [long_form(b.equations[0]) for b in branches if len(b.equations) == 1]
    # Joints at values alone are singular throughout where they are it at one random place.
    confirm, drawn = maker.confirm, np.random.default_rng(SEED).uniform(-3.0, 3.0, (1, arm.n))
    unsure = confirm is not None and any(
        b.equations or not confirm(b.put(drawn, arm.space))[0] for b in branches
    )
    return Family(
        name="",
        text=statement(branches, solved, maker.symbols, prismatic),
        latex=statement(branches, solved, maker.symbols, prismatic, latex=True),
        branches=branches,
        joints=tuple(arm.joints[j] for j in involved),
        codimension=group[0].codimension,
        proof="algebra" if all(p.component.proven for p in group) else "generic points",
        real=any(p.real for p in group),
        reachability=Reachability.UNKNOWN,
        witness=None,
        generic=None,
        rank=None,
        lost=(),
        kind="undecided",
        reason="",
        raw_ratio=None,
        lower=np.array(arm.lower),
        upper=np.array(arm.upper),
        prismatic=np.array(arm.prismatic),
        length_scale=arm.length_scale,
        components=tuple(p.component for p in group),
        confirm=maker.confirm,
        also_regular=unsure,
        solved=tuple(dict.fromkeys(form for form in forms if form is not None)),
        arm=arm,
    )


def _limits_met(family: Family, q: Array, symbols: Sequence[str]) -> tuple[str, ...]:
    """Return which limits a point lies beyond, within the tolerance, with both numbers."""
    said = []
    for j, value in enumerate(q):
        unit = "m" if family.prismatic[j] else "rad"
        for limit, beyond in ((family.lower[j], -1.0), (family.upper[j], 1.0)):
            if (by := beyond * (value - limit)) > 1e-10:
                ends = f"{value:.10g} {unit}, its limit {limit:.10g} {unit}"
                said.append(f"{symbols[j]} = {ends}, {by:.1e} {unit} apart")
    return tuple(said)


def missing_everywhere(loss: Loss | State) -> list[str]:
    """A remark where some of the motions lost at a point are lost at every other as well."""
    if loss.always_missing == 0 or not loss.lost:
        return []
    return [f"{loss.always_missing} of these {len(loss.lost)} is missing at every configuration"]


def _codimension(branch: Branch, q: Array, complex_codimension: int) -> int:
    """Return joints fixed plus independent gradients at q, or the complex one where these vanish.

    A single equation that is left changes its sign: its set has the complex codimension.
    """
    if not branch.equations:
        return len(branch.values)
    if len(branch.equations) == 1:
        return complex_codimension
    independent = rank_of(system_of(branch.equations).gradients(q[None])[0])
    return max(complex_codimension, len(branch.values) + independent)
