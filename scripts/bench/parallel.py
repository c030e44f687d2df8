"""Analyse the shelf of parallel mechanisms and set known results beside what was computed.

python scripts/bench/parallel.py [NAME ...]
python scripts/bench/parallel.py --write
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import yaml

import pinsing
from pinsing.loops import home, joint_forms, loop_forms, mechanism_at, pose_forms, ranks
from pinsing.loops.solve import feasible
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
PAGE = URDF.parent / "docs" / "parallel.md"
TABLE = """| mechanism | joints | closure equations, independent of written | degrees of freedom \
| actuated | at home | assembly modes | working modes |
|---|---:|---|---:|---:|---|---|---|
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
    parser.add_argument("--write", action="store_true", help="into docs/parallel.md")
    parser.add_argument("--pictures", action="store_true", help="make the pictures alone")
    options = parser.parse_args()
    if options.pictures:
        for name in options.names or SHELF:
            began = time.process_time()
            pictures(pinsing.load_mechanism(URDF / f"{name}.urdf"), name)
            print(f"{name}: {time.process_time() - began:.1f} s of processor time", flush=True)
        return
    rows, known, drawn = [], [], []
    for name in options.names or SHELF:
        began = time.process_time()
        mechanism = pinsing.load_mechanism(URDF / f"{name}.urdf")
        found, at = ranks(mechanism), mechanism_at(mechanism, home(mechanism))
        direct, inverse = (
            pinsing.loops.assembly_modes(mechanism),
            pinsing.loops.working_modes(mechanism),
        )
        rows.append(
            f"| {name} | {mechanism.n} | {found.constraint} of {mechanism.rows} | {found.mobility} "
            f"| {len(mechanism.actuated)} | {at.kind} | {count(direct)} | {count(inverse)} |\n"
        )
        claims = KNOWN[name](mechanism) if name in KNOWN else ()
        known += [f"| {name} | {claim} | {computed} |\n" for claim, computed in claims]
        drawn += [f"## {name}", "", source(name), "", *pictures(mechanism, name)]
        print(f"{name}: {time.process_time() - began:.1f} s of processor time")
    head = "\n| mechanism | known | computed |\n|---|---|---|\n"
    words = PAGE.read_text(encoding="utf-8").partition("| mechanism |")[0]
    text = words + TABLE + "".join(rows) + head + "".join(known) + "\n" + "\n".join(drawn)
    if options.write:
        PAGE.write_text(text, encoding="utf-8")
    else:
        print(text)


def count(modes: pinsing.loops.Modes) -> str:
    """Return how many modes there are, with the bound that is known."""
    if "do not fix the pose" in modes.statement:
        return "not fixed by the inputs"
    most = re.search(r"at most (\d+)", modes.statement)
    if "all there are" in modes.statement or "no more can exist" in modes.statement:
        return f"{len(modes.modes)} (all)"
    return f"{len(modes.modes)}" + (f" (at most {most[1]})" if most else "")


def pictures(mechanism: Mechanism, name: str) -> list[str]:
    """A slice through the workspace by mode, and the modes side by side, as lines of Markdown."""
    import matplotlib as mpl

    mpl.use("agg")
    from pinsing.plot.mechanism import mode_sheet, motion_curve, pose_maps
    from pinsing.report.document import png

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


def source(name: str) -> str:
    for suffix in (".mechanism.yaml", ".loops.yaml"):
        path = URDF / f"{name}{suffix}"
        if path.is_file():
            return str(yaml.safe_load(path.read_text(encoding="utf-8")).get("source", "")).strip()
    return ""


def ratio(mechanism: Mechanism, pose: list[float]) -> str:
    """Type 2 measure at a pose, limits left aside."""
    found = pinsing.loops.working_modes(mechanism.without_limits(), pose, starts=12)
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
        str(len(pinsing.loops.assembly_modes(mechanism.without_limits()).modes)) + " found",
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
    found = pinsing.loops.assembly_modes(mechanism)
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
    for point in pinsing.loops.analyze_mechanism(mechanism).points:
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
    found = pinsing.loops.assembly_modes(mechanism)
    yield "8 assembly modes (Gosselin, Sefrioui and Richard 1994)", found.statement
    found = pinsing.loops.working_modes(mechanism)
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
