"""Every chain that a robot offers: arms, legs, heads, fingers; from the root or from a branching.

A chain is named by its tip and, where it does not start at the root, by its base. Joints before
the base are locked, and so are grippers beyond the tip.
"""

from __future__ import annotations

import shlex
from collections.abc import Collection, Sequence

import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing.robot.tip import candidates, choose_tip, joint_path, tip_frames

LONGEST = 9
"""More joints than this are offered as sub-chains: an arm without the torso that carries it."""
SHORTEST = 2


@dataclass(frozen=True)
class Subchain:
    """A chain that can be analysed.

    Attributes
    ----------
    tip : str
        Frame at its end.
    base : str or None
        Frame that it starts from; None for the root.
    joints : tuple of str
        Names of its joints that turn or slide, base to tip; mimic joints included.
    passed_over : tuple of str
        Names of gripper joints beyond the tip.
    """

    tip: str
    base: str | None
    joints: tuple[str, ...]
    passed_over: tuple[str, ...] = ()

    @property
    def options(self) -> tuple[str, ...]:
        """Words of the command line that choose it."""
        return ("--tip", self.tip, *(() if self.base is None else ("--base", self.base)))


def all_chains(
    model: pin.Model,
    mimics: Collection[str] = (),
    shortest: int = SHORTEST,
    longest: int = LONGEST,
) -> tuple[Subchain, ...]:
    """Every chain of ``shortest`` to ``longest`` joints that ends in a leaf or a tool frame.

    Each end is taken from the root, and from the last branching on the way to it; where the way
    from the root is too long, from every branching that leaves few enough joints.

    Parameters
    ----------
    model : pin.Model
        The whole model.
    mimics : collection of str
        Names of joints that follow another one.
    shortest, longest : int
        Number of joints.
    """
    tools = {c.last: c for c in candidates(model, mimics)}
    children = _children(model)
    ends = sorted({j for j in range(1, model.njoints) if not children[j]} | set(tools))
    found: list[Subchain] = []
    for end in ends:
        tool = tools.get(end)
        tip = choose_tip(model, end) if tool is None else tool.tip
        beyond = () if tool is None else tool.passed_over
        for start in _starts(model, children, end, longest):
            joints = _moving(model, joint_path(model, end, start))
            if shortest <= len(joints) <= longest:
                base = None if start == 0 else _link_of(model, start)
                found.append(Subchain(tip, base, joints, beyond))
    return tuple(found)


def arm_chains(
    model: pin.Model, mimics: Collection[str] = (), longest: int = LONGEST
) -> tuple[Subchain, ...]:
    """Return the chains to offer to a user: arms, legs and heads, fingers left to their gripper.

    Each from the root, whatever its length; and where that is longer than ``longest`` joints, or
    the chain shares its first joints with another, also without the shared ones.
    """
    children = _children(model)
    found: list[Subchain] = []
    for candidate in candidates(model, mimics):
        starts = [0, *_branchings(model, children, candidate.last)[-1:]]
        for start in dict.fromkeys(starts):
            joints = _moving(model, joint_path(model, candidate.last, start))
            if start == 0 or len(joints) >= SHORTEST:
                base = None if start == 0 else _link_of(model, start)
                found.append(Subchain(candidate.tip, base, joints, candidate.passed_over))
    return tuple(found)


def long_chain_note(model: pin.Model, end: int, start: int = 0, longest: int = LONGEST) -> str:
    """What to say of a chain of more than ``longest`` joints: why, and which shorter ones exist.

    Empty if the chain from joint ``start`` to joint ``end`` is not that long.
    """
    count = len(_moving(model, joint_path(model, end, start)))
    if count <= longest:
        return ""
    shorter = []
    for joint in _branchings(model, _children(model), end):
        beyond = joint_path(model, end, joint)
        left = len(_moving(model, beyond))
        if SHORTEST <= left < count and joint in joint_path(model, end, start):
            shorter.append(f"--base {_link_of(model, joint)} ({left} joints)")
    offer = f"; without joints shared with other chains: {', '.join(shorter)}" if shorter else ""
    return f"{count} joints are many: the closed forms may not be complete in time{offer}"


