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


def ball(name: str, parent: str, child: str, at: Sequence[float] = ZERO, axes: str = "xyz"):
    """Three hinges in a point."""
    links = [parent, f"{name}_1", f"{name}_2", child]
    return [
        J(f"{name}{a}", links[k], links[k + 1], at if k == 0 else ZERO, {"x": X, "y": Y, "z": Z}[a])
        for k, a in enumerate(axes)
    ]


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
    out: list[J] = []
    loops = []
    for k in range(len(base)):
        if k in hanging:
            continue
        if spin:
            out += ball(f"u{k}", "base", f"top{k}", base[k], axes)
        else:
            out.append(J(f"u{k}x", "base", f"cross{k}", base[k], X))
            out.append(J(f"u{k}y", f"cross{k}", f"top{k}", ZERO, Y))
        out.append(J(f"p{k}", f"top{k}", f"rod{k}", ZERO, Z, "prismatic", limits))
        if k == 0:
            out += ball("w", "rod0", "platform")
        else:
            out.append(frame(f"b{k}", "platform", platform[k] - platform[0]))
            loops.append((f"rod{k}", f"b{k}"))
    for k in hanging:
        out.append(J(f"u{k}x", "platform", f"cross{k}", platform[k] - platform[0], X))
        out.append(J(f"u{k}y", f"cross{k}", f"top{k}", ZERO, Y))
        out.append(J(f"p{k}", f"top{k}", f"rod{k}", ZERO, (0, 0, -1), "prismatic", limits))
        out.append(frame(f"a{k}", "base", base[k]))
        loops.append((f"rod{k}", f"a{k}"))
    out.append(frame("out", "platform", -platform[0]))
    slides = [f"p{k}" for k in range(len(base))]
    return out, loop_text(loops, driven or slides, "out", home=dict.fromkeys(slides, 1.0))
