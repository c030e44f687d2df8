"""Section 3.2.2 and 4: the 7-DOF arm. Tables 2 and 3, Figures 6 to 9 and 13 to 16."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from paper import printed, table3
from paper.charts import Panel, ellipsoid_pairs, sigma_panels
from paper.printed import surgical_configuration as configuration
from paper.readings import search
from paper.rows import AGREES, DIFFERS, INCOMPLETE, Figure, Row, Section, Table, judged, tiny
from pinsing.families import closed_form
from pinsing.kinematics.at import State, at
from pinsing.kinematics.jacobian import frame_jacobian, singular_values, tip_placement
from pinsing.measures import SINGULAR_RTOL
from pinsing.robot.load import load
from pinsing.sampling.sweeps import SweepResult, sweep

SAMPLES = 361
_FLAT = 1e-9


def make(folder: Path, readings: bool = True) -> list[Section]:
    arm = load("surgical7")
    result = sweep(
        arm,
        nominal=configuration(),
        special=(0.0, np.pi, -np.pi),
        levels=3,
        samples=SAMPLES,
        joints=("d1", "q2", "q3", "q4", "q5", "q6", "q7"),
        ignore_limits=True,
        prune=False,
    )
    sections = [
        Section(
            "7-DOF arm: Table 2, Section 3.2.2, Figures 6 to 9",
            text=(
                "The arm of Table 2 (modified DH), judged by the full pose of its last frame, "
                "lengths in metres; all revolute joints rest at π/3 and d1 at 0.3 m.",
            ),
            rows=(*_sigma(arm, result), *_families(arm)),
            figures=_figures(result, folder),
        ),
        table3.make(arm),
        _ellipsoids(arm, folder),
    ]
    if readings:
        sections.insert(1, _readings())
    return sections


def _sigma(arm, result: SweepResult) -> list[Row]:
    rng = np.random.default_rng(5)
    Q = rng.uniform(-np.pi, np.pi, (50, 7))
    off = max(
        float(
            np.abs(
                tip_placement(arm, q).homogeneous
                - printed.dh_placement(printed.TABLE_2, q, modified=True)
            ).max()
        )
        for q in Q
    )
    sigma = [float(singular_values(arm, configuration(x))[0, -1]) for x in (np.pi / 3, np.pi / 2)]
    zero = max(float(singular_values(arm, configuration(x))[0, -1]) for x in (0.0, np.pi, -np.pi))
    low, high = printed.SURGICAL_D1_RANGE
    spread = {name: float(np.ptp(result.curve({}, name).sigma_min)) for name in ("d1", "q6", "q7")}
    flat = max(spread["d1"], spread["q7"])
    return [
        Row(
            "Table 2: placement of the last frame",
            "modified DH table",
            f"URDF equals its product, difference {tiny(off)}",
            AGREES if off < 1e-12 else DIFFERS,
            "urdf/surgical7.urdf is made from urdf/surgical7.dh.yaml; 50 random configurations.",
        ),
        Row(
            "d1 = 0.3 m, used everywhere",
            f"range [{low}, {high}] m (Table 2)",
            f"{printed.SURGICAL_D1} m is outside",
            DIFFERS,
            f"Harmless: it only slides the arm, and σ_min changes by {tiny(spread['d1'])} over it.",
        ),
        judged(
            "σ_min, all revolute π/3",
            printed.SURGICAL_THIRD,
            sigma[0],
            f"{sigma[0] / float(printed.SURGICAL_THIRD):.0f} times the printed value: "
            "not reproducible from Table 2 (see the next section).",
        ),
        judged(
            "σ_min, all revolute π/2",
            printed.SURGICAL_HALF,
            sigma[1],
            f"{sigma[1] / float(printed.SURGICAL_HALF):.0f} times the printed value.",
        ),
        Row("σ_min, all revolute 0 or ±π", "0", tiny(zero), AGREES if zero < 1e-12 else DIFFERS),
        Row(
            "Figure 6: σ_min over d1 and over q7",
            "constant",
            f"change {tiny(flat)}",
            AGREES if flat < 1e-12 else DIFFERS,
        ),
        Row(
            "Figure 6: σ_min over q6",
            "varies by about 1e-6",
            f"varies by {spread['q6']:.3f}, of {result.curve({}, 'q6').sigma_min.max():.3f}",
            DIFFERS,
            "q6 must not be left out: it takes part in two of the four families below.",
        ),
    ]


def _families(arm) -> list[Row]:
    form = closed_form(arm)
    rng = np.random.default_rng(11)

    def forced(**joints: float) -> tuple[bool, float]:
        Q = rng.uniform(-np.pi, np.pi, (300, 7))
        for name, value in joints.items():
            Q[:, int(name[1:]) - 1] = value
        sigma = singular_values(arm, Q)
        worst = float((sigma[:, -1] / sigma[:, 0]).max())
        return worst <= SINGULAR_RTOL, worst

    half = np.pi / 2
    out = []
    for text, given, minimal, smaller in (
        ("q2 = q3 = q4 = 0, ±π", {"q2": 0, "q3": np.pi, "q4": 0}, "q4 = 0, ±π alone", {"q4": 0}),
        (
            "q2 = q3 = 0, ±π and q5 = ±π/2",
            {"q2": 0, "q3": np.pi, "q5": half},
            "q2 = 0, ±π and q3 = 0, ±π",
            {"q2": 0, "q3": np.pi},
        ),
        ("q4 = q5 = 0, ±π", {"q4": 0, "q5": np.pi}, "q4 = 0, ±π alone", {"q4": np.pi}),
    ):
        (holds, worst), (less, less_worst) = forced(**given), forced(**smaller)
        out.append(
            Row(
                f"Singular configuration {text}",
                "singular",
                f"singular (σ_min/σ_max {tiny(worst)}), but so is {minimal} ({tiny(less_worst)})",
                INCOMPLETE if holds and less else DIFFERS,
                "Not minimal: 300 random values of the other joints.",
            )
        )
    names = [f.text for f in form.families]
    missed = [f.text for f in form.families if "sin" in f.text or "cos" in f.text]
    out.append(
        Row(
            "All singular configurations",
            "the three above",
            "; or ".join(names) + (" — complete" if form.complete else ""),
            INCOMPLETE,
            f"{len(missed)} of {len(names)} families tie joints to angles that are not special, or "
            "to each other, where no table of special angles finds them. Exact algebra on the "
            "rational geometry; q2 = 0 with the relation contains q5 = ±π/2, sin q4 = -1/2.",
        )
    )
    ratio = _ratio(arm, configuration(0.7, q5=half, q6=-np.arcsin(0.2)))
    other = _ratio(arm, configuration(0.7, q2=0, q5=half, q4=-np.pi / 6))
    out.append(
        Row(
            "q5 = ±π/2 and sin q6 = -1/5; q2 = 0, ±π, q5 = ±π/2 and sin q4 = -1/2",
            "(not found)",
            f"singular: σ_min/σ_max {tiny(ratio)} and {tiny(other)}",
            INCOMPLETE if max(ratio, other) < SINGULAR_RTOL else DIFFERS,
            "Checked at configurations with the other joints at 0.7 rad.",
        )
    )
    return out


def _ratio(arm, q: np.ndarray) -> float:
    sigma = singular_values(arm, q)[0]
    return float(sigma[-1] / sigma[0])


def _readings() -> Section:
    found = search(float(printed.SURGICAL_THIRD), float(printed.SURGICAL_HALF))
    rows = tuple((r.words, f"{r.third:.6f}", f"{r.half:.6f}") for r in found.single)
    nearest = tuple(
        (r.words, r.measure, f"{r.third:.6f}", f"{r.half:.6f}", f"{100 * r.error:.1f} %")
        for r in found.nearest
    )
    return Section(
        "Readings of Table 2 under which 0.000472 might come out",
        text=(
            f"Tried: {found.count:,} readings. Both DH conventions; the signs of α4 to α7; quarter "
            "turns added to q3 to q6; the origin of each frame as reference point; lengths in m, "
            "dm, cm and mm; with and without d1; four normalisations; nine measures. Printed are "
            f"{printed.SURGICAL_THIRD} (all π/3) and {printed.SURGICAL_HALF} (all π/2).",
            f"Readings within 1 % of both: {found.within}. The printed values do not belong to the "
            "arm of Table 2 in any of these ways.",
        ),
        tables=(
            Table(("One thing changed", "σ_min, π/3", "σ_min, π/2"), rows, "σ_min itself:"),
            Table(
                ("Reading", "Measure", "π/3", "π/2", "off by"),
                nearest,
                "Nearest of all, by the larger of the two relative errors:",
            ),
        ),
    )


def _figures(result: SweepResult, folder: Path) -> tuple[Figure, ...]:
    sigma_panels(
        result,
        [Panel("(a) d1", (), ("d1",)), Panel("(b) q6 and q7", (), ("q6", "q7"))],
        folder,
        "fig06",
    )
    joints = ("q2", "q3", "q4", "q5")
    out = [
        Figure(
            "fig06",
            "Figure 6. σ_min does not change with d1 and q7, but it does with q6, by most of its "
            "own size.",
        )
    ]
    words = {
        1: "with one joint at 0 (solid) or ±180° (dashed). With q4 there σ_min is zero whatever "
        "moves: q4 alone is a singular configuration, which the paper does not say.",
        2: "with two joints there: zero throughout for q2 and q3, and wherever q4 takes part. "
        "The curve of q4 in (c) also vanishes between the special angles: the fourth family.",
        3: "with three joints there: zero throughout, since q2 and q3 already are enough.",
    }
    for size, name in ((1, "fig07"), (2, "fig08"), (3, "fig09")):
        sets = [s for s in itertools.combinations(joints, size)]
        if size == 3:
            sets = [("q2", "q3", "q4"), ("q2", "q3", "q5")]
        panels = [
            Panel(
                f"({'abcdef'[i]}) {' = '.join(s)} = 0, ±180°",
                s,
                tuple(j for j in joints if j not in s),
            )
            for i, s in enumerate(sets)
        ]
        sigma_panels(result, panels, folder, name, columns=2 if size != 2 else 3)
        out.append(Figure(name, f"Figure {name[-1]}. σ_min {words[size]}"))
    return tuple(out)


def _ellipsoids(arm, folder: Path) -> Section:
    cases = {
        "Figure 13": ("q2 = q3 = q4 = 0", configuration(q2=0, q3=0, q4=0)),
        "Figure 14": ("q4 = q5 = 0", configuration(q4=0, q5=0)),
        "Figure 15": ("q2 = q3 = 0, q5 = 90°", configuration(q2=0, q3=0, q5=np.pi / 2)),
        "Figure 16": ("all revolute joints at 60°", configuration()),
    }
    rows, figures = [], []
    for name, (words, q) in cases.items():
        state = at(arm, q)
        stem = f"fig{name[-2:]}"
        ellipsoid_pairs({f"{name}: {words}": state}, arm, folder, stem)
        rows.append(_ellipsoid_row(arm, name, words, state))
        figures.append(
            Figure(
                stem,
                f"{name}. {words}{', the others at 60°' if '=' in words else ''}. {_shape(state)}",
            )
        )
    return Section(
        "Velocity ellipsoids of the 7-DOF arm: Figures 13 to 16",
        text=(
            "Translational and rotational velocity ellipsoid of the last frame under unit joint "
            "speed. A singular pose Jacobian needs neither of them to be flat: the lost motion may "
            "mix both.",
        ),
        rows=tuple(rows),
        figures=tuple(figures),
    )


def _flat(state: State) -> tuple[bool, bool]:
    t, r = state.translational.radii, state.rotational.radii
    return bool(t[-1] <= _FLAT * t[0]), bool(r[-1] <= _FLAT * r[0])


def _held(arm, q: np.ndarray) -> np.ndarray:
    """Semi-axes (3,) of the translations that leave the orientation at rest."""
    J = frame_jacobian(arm, q)
    still = np.linalg.svd(J[3:])[2][3:].T
    return np.linalg.svd(J[:3] @ still, compute_uv=False)


def _shape(state: State) -> str:
    moving, turning = _flat(state)
    words = []
    for flat, kind, radii in (
        (moving, "translational", state.translational.radii),
        (turning, "rotational", state.rotational.radii),
    ):
        shown = f"its shortest semi-axis is {radii[-1] / radii[0]:.1%} of the longest"
        words.append(f"the {kind} ellipsoid is flat" if flat else f"of the {kind} one {shown}")
    text = "; ".join(words)
    return text[0].upper() + text[1:] + "."


def _ellipsoid_row(arm, name: str, words: str, state: State) -> Row:
    moving, turning = _flat(state)
    regular = name == "Figure 16"
    said = "both ellipsoids full" if regular else "translational ellipsoid a plate, thickness zero"
    agrees = (not moving and not turning) if regular else moving
    t, r = state.translational.radii, state.rotational.radii
    lost = "; ".join(x.words for x in state.lost)
    held = _held(arm, state.q)
    thin = (
        f"Thin, but not of zero thickness ({t[-1] / t[0]:.1%} of the longest): the lost motion "
        f"mixes translation and rotation ({lost}). With the orientation held it is a plate: "
        f"{held[0]:.3g}, {held[1]:.3g}, {'0' if held[2] < _FLAT else f'{held[2]:.3g}'} m/s."
    )
    return Row(
        f"{name}: {words}",
        said,
        f"semi-axes {', '.join(f'{x:.4g}' for x in t)} m/s; {', '.join(f'{x:.4g}' for x in r)} "
        "rad/s",
        AGREES if agrees else DIFFERS,
        f"{state.status.capitalize()}." if regular else thin,
    )