def chains_text(chains: Sequence[Subchain], words: Sequence[str], longest: int = LONGEST) -> str:
    """Chains as a tree, shared joints once, with the command that analyses each.

    Parameters
    ----------
    chains : sequence of Subchain
        As ``arm_chains`` returns them.
    words : sequence of str
        The robot as the user named it, and options that every command needs (packages).
    longest : int
        Chains of more joints are marked, with the shorter one beside them.
    """
    whole = [c for c in chains if c.base is None]
    parts = {c.tip: c for c in chains if c.base is not None}
    lines = ["(root)"]
    _branches(whole, parts, 0, "", " ".join(map(shlex.quote, words)), longest, lines)
    return "\n".join(lines)


def _branches(
    chains: Sequence[Subchain],
    parts: dict[str, Subchain],
    depth: int,
    indent: str,
    robot: str,
    longest: int,
    lines: list[str],
) -> None:
    """Append what hangs below the first ``depth`` joints, which the chains share."""
    groups: dict[str, list[Subchain]] = {}
    for chain in chains:
        groups.setdefault(chain.joints[depth] if depth < len(chain.joints) else "", []).append(
            chain
        )
    ordered = list(groups.values())
    for number, group in enumerate(ordered):
        last = number == len(ordered) - 1
        bar, below = ("└─ ", "   ") if last else ("├─ ", "│  ")
        if len(group) == 1:
            chain = group[0]
            lines.append(f"{indent}{bar}{_run(chain.joints[depth:])} -> {chain.tip}")
            deeper = indent + below
            lines.append(deeper + _offer(chain, robot, len(chain.joints)))
            if len(chain.joints) > longest:
                lines[-1] += (
                    f"  (more than {longest}: closed forms may not end in time; "
                    "rather without the shared joints)"
                )
            part = parts.get(chain.tip)
            if part is not None:
                lines.append(deeper + _offer(part, robot, len(part.joints)))
            if chain.passed_over:
                lines.append(f"{deeper}locked beyond it: {_run(chain.passed_over)}")
            continue
        shared = depth
        while all(len(c.joints) > shared for c in group) and (
            len({c.joints[shared] for c in group}) == 1
        ):
            shared += 1
        lines.append(f"{indent}{bar}{_run(group[0].joints[depth:shared])}")
        _branches(group, parts, shared, indent + below, robot, longest, lines)


def _offer(chain: Subchain, robot: str, count: int) -> str:
    options = " ".join(map(shlex.quote, chain.options))
    return f"{count} joint{'s' if count != 1 else ''}: pinsing analyze {robot} {options}"


def _run(names: Sequence[str]) -> str:
    """Names of joints in a row, the middle ones left out."""
    if not names:
        return "(here)"
    if len(names) <= 2:
        return ", ".join(names)
    return f"{names[0]} ... {names[-1]} ({len(names)})"


def _children(model: pin.Model) -> list[list[int]]:
    children: list[list[int]] = [[] for _ in range(model.njoints)]
    for joint in range(1, model.njoints):
        children[model.parents[joint]].append(joint)
    return children


def _branchings(model: pin.Model, children: list[list[int]], end: int) -> list[int]:
    """Joints on the way to ``end`` that carry more than one joint, root side first."""
    return [j for j in joint_path(model, end) if j != end and len(children[j]) > 1]


def _starts(model: pin.Model, children: list[list[int]], end: int, longest: int) -> list[int]:
    branchings = _branchings(model, children, end)
    if len(_moving(model, joint_path(model, end))) <= longest:
        branchings = branchings[-1:]
    return [0, *branchings]


def _moving(model: pin.Model, path: Sequence[int]) -> tuple[str, ...]:
    return tuple(model.names[j] for j in path if model.joints[j].nv == 1)


def _link_of(model: pin.Model, joint: int) -> str:
    """Name of the frame that stands for the link that a joint moves: the body nearest to it."""
    frames = tip_frames(model, joint) or [f for f in model.frames if f.parentJoint == joint]
    bodies = [f for f in frames if f.type == pin.FrameType.BODY] or frames
    return str(min(bodies, key=lambda f: float(abs(f.placement.translation).max())).name)
