"""A MuJoCo model (MJCF) -> pin.Model: bodies, joints and sites, every number checked.

Pinocchio has a parser of its own. It takes broken numbers for zero or for what the memory holds,
passes over ``<include>``, ``<frame>`` and whatever else makes bodies, and shifts limits by ``ref``.
So the file is read here. Source of the format: MuJoCo's XML reference and modeling guide. Whatever
changes kinematics is read or refused by name; geometry, inertia, contacts and drives are not read.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing.description.catalog import CatalogEntry, locate_robot
from pinsing.description.urdf import MAX_DEPTH, MAX_IN_A_TREE
from pinsing.description.xml_tree import MAX_BYTES, Node, UrdfSource, parse_xml, read_bytes, show
from pinsing.errors import RobotFileError
from pinsing.measures import Array
from pinsing.robot.arm import Given

SUFFIXES = (".xml", ".mjcf")

_SECTION_NAMES = (
    "compiler option size statistic visual default extension custom asset worldbody deformable "
    "contact tendon equality actuator sensor keyframe"
)
_SECTIONS = frozenset(_SECTION_NAMES.split())
_STILL = frozenset({"inertial", "geom", "camera", "light", "plugin"})  # no pose depends on them
_MAKE_BODIES = frozenset({"attach", "composite", "flexcomp", "replicate"})
_MAKE_POSES = _MAKE_BODIES | {"body", "frame", "joint", "freejoint", "site"}
_TURNS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
_NUMBERS = {
    "ref": 1,
    "range": 2,
    **dict.fromkeys(("pos", "axis", "euler", "zaxis"), 3),
    **dict.fromkeys(("quat", "axisangle"), 4),
    **dict.fromkeys(("xyaxes", "fromto"), 6),
}
_WORDS = {
    "angle": ("degree", "radian"),
    "autolimits": ("true", "false"),
    "alignfree": ("true", "false"),
    "limited": ("true", "false", "auto"),
    "align": ("true", "false", "auto"),
}
_POSE = f"pos {' '.join(_TURNS)}"
_ATTRIBUTES = {
    tag: frozenset(names.split())
    for tag, names in {
        "compiler": "alignfree angle assetdir autolimits balanceinertia boundinertia boundmass "
        "conflict coordinate discardvisual eulerseq exactmeshinertia fitaabb fusestatic "
        "inertiafromgeom inertiagrouprange meshdir passthrough savecanonical savecompiled "
        "saveinertial settotalmass strippath texturedir usethread convexhull",
        "default": "class",
        "include": "file",
        "worldbody": f"name childclass {_POSE}",
        "body": f"name childclass fuse gravcomp mocap simple sleep user {_POSE}",
        "frame": f"name childclass {_POSE}",
        "joint": "name class type group pos axis range ref limited actuatorfrclimited "
        "actuatorfrcrange actuatorgravcomp armature damping frictionloss margin solimpfriction "
        "solimplimit solreffriction solreflimit springdamper springref springyield stiffness user",
        "freejoint": "name group align",
        "site": f"name class type group size rgba material mesh fromto user {_POSE}",
    }.items()
}


def given_mujoco(robot: Any) -> Given | None:
    """Return the robot of a MuJoCo file; None for everything else."""
    if not isinstance(robot, str | os.PathLike) or str(robot).lstrip().startswith("<"):
        return None
    if not str(robot).lower().endswith(SUFFIXES) and not str(robot).startswith("rd:"):
        return None
    found = locate_robot(robot if isinstance(robot, str) else Path(robot))
    path = found.path if isinstance(found, CatalogEntry) else found
    if path.suffix.lower() not in SUFFIXES:
        return None
    root = parse_xml(read_bytes(path), path)
    if root.tag != "mujoco":
        return None
    source = _MjcfSource(path)
    root = source.included(root)
    notes = ["read from a MuJoCo model; its meshes are not drawn"]
    if any(node.children for node in root.all("equality")):
        notes.append(
            "equality constraints of the MuJoCo model (coupled joints, closed loops) are left out"
        )
    model = _MjcfReader(source, root).model
    source.check_name(model.name, "the model", root)
    return Given(model, str(robot), model.name or path.stem, path, notes=tuple(notes))


class _MjcfSource(UrdfSource):
    """A model's file and those that it includes: errors name the one that a node is of."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._files: dict[int, Path] = {}
        self._seen = {path.resolve()}
        self._left = MAX_BYTES

    def error(self, problem: str, node: Node | None = None) -> RobotFileError:
        """Return an error at the line of a node."""
        if node is None:
            return super().error(problem)
        return RobotFileError(problem, self._files.get(id(node), self.path), node.line)

    def included(self, node: Node, depth: int = 0) -> Node:
        """Return a node with what it includes in place; each file at most once, as in MuJoCo."""
        children: list[Node] = []
        for child in node.children:
            if child.tag == "include":
                children += self.included(self._read(child, depth), depth + 1).children
            else:
                children.append(self.included(child, depth + 1))
        node.children = children
        return node

    def _read(self, node: Node, depth: int) -> Node:
        self.check(node, "the model")
        name = self.attribute(node, "file", "the model")
        what = f"<include file={show(name)}>"
        try:
            folder, path = self.path.parent.resolve(), (self.path.parent / name).resolve()
        except (OSError, RuntimeError, ValueError):
            raise self.error(f"{what}: is no file name: correct it", node) from None
        self.refuse_if(
            not path.is_relative_to(folder),
            f"{what} lies outside the folder of the model: copy the file into it",
            node,
        )
        self.refuse_if(
            path in self._seen, f"{what}: that file is included already: remove one", node
        )
        self._seen.add(path)
        self.refuse_if(
            len(self._seen) > 100 or depth > MAX_DEPTH,
            f"{what}: more than 100 files: merge them",
            node,
        )
        self.refuse_if(
            not path.is_file(), f"{what}: no such file beside the model: correct the name", node
        )
        data = read_bytes(path)
        self._left -= len(data)
        self.refuse_if(self._left < 0, f"{what}: more than {MAX_BYTES // 2**20} MiB in all", node)
        root = parse_xml(data, path)
        for one in root.walk():
            self._files[id(one)] = path
        return root

    def check(self, node: Node, what: str) -> None:
        """Refuse attributes that are unknown, or whose value cannot be meant."""
        known = _ATTRIBUTES[node.tag]
        for name, value in node.attributes.items():
            self.refuse_if(
                name not in known,
                f"{what}: <{node.tag}> has no attribute {show(name)}: correct or remove it "
                f"(it has {', '.join(sorted(known))})",
                node,
            )
            if name in _NUMBERS:
                self.numbers(node, name, _NUMBERS[name], what)
            elif name in _WORDS and value not in _WORDS[name]:
                raise self.error(
                    f"{what}: <{node.tag} {name}={show(value)}> must be "
                    f"{' or '.join(_WORDS[name])}",
                    node,
                )
        turns = [name for name in _TURNS if name in node.attributes]
        self.refuse_if(
            len(turns) > 1, f"{what}: {' and '.join(turns)} are both given: keep one", node
        )
        if "name" in node.attributes:
            self.check_name(node.attributes["name"], what, node)


