"""Links and joints of a URDF as a tree: one root, no loop, every name unique and known."""

from __future__ import annotations

import difflib
from collections import defaultdict
from collections.abc import Sequence

from pinsing.description.urdf_joints import JointEntry
from pinsing.description.urdf_source import UrdfSource, show
from pinsing.description.xml_tree import Node

MAX_IN_A_TREE = 5000
# Pinocchio builds the tree by recursion: 10,000 joints in a row overflow its stack.
MAX_DEPTH = 1000


def check_unique(
    kind: str, names: Sequence[str], nodes: Sequence[Node], source: UrdfSource
) -> None:
    """Refuse a name that two links, or two joints, share."""
    first: dict[str, Node] = {}
    for name, node in zip(names, nodes, strict=True):
        if name in first:
            other = "" if source.expanded else f" (the first is on line {first[name].line})"
            raise source.error(f"two {kind}s are named {show(name)}{other}: rename one", node)
        first[name] = node


def check_tree(
    links: Sequence[str], joints: Sequence[JointEntry], nodes: Sequence[Node], source: UrdfSource
) -> str:
    """Return the root link of the tree that the joints make of the links.

    Raises
    ------
    RobotFileError
        If a joint names an unknown link or closes a loop, a link has two parents, there are
        several roots, or the tree is too deep for Pinocchio.
    """
    known = set(links)
    parent_joint: dict[str, JointEntry] = {}
    for joint, node in zip(joints, nodes, strict=True):
        for end, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in known:
                close = difflib.get_close_matches(link, links, n=1) if len(links) <= 500 else []
                hint = f": did you mean {show(close[0])}?" if close else ": no link has that name"
                raise source.error(
                    f"joint {show(joint.name)}: unknown {end} link {show(link)}{hint}", node
                )
        if joint.parent == joint.child:
            raise source.error(
                f"joint {show(joint.name)} joins link {show(joint.child)} to itself", node
            )
        other = parent_joint.get(joint.child)
        if other is not None:
            raise source.error(
                f"link {show(joint.child)} has two parents, by joints {show(other.name)} and "
                f"{show(joint.name)}: a URDF is a tree, so take one joint out (a closed loop is "
                "declared in a loop file beside it)",
                node,
            )
        parent_joint[joint.child] = joint
    return _check_reach(links, joints, nodes, parent_joint, source)


def _check_reach(
    links: Sequence[str],
    joints: Sequence[JointEntry],
    nodes: Sequence[Node],
    parent_joint: dict[str, JointEntry],
    source: UrdfSource,
) -> str:
    roots = [link for link in links if link not in parent_joint]
    children = defaultdict(list)
    for joint in joints:
        children[joint.parent].append(joint.child)
    depth = dict.fromkeys(roots[:1], 0)
    queue = roots[:]
    for link in queue:
        for child in children[link]:
            depth[child] = depth.get(link, 0) + 1
            queue.append(child)
    if len(queue) < len(links):
        reached = set(queue)
        loop = _loop(next(link for link in links if link not in reached), parent_joint)
        named = ", ".join(show(joint.name) for joint in loop[:6]) + (", ..." if loop[6:] else "")
        raise source.error(
            f"joints {named} form a loop: a URDF is a tree, so take one out (a closed loop is "
            "declared in a loop file beside it)",
            nodes[joints.index(loop[0])],
        )
    if len(roots) > 1:
        named = ", ".join(show(link) for link in roots[:5]) + (", ..." if roots[5:] else "")
        raise source.error(
            f"{len(roots)} links have no parent ({named}): a URDF has one root, so join the others "
            "to it by joints, or remove them"
        )
    if max(depth.values()) > MAX_DEPTH:
        raise source.error(
            f"{max(depth.values())} joints in a row: at most {MAX_DEPTH} are supported"
        )
    return roots[0]


def _loop(link: str, parent_joint: dict[str, JointEntry]) -> list[JointEntry]:
    """Return the joints of the loop above a link that no root reaches."""
    seen: list[str] = []
    while link not in seen:
        seen.append(link)
        link = parent_joint[link].parent
    return [parent_joint[name] for name in reversed(seen[seen.index(link) :])]
