"""Analyse the shelf of parallel mechanisms and set known results beside what was computed.

python scripts/bench/parallel.py [NAME ...]
python scripts/bench/parallel.py --write docs/parallel.md
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import yaml

import pinsing
from pinsing.mechanism import (
    home,
    joint_forms,
    loop_forms,
    mechanism_at,
    pose_forms,
    ranks,
)
from pinsing.mechanism.feasible import feasible
from pinsing.mechanism.forms_text import forms_text
from pinsing.mechanism.rods import why_no_rods
from pinsing.robot.mechanism import Mechanism

URDF = Path(__file__).resolve().parents[2] / "urdf"
SHELF = (
    "five_bar",
    "four_bar",
    "planar_3rrr",
    "planar_3rpr",
    "gough_stewart",
    "stewart_6_3",
    "griffis_duffy",
    "hexaglide",
    "rus6",
    "delta",
    "rps3",
    "agile_eye",
    "bennett",
    "rssr",
)
TOP = """# Parallel mechanisms

Made by `scripts/bench/parallel.py`. Each mechanism is a spanning tree with a loop file in `urdf/`;
those with a table (`NAME.mechanism.yaml`, `bennett.dh.yaml`) are made from it by
`scripts/generate_urdf.py`. `pinsing analyze urdf/NAME.urdf --loops urdf/NAME.loops.yaml` prints
more.

- A **mode** is a configuration up to flipped balls and universal joints; *ways* says how many such
  flips there are. Modes were sought from 400 random starts; the joint limits are those of the file.
- Equations are over the pose of the output where each leg passes one force: x, y, z in metres and
  a unit quaternion e0, e1, e2, e3 (scalar first); in the plane x, y, cos φ, sin φ; with inputs
  where a crank moves the inner end of a rod. "complete": every singular pose is on one of them,
  each step exact over the rationals, but for what the notes below them name: legs without length,
  and passive joints that move by themselves (a rod along the first axis of its universal joint),
  whose equations are those in the joint angles. Slides may be counted from anywhere in their
  stroke; a leg that is driven at its elbow is of type 1 where it is stretched or folded, an
  equation in the pose.
- Equations in the joint angles hold where the loops close: singular if and only if one is zero. A
  determinant has a row for each wrench that a leg passes on (force and moment about the origin of
  the base; in the plane fx, fy, mz; on the sphere the moment), in that leg's own angles.
- Where the legs are of another kind the matrices are those of the closure equations themselves,
  with a column for each passive joint (type 2), or each joint (type 1): singular if and only if the
  columns are dependent. So for loops that are overconstrained or welded, and redundant actuators.
- Certificates: `families NAME --loops --certificate NAME.json` writes one for each leg as an arm of
  its own, `pinsing verify` checks them. They prove where an actuator does no work on what its leg
  passes, or passive joints are dependent by themselves: rank conditions of one chain, which is what
  the checker reads. Type 2 has none: it is about several chains that the closure ties, of which the
  checker knows nothing; its equation is the rank condition itself, with no list of families that
  could be proven complete.
- A ball that is written as three hinges is a ball: where these lie in a plane (cos s1y = 0, say, a
  gimbal lock) the numbers are those of the ball, and no singularity is reported for it. The joint
  equations name the lock among passive joints that move by themselves, since the file's joints do.
- Legs may be written from the base or from the platform, cut at either end or at the elbow, in any
  plane; links that spin idly between two balls are held, joints without limits move without end.
  Of the 18 loop files of gepetto/example-parallel-robots (at 52e64b3) 14 have as many freedoms as
  motors. Of the others disney_robot's names joints that its URDF has not, disney_like's has a pin
  0.3 mm beside the ball that it would spin about, and the two kangaroos' loops were not closed, to
  0.08 and 0.03 (metres, radians) at best. Without limits and with many free balls an analysis takes
  minutes (cassie_like 110 s).