@dataclass(frozen=True)
class _Carried:
    """Where elements are: what carries them, and the pose of their parent on it."""

    joint: int
    frame: int
    pose: pin.SE3
    childclass: str
    depth: int = 0


class _MjcfReader:
    """Builds the model of a file; joint i acts as ``Trans(p) exp(axis (q_i - ref)) Trans(-p)``."""

    def __init__(self, source: _MjcfSource, root: Node) -> None:
        self.source, self.model = source, pin.Model()
        self.model.name = root.attributes.get("model", source.path.stem)
        self.compiler = {"angle": "degree", "autolimits": "true", "alignfree": "false"}
        self.compiler |= {"eulerseq": "xyz", "coordinate": "local"}
        self.defaults: dict[str, dict[str, Mapping[str, str]]] = {"main": {}}
        self.names: dict[tuple[str, str], Node] = {}
        for section in root.children:
            if section.tag not in _SECTIONS:
                raise self._unknown(section, "mujoco")
        for section in root.all("compiler"):
            self._compiler(section)
        for section in root.all("default"):
            self._default(section, None)
        worlds = root.all("worldbody")
        self.given = {n.attributes.get("name", "") for w in worlds for n in w.walk()}
        for world in worlds:
            source.check(world, "the world")
            for name in ("pos", *_TURNS):
                source.refuse_if(
                    name in world.attributes, f"the world has a {name}: remove it", world
                )
            self._children(world, _Carried(0, 0, pin.SE3.Identity(), "main"), "the world")

    def _unknown(self, node: Node, parent: str) -> RobotFileError:
        problem = f"<{node.tag[:40]}> in <{parent}> is unknown: correct or remove it"
        return self.source.error(problem, node)

    def _compiler(self, node: Node) -> None:
        self.source.check(node, "the model")
        self.compiler |= node.attributes
        self.source.refuse_if(
            self.compiler["coordinate"] != "local",
            'only <compiler coordinate="local"> is supported: save the model with a current MuJoCo',
            node,
        )
        sequence = self.compiler["eulerseq"]
        self.source.refuse_if(
            len(sequence) != 3 or set(sequence) - set("xyzXYZ"),
            f"<compiler eulerseq={show(sequence)}> must be three of x, y, z, X, Y, Z",
            node,
        )

    def _angle(self, value: float) -> float:
        return math.radians(value) if self.compiler["angle"] == "degree" else float(value)

    def _default(self, node: Node, parent: str | None) -> None:
        self.source.check(node, "the defaults")
        name = node.attributes.get("class", "main" if parent is None else "")
        self.source.refuse_if(not name, 'a <default> within another has no class="..."', node)
        self.source.refuse_if(
            parent is not None and name in self.defaults,
            f"two defaults are of class {show(name)}: rename one",
            node,
        )
        if parent is None and name != "main":  # MuJoCo's name for the same
            self.defaults[name] = self.defaults["main"]
        made = self.defaults.setdefault(name, dict(self.defaults[parent or "main"]))
        for child in node.children:
            if child.tag in ("joint", "site"):
                self.source.check(child, f"the defaults of class {show(name)}")
                made[child.tag] = _over(made.get(child.tag, {}), child.attributes)
        for child in node.all("default"):
            self._default(child, name)

    def _with_defaults(self, node: Node, what: str, childclass: str) -> Node:
        """A checked copy of an element, with the attributes of its class."""
        self.source.check(node, what)
        inherited = self.defaults[self._class(node, "class", what, childclass)]
        return replace(node, attributes=_over(inherited.get(node.tag, {}), node.attributes))

    def _class(self, node: Node, attribute: str, what: str, inherited: str) -> str:
        name = node.attributes.get(attribute, inherited)
        self.source.refuse_if(
            name not in self.defaults,
            f"{what}: there is no default class {show(name)}: correct the name",
            node,
        )
        return name

    def _name(self, node: Node, kind: str) -> str:
        if not (name := node.attributes.get("name", "")):
            number = len(self.names)
            while (name := f"{kind}_{number}") in self.given:
                number += 1
            self.given.add(name)
        self.source.refuse_if(
            name == "universe", f"{kind} 'universe': the name is Pinocchio's own", node
        )
        self.source.refuse_if(
            self.names.setdefault((kind, name), node) is not node,
            f"another {kind} is named {show(name)}, too: rename one",
            node,
        )
        return name

    def _children(self, node: Node, at: _Carried, what: str) -> None:
        """Add what a body holds, but for its joints."""
        self.source.refuse_if(at.depth > MAX_DEPTH, f"{what}: bodies are nested too deeply", node)
        for child in node.children:
            match child.tag:
                case "body":
                    self._body(child, at)
                case "frame":
                    self._children(child, self._within(child, at), what)
                case "site":
                    self._site(child, at)
                case "joint" | "freejoint":  # of a body they are added before all else
                    self.source.refuse_if(
                        not at.joint, f"{what} cannot move: remove its joint", child
                    )
                case "replicate" if not any(n.tag in _MAKE_POSES for n in [*child.walk()][1:]):
                    pass
                case tag if tag in _MAKE_BODIES:
                    raise self.source.error(
                        f"{what}: <{tag}> is not supported: save the compiled model "
                        "(mujoco.mj_saveLastXML) and give that",
                        child,
                    )
                case tag if tag not in _STILL:
                    raise self._unknown(child, node.tag)

    def _within(self, node: Node, at: _Carried) -> _Carried:
        what = f"{node.tag} {show(node.attributes.get('name', ''))}"
        self.source.check(node, what)
        return replace(
            at,
            pose=at.pose * self._pose(node, what),
            childclass=self._class(node, "childclass", what, at.childclass),
            depth=at.depth + 1,
        )

    def _body(self, node: Node, at: _Carried) -> None:
        within = self._within(node, at)
        name = self._name(node, "body")
        joint, pose = at.joint, within.pose
        for element, frame, childclass in self._joints(node, pin.SE3.Identity(), within.childclass):
            joint, pose = self._joint(element, frame, childclass, joint, pose, at)
            at = replace(at, frame=self.model.nframes - 1)
        index = self._framed(name, replace(at, joint=joint), pose, pin.FrameType.BODY)
        inner = replace(within, joint=joint, frame=index, pose=pose)
        self._children(node, inner, f"body {show(name)}")

    def _framed(self, name: str, at: _Carried, pose: pin.SE3, kind: pin.FrameType) -> int:
        return int(self.model.addFrame(pin.Frame(name, at.joint, at.frame, pose, kind), False))

    def _joints(
        self, node: Node, frame: pin.SE3, childclass: str
    ) -> Iterator[tuple[Node, pin.SE3, str]]:
        """Yield the joints of a body, with the frames around them and the class they inherit."""
        for child in node.children:
            if child.tag in ("joint", "freejoint"):
                yield child, frame, childclass
            elif child.tag == "frame":
                inner = self._within(child, _Carried(0, 0, frame, childclass))
                yield from self._joints(child, inner.pose, inner.childclass)

    def _joint(
        self,
        element: Node,
        frame: pin.SE3,
        childclass: str,
        parent: int,
        pose: pin.SE3,
        at: _Carried,
    ) -> tuple[int, pin.SE3]:
        """Add a joint; return its index, and the pose of the body on what it moves."""
        name = self._name(element, "joint")
        what = f"joint {show(name)}"
        node = self._with_defaults(element, what, childclass)
        kind = "free" if node.tag == "freejoint" else node.attributes.get("type", "hinge")
        self.source.refuse_if(
            self.model.njoints > MAX_IN_A_TREE,
            f"more than {MAX_IN_A_TREE} joints are not supported",
            element,
        )
        if kind == "free":
            align = element.attributes.get("align", "auto")
            self.source.refuse_if(
                align == "true" or (align == "auto" and self.compiler["alignfree"] == "true"),
                f"{what}: its body is aligned with its inertia, which is not read: set "
                'align="false"',
                element,
            )
            self.source.refuse_if(
                at.joint or parent,
                f"{what}: only a body of the world, without other joints, can be free",
                element,
            )
            index = self._added(parent, pin.JointModelFreeFlyer(), pose, name, at)
            return index, pin.SE3.Identity()
        place = frame * pin.SE3(np.eye(3), self._values(node, "pos", (0.0, 0.0, 0.0)))
        anchor = pin.SE3(np.eye(3), place.translation)
        if kind == "ball":
            index = self._added(parent, pin.JointModelSpherical(), pose * anchor, name, at)
            return index, anchor.inverse()
        self.source.refuse_if(
            kind not in ("hinge", "slide"),
            f"{what}: unknown type {show(kind)}: it is hinge, slide, ball or free",
            element,
        )
        direction = self._values(node, "axis", (0.0, 0.0, 1.0))
        axis = frame.rotation @ self._unit(direction, node, "axis", what)
        unit = self._angle if kind == "hinge" else float
        lower, upper = (unit(x) for x in self._range(node, element, what))
        shift = -unit(self._values(node, "ref", (0.0,))[0])
        aligned = [letter for letter, e in zip("XYZ", np.eye(3), strict=True) if (e == axis).all()]
        short, long = ("R", "Revolute") if kind == "hinge" else ("P", "Prismatic")
        made = (
            getattr(pin, f"JointModel{short}{aligned[0]}")()
            if aligned
            else getattr(pin, f"JointModel{long}Unaligned")(axis)
        )
        index = self._added(parent, made, pose * anchor, name, at, lower, upper)
        back = pin.SE3.Identity()
        if kind == "slide":
            back.translation = shift * axis
        elif shift:
            back.rotation = _about(axis, shift)
        return index, back * anchor.inverse()

    def _added(
        self,
        parent: int,
        joint: Any,
        place: pin.SE3,
        name: str,
        at: _Carried,
        lower: float = -math.inf,
        upper: float = math.inf,
    ) -> int:
        most = np.full(joint.nv, math.inf)
        limits = np.full(joint.nq, lower), np.full(joint.nq, upper)
        index = self.model.addJoint(parent, joint, place, name, most, most, *limits)
        self.model.addJointFrame(index, at.frame)
        return int(index)

    def _range(self, node: Node, element: Node, what: str) -> tuple[float, float]:
        lower, upper = self._values(node, "range", (0.0, 0.0)).tolist()
        limited = node.attributes.get("limited", "auto")
        if limited == "false" or (limited == "auto" and lower == upper == 0.0):
            return -math.inf, math.inf
        self.source.refuse_if(
            limited == "auto" and self.compiler["autolimits"] == "false",
            f'{what} has a range, and autolimits is "false": add limited="true" or "false"',
            element,
        )
        self.source.refuse_if(
            "range" not in node.attributes, f"{what} is limited, but has no range", element
        )
        self.source.refuse_if(
            not lower < upper,
            f"{what}: <joint range> from {lower:g} to {upper:g}: give the lower limit first, "
            "and the upper one above it",
            element,
        )
        return lower, upper

    def _site(self, node: Node, at: _Carried) -> None:
        name = self._name(node, "site")
        what = f"site {show(name)}"
        node = self._with_defaults(node, what, at.childclass)
        self.source.refuse_if(
            "mesh" in node.attributes,
            f"{what}: its pose depends on a mesh, which is not read: remove mesh",
            node,
        )
        self._framed(name, at, at.pose * self._pose(node, what), pin.FrameType.OP_FRAME)

    def _values(self, node: Node, name: str, default: tuple[float, ...] = ()) -> Array:
        """The numbers of an attribute that `_MjcfSource.check` has seen."""
        words = node.attributes[name].split() if name in node.attributes else default
        return np.array([float(word) for word in words])

    def _unit(self, vector: Array, node: Node, name: str, what: str) -> Array:
        norm = math.hypot(*vector)
        self.source.refuse_if(
            norm < 1e-6,
            f"{what}: <{node.tag} {name}> has no direction: give numbers that are not zero",
            node,
        )
        return vector if norm == 1.0 else np.asarray(vector / norm)

    def _pose(self, node: Node, what: str) -> pin.SE3:
        if "fromto" in node.attributes:
            both = [name for name in ("pos", *_TURNS) if name in node.attributes]
            if both:
                raise self.source.error(
                    f"{what}: fromto and {both[0]} are both given: keep one", node
                )
            ends = self._values(node, "fromto").reshape(2, 3)
            z = self._unit(ends[0] - ends[1], node, "fromto", what)
            return pin.SE3(_from_z(z), ends.mean(axis=0))
        return pin.SE3(self._rotation(node, what), self._values(node, "pos", (0.0, 0.0, 0.0)))

    def _rotation(self, node: Node, what: str) -> Array:
        """Rotation (3, 3) by whichever of the five ways it is given."""
        name = next((name for name in _TURNS if name in node.attributes), "")
        given = self._values(node, name)
        match name:
            case "quat":
                w, x, y, z = self._unit(given, node, name, what)
                return np.array(pin.Quaternion(w, x, y, z).matrix())
            case "axisangle":
                return _about(self._unit(given[:3], node, name, what), self._angle(given[3]))
            case "euler":
                out = np.eye(3)
                for letter, turn in zip(self.compiler["eulerseq"], given, strict=True):
                    one = _about(np.eye(3)["xyz".index(letter.lower())], self._angle(turn))
                    # Small letters turn about axes that turn along, capitals about the parent's.
                    out = out @ one if letter.islower() else one @ out
                return out
            case "xyaxes":
                x = self._unit(given[:3], node, name, what)
                y = self._unit(given[3:] - x * (x @ given[3:]), node, name, what)
                return np.column_stack([x, y, np.cross(x, y)])
            case "zaxis":
                return _from_z(self._unit(given, node, name, what))
        return np.eye(3)


def _about(axis: Array, angle: float) -> Array:
    return np.array(pin.AngleAxis(float(angle), axis).matrix())


def _over(below: Mapping[str, str], above: Mapping[str, str]) -> dict[str, str]:
    """Attributes over those of a class; an orientation replaces one that is given otherwise."""
    drop = set(_TURNS) if any(name in above for name in _TURNS) else set()
    return {**{k: v for k, v in below.items() if k not in drop}, **above}


def _from_z(direction: Array) -> Array:
    """The least rotation (3, 3) that takes z to a unit vector; about x where it is -z."""
    cross = np.cross((0.0, 0.0, 1.0), direction)
    sine = math.hypot(*cross)
    axis = cross / sine if sine > 1e-10 else np.array([1.0, 0.0, 0.0])
    return _about(axis, math.atan2(sine, direction[2]))
