"""URDF and loop files of mechanisms, written from tables in the tests."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
ZERO = (0, 0, 0)


@dataclass(frozen=True)
class J:
    """A joint: name, link it hangs on, link it moves; its place, axis and limits."""

    name: str
    parent: str
    child: str
    at: Sequence[float] = ZERO
    axis: Sequence[float] = Z
    kind: str = "continuous"
    limits: tuple[float, float] | None = None
    rpy: Sequence[float] = ZERO
    more: str = ""


def row(values: Sequence[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


def urdf(joints: Sequence[J], name: str = "made") -> str:
    links = dict.fromkeys(x for j in joints for x in (j.parent, j.child))
    out = [f'<robot name="{name}">', *(f'<link name="{x}"/>' for x in links)]
    for j in joints:
        out.append(
            f'<joint name="{j.name}" type="{j.kind}"><parent link="{j.parent}"/>'
            f'<child link="{j.child}"/><origin xyz="{row(j.at)}" rpy="{row(j.rpy)}"/>'
        )
        if j.kind != "fixed":
            out.append(f'<axis xyz="{row(j.axis)}"/>')
        if j.limits is not None:
            low, high = j.limits
            out.append(f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/>')
        out.append(f"{j.more}</joint>")
    return "\n".join([*out, "</robot>"])


def frame(name: str, link: str, at: Sequence[float]) -> J:
    """A link of its own that is fixed to another."""
    return J(f"at_{name}", link, name, at, kind="fixed")


def chain_text(
    rows: Sequence[tuple[Any, ...]], limits: tuple[float, float] = (-3, 3), name: str = "made"
) -> str:
    """Joints j1, ... and links l0, ...: kind, place, then axis, rpy and what else stands in it."""
    made = []
    for k, (kind, at, *rest) in enumerate(rows, 1):
        axis, rpy, more = (*rest, *(Z, ZERO, "")[len(rest) :])
        ends = None if kind == "fixed" else limits
        made.append(J(f"j{k}", f"l{k - 1}", f"l{k}", at, axis, kind, ends, rpy, more))
    return urdf(made, name)


def follows(leader: int, multiplier: float, offset: float = 0.0) -> str:
    """What makes a joint of such a chain a follower."""
    return f'<mimic joint="j{leader}" multiplier="{multiplier}" offset="{offset}"/>'


def loop_text(
    loops: Sequence[tuple[str, str]],
    inputs: Sequence[str],
    output: str = "",
    rows: str = "vx, vy, vz, wx, wy, wz",
    kind: str = "3d",
    home: dict[str, float] | None = None,
) -> str:
    text = f"closed_loop: [{', '.join(f'[{a}, {b}]' for a, b in loops)}]\n"
    text += f"type: [{', '.join([kind] * len(loops))}]\nname_mot: [{', '.join(inputs)}]\n"
    if output:
        text += f"output: {{frame: {output}, rows: [{rows}]}}\n"
    if home:
        text += f"home: {{{', '.join(f'{k}: {float(v)!r}' for k, v in home.items())}}}\n"
    return text


def written(folder: Path, joints: Sequence[J], loops: str, name: str = "made") -> Path:
    """Both files; the path of the first."""
    (folder / f"{name}.loops.yaml").write_text(loops)
    path = folder / f"{name}.urdf"
    path.write_text(urdf(joints, name))
    return path


def five_bar(feet: Sequence[float], crank: float, rod: float) -> list[J]:
    """Cranks ``q1`` and ``q2`` on x, and rods on elbows ``b1`` and ``b2`` to frames P1 and P2."""
    joints = []
    for k, foot in enumerate(feet, 1):
        joints.append(J(f"q{k}", "base", f"crank{k}", (foot, 0, 0)))
        joints.append(J(f"b{k}", f"crank{k}", f"rod{k}", (crank, 0, 0)))
        joints.append(frame(f"P{k}", f"rod{k}", (rod, 0, 0)))
    return joints


def ball(name: str, parent: str, child: str, at: Sequence[float] = ZERO, axes: str = "xyz"):
    """Three hinges in a point."""
    links = [parent, f"{name}_1", f"{name}_2", child]
    return [
        J(f"{name}{a}", links[k], links[k + 1], at if k == 0 else ZERO, {"x": X, "y": Y, "z": Z}[a])
        for k, a in enumerate(axes)
    ]


def carried(legs: Sequence[list[J]], ends: np.ndarray, whole: str = "") -> tuple[list[J], list]:
    """Joints and loops of a platform whose points ``ends`` are on legs, each its own joints.

    The first leg carries it by a hinge or, ``whole``, by a ball of that name, the others by loops.
    """
    ends = np.array([(*p, 0.0)[:3] for p in np.asarray(ends, dtype=float)])
    joints, loops = [], []
    for k, leg in enumerate(legs):
        tip = leg[-1].child
        joints += leg
        if k:
            joints.append(frame(f"on{k}", "platform", ends[k] - ends[0]))
            loops.append((tip, f"on{k}"))
        else:
            joints += ball(whole, tip, "platform") if whole else [J("turn", tip, "platform")]
    return [*joints, frame("out", "platform", -ends[0])], loops


def stewart(
    base: np.ndarray,
    platform: np.ndarray,
    spin: bool = False,
    hanging: Sequence[int] = (),
    limits: tuple[float, float] | None = (0.1, 5.0),
    axes: str = "xyz",
    driven: Sequence[str] = (),
) -> tuple[list[J], str]:
    """A platform on six legs: 6-UPS, or 6-SPS with ``spin``; some legs written from the platform.

    The first leg carries the platform, with its frame ``out``. Its slides are driven by default.
    """

    def leg(k: int, link: str, at: np.ndarray, along: Sequence[float]) -> list[J]:
        cross = [J(f"u{k}x", link, f"cross{k}", at, X), J(f"u{k}y", f"cross{k}", f"top{k}", axis=Y)]
        joint = ball(f"u{k}", link, f"top{k}", at, axes) if spin and k not in hanging else cross
        return [*joint, J(f"p{k}", f"top{k}", f"rod{k}", ZERO, along, "prismatic", limits)]

    standing = [k for k in range(len(base)) if k not in hanging]
    legs = [leg(k, "base", base[k], Z) for k in standing]
    out, loops = carried(legs, platform[standing], "w")
    for k in hanging:
        out += leg(k, "platform", platform[k] - platform[0], (0, 0, -1))
        out.append(frame(f"a{k}", "base", base[k]))
        loops.append((f"rod{k}", f"a{k}"))
    slides = [f"p{k}" for k in range(len(base))]
    return out, loop_text(loops, driven or slides, "out", home=dict.fromkeys(slides, 1.0))