- Over the pose a leg passes one force along its rod, or across its slide where it is driven at the
  foot (RPR, RPS, UPS), and one more where it begins with a hinge; or the mechanism is a spherical
  3-RRR. Rods on rails or cranks whose output turns (hexaglide, 6-RUS, 3-PRS) have their equations
  in the pose and the inputs together, a determinant that is not multiplied out (tens of thousands
  of terms), with the lengths of the rods as the equations of closure: `families --loops --exact`
  and `--json` write both out. To eliminate the inputs would multiply all working modes (64 where
  there are six). A five-bar on slides, or one that is welded or closes at an elbow, in any plane,
  has its equations over the position of its pin and the inputs. Others have none: an output that
  turns on the base itself (RSSR), other loops that are welded, overconstrained ones (Bennett),
  redundant actuators, legs with a hinge at the platform (SPR): no determinant of lines of force
  from the feet is their condition. Theirs are those in the joint angles.
- Where algebra gives the number of modes it is said: the two solutions of each leg, three spheres,
  the triangle of three pins, one rod's quadratic equation, the real roots of a polynomial; "at
  most 40" and "at most 16" are bounds over the complex numbers. "found from 400 starts; more may
  exist" is no more than that.
- Maps: `pinsing map NAME --loops --over poses` (or `inputs`). Per second of processor time on one
  thread, with Pinocchio's constraint models one configuration after the other in brackets
  (`scripts/bench/mechanism_rate.py`, an idle machine): constraint and output Jacobians of 520,000
  configurations of the 3-RRR and 107,000 of the Gough-Stewart platform (58,000 and 37,000: 9.0 and
  2.9 times), with the measures 114,000 and 23,000 (10,700 and 3,600: 10.6 and 6.4 times; five-bar
  260,000, 21 times). Closing the loops of inputs drawn at random costs more: a map takes 13,600 and
  2,000 a second. Few inputs close a platform with long strokes: of 500 drawn for the Gough-Stewart
  platform 48 do, 290 cannot (two legs' ends would be too far apart or too near: proven), at 162
  four starts found nothing (sixty find six more). Those of the Griffis-Duffy platform that close it
  have no volume. The map says these numbers; `--over poses` draws where the output goes: 319 of 500
  within the limits, type 2 near at 17 of them.
- Slices through the workspace: `pinsing plot map NAME --loops --over x,y -o map.png`, one for each
  working mode. Coloured is what lies within all limits of joints: each aspect (no singular pose
  parts it) in a colour of its own, green and blue in the assembly mode of home, warm in the other.
  Blue lines are type 2, red ones type 1, broken ones limits; the rest of the pose is as at home.
  A mechanism of one freedom is drawn over its input.
- Modes side by side: `pinsing plot modes NAME --loops -o modes.png`; the output is red.

| mechanism | joints | closure equations, independent of written | degrees of freedom | actuated |
|---|---|---|---|---|
"""
IMAGES = URDF.parent / "docs" / "images"
SLICES = {
    "five_bar": "x,y",
    "four_bar": "",
    "planar_3rrr": "x,y",
    "planar_3rpr": "x,y",
    "gough_stewart": "x,yaw",
    "stewart_6_3": "z,pitch",
    "griffis_duffy": "x,y",
    "hexaglide": "y,yaw",
    "rus6": "x,yaw",
    "delta": "x,z",
    "rps3": "roll,pitch",
    "agile_eye": "roll,pitch",
    "bennett": "",
    "rssr": "",
}
"""Two coordinates of the pose of each; none where there is one freedom."""
BEYOND = {"gough_stewart", "planar_3rpr"}
Known = Callable[[Mechanism], Iterator[tuple[str, str]]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(SHELF))
    parser.add_argument("--write", type=Path, metavar="FILE.md")
    parser.add_argument("--pictures", action="store_true", help="make the pictures alone")
    options = parser.parse_args()
    if options.pictures:
        for name in options.names or SHELF:
            began = time.process_time()
            pictures(pinsing.load_mechanism(URDF / f"{name}.urdf"), name)
            print(f"{name}: {time.process_time() - began:.1f} s of processor time", flush=True)
        return
    rows, parts = [], []
    for name in options.names or SHELF:
        mechanism = pinsing.load_mechanism(URDF / f"{name}.urdf")
        found = ranks(mechanism)
        rows.append(
            f"| [{name}](#{name}) | {mechanism.n} | {found.constraint} of {mechanism.rows} | "
            f"{found.mobility} | {len(mechanism.actuated)} |\n"
        )
        parts.append(part(mechanism, name))
    text = TOP + "".join(rows) + "\n" + "\n".join(parts)
    if options.write is None:
        print(text)
    else:
        options.write.write_text(text, encoding="utf-8")


def part(mechanism: Mechanism, name: str) -> str:
    began = time.process_time()
    lines = [f"## {name}", "", source(name), ""]
    at = mechanism_at(mechanism, home(mechanism))
    lines.append(f"At home: {at.kind}.")
    lines.append("")
    for title, which in (("within the limits", mechanism), ("without", mechanism.without_limits())):
        direct = pinsing.assembly_modes(which)
        inverse = pinsing.working_modes(which)
        lines.append(f"- {title}: {direct.statement}; {inverse.statement}.{ways(direct)}")
    lines.append("")
    loops = loop_forms(mechanism)
    forms = pose_forms(mechanism) if loops is None else loops
    joints = joint_forms(mechanism)
    if forms is None:
        lines += [f"No closed form over the pose: {why_no_rods(mechanism)}.", ""]
    lines += ["```", forms_text(mechanism.inputs, forms, joints=joints, longest=1_500), "```", ""]
    lines += pictures(mechanism, name)
    known = KNOWN.get(name)
    if known is not None:
        lines += ["| known | computed |", "|---|---|"]
        lines += [f"| {claim} | {computed} |" for claim, computed in known(mechanism)]
        lines.append("")
    print(f"{name}: {time.process_time() - began:.1f} s of processor time")
    return "\n".join(lines)


def pictures(mechanism: Mechanism, name: str) -> list[str]:
    """A slice through the workspace by mode, and the modes side by side, as lines of Markdown."""
    import matplotlib as mpl

    mpl.use("agg")
    from pinsing.plot.mode_sheet import mode_sheet
    from pinsing.plot.motion_curve import motion_curve
    from pinsing.plot.pose_map import pose_maps
    from pinsing.report.pictures import png

    over = SLICES[name]
    if over:
        drawn, words = pose_maps(mechanism, over.split(",")), f"Aspects of a slice over {over}"
    else:
        drawn, words = motion_curve(mechanism).figure, "All poses, by assembly mode"
    # Where the limits leave one of several modes, all are shown.
    sheet = mode_sheet(mechanism.without_limits() if name in BEYOND else mechanism)
    lines = []
    for suffix, figure, alt in (
        ("", drawn, words), ("_modes", sheet, "Assembly and working modes")
    ):  # fmt: skip
        file = f"parallel_{name}{suffix}.png"
        (IMAGES / file).write_bytes(png(figure, 80))
        aside = ", limits left aside" if suffix and name in BEYOND else ""
        lines += [f"![{alt} of {name}{aside}](images/{file})", ""]
    return lines


def ways(found: pinsing.Modes) -> str:
    counts = sorted({s.ways for s in found.modes})
    if not counts or counts == [1]:
        return ""
    return f" Ways to assemble each mode: {', '.join(map(str, counts))}."


def source(name: str) -> str:
    for suffix in (".mechanism.yaml", ".loops.yaml"):
        path = URDF / f"{name}{suffix}"
        if path.is_file():
            return str(yaml.safe_load(path.read_text(encoding="utf-8")).get("source", "")).strip()
    return ""


def ratio(mechanism: Mechanism, pose: list[float]) -> str:
    """Type 2 measure at a pose, limits left aside."""
    found = pinsing.working_modes(mechanism.without_limits(), pose, starts=12)
    if not found.modes:
        return "not reached"
    at = mechanism_at(mechanism, found.modes[0].q)
    return f"{at.kind}, measure {at.input_ratio:.1e}"


def of_stewart(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    words = [str(x) for x in pose_forms(mechanism).everywhere]
    yield (
        "turned by ±90° about the vertical it is singular at every position (Fichter 1986)",
        "; ".join(words),
    )
    yield (
        "the same by Pinocchio at (0.1, -0.2, 0.9) m",
        ratio(mechanism, [0.1, -0.2, 0.9, 0, 0, np.pi / 2]),
    )
    yield "beside it, at 80°", ratio(mechanism, [0.1, -0.2, 0.9, 0, 0, np.radians(80)])
    locus = pose_forms(mechanism).loci[0].equation
    yield (
        "the locus is of degree 3 in the position (St-Onge and Gosselin 2000)",
        f"degree {locus.degree(('x', 'y', 'z'))}, {len(locus.values)} terms",
    )
    yield (
        "at most 40 assembly modes (Raghavan 1991, Lazard 1992)",
        str(len(pinsing.assembly_modes(mechanism.without_limits()).modes)) + " found",
    )


def of_griffis_duffy(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    yield (
        "singular at every pose, with self-motions (Husty and Karger 2000)",
        pose_forms(mechanism).architecture,
    )


def of_rods(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    two, *ones = pose_forms(mechanism).loci
    yield "type 2: the rod lines belong to one linear complex (Merlet 1989)", two.words
    for locus in ones[:1]:
        yield "type 1: a rod does no work on the motion of its foot", f"{locus.words}; and so on"


def of_3rpr(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    locus = pose_forms(mechanism).loci[0]
    yield (
        "type 2: the three leg lines meet in a point or are parallel; a conic at each angle",
        f"{locus.words}; degree {locus.equation.degree(('x', 'y'))} in x and y",
    )
    found = pinsing.assembly_modes(mechanism)
    yield "at most 6 assembly modes (Gosselin and Sefrioui 1991)", f"{len(found.modes)} found"


def of_delta(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    for locus in pose_forms(mechanism).loci[:2]:
        yield (
            "type 2: rods parallel to a plane, or two pairs parallel"
            if locus.kind == "type 2"
            else "constraint: the parallelograms no longer hold the orientation",
            f"{locus.kind}: {locus.words}",
        )


def of_bennett(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    yield "one degree of freedom, by Grübler's count -2", str(ranks(mechanism).mobility)
    alpha1, alpha2 = np.radians([30, 90])
    factor = np.sin((alpha2 + alpha1) / 2) / np.sin((alpha2 - alpha1) / 2)
    q = home(mechanism)
    yield (
        f"tan(q1/2) tan(q2/2) = sin((α2 + α1)/2) / sin((α2 - α1)/2) = {factor:.6f}",
        f"{np.tan(q[0] / 2) * np.tan(q[1] / 2):.6f} at home",
    )


def of_rssr(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    lengths = yaml.safe_load((URDF / "rssr.mechanism.yaml").read_text(encoding="utf-8"))
    pivot, arm = np.array(lengths["rocker_pivot"]), np.array(lengths["rocker_arm"])
    volumes, told = [], []
    for point in pinsing.analyze_mechanism(mechanism).points:
        crank, rocker = (point.q[mechanism.joints.index(n)] for n in ("crank", "rocker"))
        pin = lengths["crank"] * np.array([np.cos(crank), np.sin(crank), 0])
        c, s = np.cos(rocker), np.sin(rocker)
        end = pivot + lengths["rocker"] * (np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ arm)
        volumes.append(abs(np.cross(pin, end - pin)[2]))
        told.append(f"{crank:.6f}")
    yield (
        "dead centres of the rocker: the coupler's line meets the crank's axis",
        f"type 1 at crank = {', '.join(dict.fromkeys(told))} rad; coupler, crank and axis span "
        f"{max(volumes):.0e}",
    )


def of_loci(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    """Planar legs of two links: what is known of them, beside the words of the loci."""
    loops = loop_forms(mechanism)
    forms = pose_forms(mechanism) if loops is None else loops
    rods = len(mechanism.inputs)
    told = {}
    for locus in forms.loci:
        told.setdefault(locus.kind, []).append(locus.words)
    yield "type 1: a leg is stretched or folded", "; ".join(told["type 1"])
    known = "both rods are in line" if rods == 2 else "the lines of the rods meet or are parallel"
    yield f"type 2: {known} (Gosselin and Angeles 1990)", "; ".join(told["type 2"])


def of_four_bar(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    """Dead points by the law of cosines, from the lengths of the links."""
    at = mechanism.model.createData()
    pin.framesForwardKinematics(mechanism.model, at, mechanism.model_q(np.zeros(3)))
    place = {f.name: at.oMf[k].translation for k, f in enumerate(mechanism.model.frames)}
    A1, B1, A2 = (place[name] for name in ("crank", "coupler", "rocker"))
    crank, ground = np.linalg.norm(B1 - A1), np.linalg.norm(A2 - A1)
    coupler = np.linalg.norm(place["coupler_end"] - B1)
    rocker = np.linalg.norm(place["rocker_end"] - A2)
    ends = sorted([crank, coupler, rocker, ground])
    rest = f"{ends[0] + ends[3]:g} > {ends[1] + ends[2]:g} m"
    loci = {x.kind: x for x in loop_forms(mechanism).loci}
    told = {
        "type 2": ("coupler and rocker stretched", crank, coupler + rocker),
        "type 1": ("crank and coupler stretched", crank + coupler, rocker),
    }
    for kind, (words, near, far) in told.items():
        cosine = (near**2 + ground**2 - far**2) / (2 * near * ground)
        found = loci[kind].witness
        yield (
            f"{kind}, {words}: crank at ±{np.degrees(np.arccos(cosine)):.6f}° (law of cosines)",
            f"crank at {np.degrees(found.inputs[0]):.6f}°",
        )
    limits = feasible(mechanism, home(mechanism)[list(mechanism.actuated)])["crank"]
    yield (
        f"no link turns round, since shortest and longest together are longer ({rest}, Grashof)",
        "crank between "
        + f"{np.degrees(limits[0].lower):.6f}° and {np.degrees(limits[0].upper):.6f}°",
    )


def of_agile_eye(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    found = pinsing.assembly_modes(mechanism)
    yield "8 assembly modes (Gosselin, Sefrioui and Richard 1994)", found.statement
    found = pinsing.working_modes(mechanism)
    yield "8 working modes", found.statement
    notes = [x for x in joint_forms(mechanism).notes if "type 2 needs" in x]
    yield "all singular loci are joint values (compare Bonev and Gosselin 2005)", "; ".join(notes)


def of_rps(mechanism: Mechanism) -> Iterator[tuple[str, str]]:
    for locus in pose_forms(mechanism).loci:
        if locus.kind == "type 1":
            yield (
                "type 1 at yaw ±90°, by the motions that the hinges leave",
                f"{locus.words}: {locus.equation}",
            )


KNOWN: dict[str, Known] = {
    "gough_stewart": of_stewart,
    "stewart_6_3": of_stewart,
    "griffis_duffy": of_griffis_duffy,
    "hexaglide": of_rods,
    "rus6": of_rods,
    "planar_3rpr": of_3rpr,
    "delta": of_delta,
    "bennett": of_bennett,
    "rssr": of_rssr,
    "five_bar": of_loci,
    "four_bar": of_four_bar,
    "planar_3rrr": of_loci,
    "rps3": of_rps,
    "agile_eye": of_agile_eye,
}

if __name__ == "__main__":
    main()
