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
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pinsing._dataclass import dataclass
from pinsing._types import Array
from pinsing.description.catalog import CatalogEntry, locate_robot
from pinsing.description.urdf import MAX_DEPTH, MAX_IN_A_TREE
from pinsing.description.urdf_source import UrdfSource, show
from pinsing.description.xml_tree import MAX_BYTES, Node, parse_xml, read_bytes
from pinsing.errors import RobotFileError
from pinsing.robot.given import given_model

SUFFIXES = (".xml", ".mjcf")
_MOST_FILES = 100
_SMALLEST = 1e-6  # length of a direction

_SECTIONS = frozenset(
    [
        "compiler",
        "option",
        "size",
        "statistic",
        "visual",
        "default",
        "extension",
        "custom",
        "asset",
        "worldbody",
        "deformable",
        "contact",
        "tendon",
        "equality",
        "actuator",
        "sensor",
        "keyframe",
    ]
)
_STILL = frozenset({"inertial", "geom", "camera", "light", "plugin"})  # no pose depends on them
_READ_IN_BODIES = frozenset({"body", "frame", "joint", "freejoint", "site"})
_MAKES_BODIES = frozenset({"attach", "composite", "flexcomp", "replicate"})
_TURNS = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
_NUMBERS = {"pos": 3, "axis": 3, "range": 2, "ref": 1, "fromto": 6, **_TURNS}
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


def given_mujoco(robot: Any) -> tuple[pin.Model, Path, tuple[str, ...]] | None:
    """Return the model of a MuJoCo file, the file, and notes; None for everything else.

    Raises
    ------
    RobotFileError
        With file and line: a number that is missing or not finite, an element or attribute that is
        unknown, or one that makes bodies and is not supported.
    """
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
    return given_model(_MjcfReader(source, root).model), path, tuple(notes)


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
        if not path.is_relative_to(folder):
            raise self.error(
                f"{what} lies outside the folder of the model: copy the file into it", node
            )
        if path in self._seen:
            raise self.error(f"{what}: that file is included already: remove one", node)
        self._seen.add(path)
        if len(self._seen) > _MOST_FILES or depth > MAX_DEPTH:
            raise self.error(f"{what}: more than {_MOST_FILES} files: merge them", node)
        if not path.is_file():
            raise self.error(f"{what}: no such file beside the model: correct the name", node)
        data = read_bytes(path)
        self._left -= len(data)
        if self._left < 0:
            raise self.error(f"{what}: more than {MAX_BYTES // 2**20} MiB in all", node)
        root = parse_xml(data, path)
        for one in root.walk():
            self._files[id(one)] = path
        return root

    def check(self, node: Node, what: str) -> None:
        """Refuse attributes that are unknown, or whose value cannot be meant."""
        known = _ATTRIBUTES[node.tag]
        for name, value in node.attributes.items():
            if name not in known:
                raise self.error(
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
        if len(turns) > 1:
            raise self.error(f"{what}: {' and '.join(turns)} are both given: keep one", node)
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
    """Builds the model of a file.

    A joint with index i moves what follows by ``Trans(p) exp(axis q_i) exp(-axis ref) Trans(-p)``
    in the frame of its body; several joints of a body act in their order.
    """

    def __init__(self, source: _MjcfSource, root: Node) -> None:
        self.source, self.model = source, pin.Model()
        self.model.name = root.attributes.get("model", source.path.stem)
        self.degrees, self.autolimits, self.align = True, True, False
        self.sequence = "xyz"
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
                if name in world.attributes:
                    raise source.error(f"the world has a {name}: remove it", world)
            self._children(world, _Carried(0, 0, pin.SE3.Identity(), "main"), "the world", [])

    def _unknown(self, node: Node, parent: str) -> RobotFileError:
        return self.source.error(
            f"<{node.tag[:40]}> in <{parent}> is unknown: correct or remove it", node
        )

    def _compiler(self, node: Node) -> None:
        self.source.check(node, "the model")
        said = node.attributes
        if said.get("coordinate", "local") != "local":
            raise self.source.error(
                'only <compiler coordinate="local"> is supported: save the model with a current '
                "MuJoCo",
                node,
            )
        self.degrees = said.get("angle", "degree" if self.degrees else "radian") == "degree"
        self.autolimits = said.get("autolimits", "true" if self.autolimits else "false") == "true"
        self.align = said.get("alignfree", "true" if self.align else "false") == "true"
        self.sequence = said.get("eulerseq", self.sequence)
        if len(self.sequence) != 3 or set(self.sequence) - set("xyzXYZ"):
            raise self.source.error(
                f"<compiler eulerseq={show(self.sequence)}> must be three of x, y, z, X, Y, Z", node
            )

    def _default(self, node: Node, parent: str | None) -> None:
        self.source.check(node, "the defaults")
        name = node.attributes.get("class", "main" if parent is None else "")
        if not name:
            raise self.source.error('a <default> within another has no class="..."', node)
        if parent is not None and name in self.defaults:
            raise self.source.error(f"two defaults are of class {show(name)}: rename one", node)
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
        name = self._class(node, "class", what, childclass)
        return replace(
            node, attributes=_over(self.defaults[name].get(node.tag, {}), node.attributes)
        )

    def _class(self, node: Node, attribute: str, what: str, inherited: str) -> str:
        name = node.attributes.get(attribute, inherited)
        if name not in self.defaults:
            raise self.source.error(
                f"{what}: there is no default class {show(name)}: correct the name", node
            )
        return name

    def _name(self, node: Node, kind: str) -> str:
        name = node.attributes.get("name", "")
        if not name:
            number = len(self.names)
            while (name := f"{kind}_{number}") in self.given:
                number += 1
            self.given.add(name)
        if name == "universe":
            raise self.source.error(f"{kind} 'universe': the name is Pinocchio's own", node)
        kept = self.names.setdefault((kind, name), node)
        if kept is not node:
            raise self.source.error(f"two {kind}s are named {show(name)}: rename one", node)
        return name

    def _children(self, node: Node, at: _Carried, what: str, moved: list[Node]) -> None:
        """Add what a body holds; ``moved``: its joints, which `_body` has added."""
        if at.depth > MAX_DEPTH:
            raise self.source.error(f"{what}: bodies are nested too deeply", node)
        for child in node.children:
            if child.tag == "body":
                self._body(child, at)
            elif child.tag == "frame":
                self._children(child, self._within(child, at), what, moved)
            elif child.tag == "site":
                self._site(child, at)
            elif child.tag in _MAKES_BODIES:
                makes = _READ_IN_BODIES | _MAKES_BODIES
                if child.tag != "replicate" or any(n.tag in makes for n in list(child.walk())[1:]):
                    raise self.source.error(
                        f"{what}: <{child.tag}> is not supported: save the compiled model "
                        "(mujoco.mj_saveLastXML) and give that",
                        child,
                    )
            elif child.tag in ("joint", "freejoint"):
                if not any(child is joint for joint in moved):
                    raise self.source.error(f"{what} cannot move: remove its joint", child)
            elif child.tag not in _STILL:
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
        what, pose = f"body {show(name)}", within.pose
        joint, moved = at.joint, []
        for element, frame, childclass in self._joints(node, pin.SE3.Identity(), within.childclass):
            moved.append(element)
            joint, pose = self._joint(element, frame, childclass, joint, pose, at)
            at = replace(at, frame=self.model.nframes - 1)
        index = self.model.addFrame(
            pin.Frame(name, joint, at.frame, pose, pin.FrameType.BODY), False
        )
        self._children(node, replace(within, joint=joint, frame=index, pose=pose), what, moved)

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
        if element.tag == "freejoint":
            self.source.check(element, what)
            node, kind = element, "free"
        else:
            node = self._with_defaults(element, what, childclass)
            kind = node.attributes.get("type", "hinge")
        if self.model.njoints > MAX_IN_A_TREE:
            raise self.source.error(f"more than {MAX_IN_A_TREE} joints are not supported", element)
        if kind == "free":
            align = element.attributes.get("align", "auto")
            if align == "true" or (align == "auto" and self.align):
                raise self.source.error(
                    f"{what}: its body is aligned with its inertia, which is not read: set "
                    'align="false"',
                    element,
                )
            if at.joint or parent:
                raise self.source.error(
                    f"{what}: only a body of the world, without other joints, can be free", element
                )
            return self._added(
                parent, pin.JointModelFreeFlyer(), pose, name, at
            ), pin.SE3.Identity()
        place = frame * pin.SE3(np.eye(3), self._vector(node, "pos"))
        anchor = pin.SE3(np.eye(3), place.translation)
        if kind == "ball":
            index = self._added(parent, pin.JointModelSpherical(), pose * anchor, name, at)
            return index, anchor.inverse()
        if kind not in ("hinge", "slide"):
            raise self.source.error(
                f"{what}: unknown type {show(kind)}: it is hinge, slide, ball or free", element
            )
        axis = frame.rotation @ self._direction(node, "axis", what, (0.0, 0.0, 1.0))
        unit = math.radians(1.0) if kind == "hinge" and self.degrees else 1.0
        angle = math.radians if unit != 1.0 else float
        lower, upper = (angle(x) for x in self._range(node, element, what))
        shift = -angle(self._values(node, "ref", (0.0,))[0])
        letter = next((c for c, e in zip("XYZ", np.eye(3), strict=True) if (e == axis).all()), None)
        short, long = ("R", "Revolute") if kind == "hinge" else ("P", "Prismatic")
        model = (
            getattr(pin, f"JointModel{long}Unaligned")(axis)
            if letter is None
            else getattr(pin, f"JointModel{short}{letter}")()
        )
        index = self._added(parent, model, pose * anchor, name, at, lower, upper)
        back = (
            pin.SE3(pin.AngleAxis(shift, axis).matrix() if shift else np.eye(3), np.zeros(3))
            if kind == "hinge"
            else pin.SE3(np.eye(3), shift * axis)
        )
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
        n, m = joint.nv, joint.nq
        index = self.model.addJoint(
            parent, joint, place, name, np.full(n, math.inf), np.full(n, math.inf),
            np.full(m, lower), np.full(m, upper),
        )  # fmt: skip
        self.model.addJointFrame(index, at.frame)
        return int(index)

    def _range(self, node: Node, element: Node, what: str) -> tuple[float, float]:
        lower, upper = self._values(node, "range", (0.0, 0.0))
        limited = node.attributes.get("limited", "auto")
        if limited == "false" or (limited == "auto" and lower == upper == 0.0):
            return -math.inf, math.inf
        if limited == "auto" and not self.autolimits:
            raise self.source.error(
                f'{what} has a range, and autolimits is "false": add limited="true" or "false"',
                element,
            )
        if not lower < upper:
            raise self.source.error(
                f"{what}: <joint range> from {lower:g} to {upper:g}: give the lower limit first, "
                "and the upper one above it",
                element,
            )
        return lower, upper

    def _site(self, node: Node, at: _Carried) -> None:
        name = self._name(node, "site")
        what = f"site {show(name)}"
        node = self._with_defaults(node, what, at.childclass)
        if "mesh" in node.attributes:
            raise self.source.error(
                f"{what}: its pose depends on a mesh, which is not read: remove mesh", node
            )
        pose = at.pose * self._pose(node, what)
        self.model.addFrame(
            pin.Frame(name, at.joint, at.frame, pose, pin.FrameType.OP_FRAME), False
        )

    def _values(self, node: Node, name: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """The numbers of an attribute that `_MjcfSource.check` has seen."""
        if name not in node.attributes:
            return default
        return tuple(float(word) for word in node.attributes[name].split())

    def _vector(self, node: Node, name: str) -> Array:
        return np.array(self._values(node, name, (0.0, 0.0, 0.0)))

    def _direction(
        self, node: Node, name: str, what: str, default: tuple[float, ...] = ()
    ) -> Array:
        """The numbers of an attribute, three or four, as a unit vector."""
        return self._unit(np.array(self._values(node, name, default)), node, name, what)

    def _unit(self, vector: Array, node: Node, name: str, what: str) -> Array:
        norm = math.hypot(*vector)
        if norm < _SMALLEST:
            raise self.source.error(
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
            ends = np.array(self._values(node, "fromto", ())).reshape(2, 3)
            z = self._unit(ends[0] - ends[1], node, "fromto", what)
            return pin.SE3(_from_z(z), ends.mean(axis=0))
        return pin.SE3(self._rotation(node, what), self._vector(node, "pos"))

    def _rotation(self, node: Node, what: str) -> Array:
        """Rotation (3, 3) by whichever of the five ways it is given."""
        angle = math.radians if self.degrees else float
        if "quat" in node.attributes:
            w, x, y, z = self._direction(node, "quat", what)
            return np.array(pin.Quaternion(w, x, y, z).matrix())
        if "axisangle" in node.attributes:
            *axis, turn = self._values(node, "axisangle", ())
            unit = self._unit(np.array(axis), node, "axisangle", what)
            return np.array(pin.AngleAxis(angle(turn), unit).matrix())
        if "euler" in node.attributes:
            out = np.eye(3)
            turns = self._values(node, "euler", ())
            for letter, turn in zip(self.sequence, turns, strict=True):
                axis = np.eye(3)["xyz".index(letter.lower())]
                one = np.array(pin.AngleAxis(angle(turn), axis).matrix())
                # Small letters turn about axes that turn along, capitals about those of the parent.
                out = out @ one if letter.islower() else one @ out
            return out
        if "xyaxes" in node.attributes:
            first, second = np.array(self._values(node, "xyaxes", ())).reshape(2, 3)
            x = self._unit(first, node, "xyaxes", what)
            y = self._unit(second - x * (x @ second), node, "xyaxes", what)
            return np.column_stack([x, y, np.cross(x, y)])
        if "zaxis" in node.attributes:
            return _from_z(self._direction(node, "zaxis", what))
        return np.eye(3)


def _over(below: Mapping[str, str], above: Mapping[str, str]) -> dict[str, str]:
    """Attributes over those of a class; an orientation replaces one that is given otherwise."""
    drop = set(_TURNS) if any(name in above for name in _TURNS) else set()
    return {**{k: v for k, v in below.items() if k not in drop}, **above}


def _from_z(direction: Array) -> Array:
    """The least rotation (3, 3) that takes z to a unit vector; about x where it is -z."""
    cross = np.cross((0.0, 0.0, 1.0), direction)
    sine = math.hypot(*cross)
    axis = cross / sine if sine > 1e-10 else np.array([1.0, 0.0, 0.0])
    return np.array(pin.AngleAxis(math.atan2(sine, direction[2]), axis).matrix())
