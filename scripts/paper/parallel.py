"""Section 3.2.3: the planar 5R. Equation (13), Figure 11, Table 4."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from paper import printed
from paper.charts import COLORS, save
from paper.rows import AGREES, DIFFERS, INCOMPLETE, Figure, Row, Section, Table, judged, tiny
from pinsing import measures
from pinsing.loops import (
    MechanismAnalysis,
    SingularPoint,
    analyze_mechanism,
    assemblies,
    home,
    input_output,
    leg_form,
    mechanism_at,
)
from pinsing.loops.closure import planar_dyad
from pinsing.plot.mechanism import draw_linkage, input_map, is_left, map_legend
from pinsing.robot.mechanism import Mechanism, load_mechanism

THIRD = np.pi / 3


def make(folder: Path) -> list[Section]:
    mechanism = load_mechanism("five_bar")
    analysis = analyze_mechanism(mechanism, [THIRD, THIRD])
    _figure11(mechanism, analysis, folder)
    _map(mechanism, folder)
    _linkages(mechanism, analysis, folder)
    assert analysis.forms is not None  # a 5R is closed by a dyad
    loci = tuple((x.kind, x.words, f"{x.equation}") for x in analysis.forms.loci)
    return [
        Section(
            "Planar 5R: Section 3.2.3, Equation (13), Figure 11, Table 4",
            text=(
                "The paper's mechanism as a URDF of its spanning tree with a loop file "
                "(urdf/five_bar.urdf, urdf/five_bar.loops.yaml). Constraint Jacobians come from "
                "Pinocchio; the passive joints are eliminated through the motions that the loop "
                "allows. A x' = B q': type 1 where B is singular (the output loses a direction), "
                "type 2 where A is (the output moves with the actuators held).",
                "Assembly + is the mode of the paper's start, q1 = q2 = π/3; assembly - has P on "
                "the other side of the line from B1 to B2.",
            ),
            rows=(
                *_matrices(mechanism),
                *_table4(mechanism, analysis),
                *_missed(mechanism, analysis),
            ),
            tables=(
                Table(
                    ("Kind", "What is in line", "Equation in q1 and q2 (m²)"),
                    loci,
                    "All singular configurations of the 5R, in closed form ("
                    + ("complete" if analysis.forms.complete else "not complete")
                    + "; exact elimination of P by resultants):",
                ),
            ),
            figures=(
                Figure(
                    "fig11",
                    "Figure 11. σ_min of (a) the configuration Jacobian and (b) the mechanism "
                    "Jacobian over each input, the other at 60°. Solid: assembly +, dashed: "
                    "assembly - (in (b) the two coincide), grey: the paper's root y, which changes "
                    "from one to the other at the dotted lines. Circles: refined singular points.",
                ),
                Figure(
                    "fig11_map", "Beyond the paper: all singular configurations over both inputs."
                ),
                Figure(
                    "fig11_poses",
                    "Type 1 (the velocity ellipse of P is a line) and type 2 (P moves along the "
                    "arrow with both actuators held), at q1 = 60°.",
                ),
            ),
        )
    ]


def _matrices(mechanism: Mechanism) -> list[Row]:
    q = home(mechanism)
    A, B = leg_form(mechanism, q)
    rod = printed.R2
    J_x, J_q = printed.five_bar_matrices(THIRD, THIRD)
    same_B = float(np.abs(np.linalg.svd(B * rod)[1] - np.linalg.svd(J_x)[1]).max())
    same_A = float(np.abs(np.linalg.svd(A * rod)[1] - np.linalg.svd(J_q)[1]).max())
    velocity = mechanism_at(mechanism, q).velocity
    plain = float(np.abs(J_x @ velocity + J_q).max())
    swapped = float(np.abs(J_q @ velocity - J_x).max())
    return [
        judged(
            "σ_min of the first matrix (“configuration Jacobian”), q1 = q2 = π/3",
            printed.FIVE_BAR_CONFIGURATION,
            float(np.linalg.svd(B * rod)[1][-1]),
            "B in leg form (moment arms of the rods' forces) times r2; singular values differ "
            f"from Eq. (13) by {tiny(same_B)}.",
        ),
        judged(
            "σ_min of the second matrix (“mechanism Jacobian”), q1 = q2 = π/3",
            printed.FIVE_BAR_MECHANISM,
            float(np.linalg.svd(A * rod)[1][-1]),
            f"A in leg form (forces along the rods) times r2; differs by {tiny(same_A)}.",
        ),
        Row(
            "Eq. (13): J_x X' + J_q q' = 0",
            "J_x (diagonal) multiplies X', J_q multiplies q'",
            f"J_q X' = J_x q' (residual {tiny(swapped)}); as printed the residual is {plain:.2f}",
            DIFFERS if swapped < 1e-9 < plain else AGREES,
            "The two are swapped, and one sign is wrong. Their singular values are unaffected: "
            "the diagonal one is B (type 1), the full one A (type 2).",
        ),
    ]


def _nearest(points: tuple[SingularPoint, ...], moving: str, value: float) -> SingularPoint:
    index = 0 if moving == "q1" else 1
    here = [p for p in points if p.moving == moving and p.kind == "type 1"]
    return min(here, key=lambda p: abs(p.inputs[index] - value))


def _table4(mechanism: Mechanism, analysis: MechanismAnalysis) -> list[Row]:
    out = []
    for one, two in printed.TABLE_4:
        moving = "q2" if one == "pi/3" else "q1"
        text = two if moving == "q2" else one
        index = 1 if moving == "q2" else 0
        point = _nearest(analysis.points, moving, float(text))
        _, B = input_output(mechanism, point.q)
        det = float(np.linalg.det(B))
        omega, K = float(measures.manipulability(B)), float(measures.condition_number(B))
        found = float(point.inputs[index])
        same = abs(found - float(text)) <= 3e-5
        note = (
            ""
            if point.mode.startswith("assembly +")
            else (
                " In the other assembly mode than the start: the paper's root y changes modes on "
                "the way (see below)."
            )
        )
        out.append(
            Row(
                f"Table 4: q1 = {one}, q2 = {two}",
                f"{moving} = {text}; det 0, ω 0, K ∞",
                f"{moving} = {found:.10f}; det {tiny(det)}, ω {tiny(omega)}, "
                f"K {'∞' if K > 1e12 else f'{K:.2g}'}; {point.mode}",
                AGREES if same else DIFFERS,
                f"Type 1, refined; the printed digits are off by {abs(found - float(text)):.0e}."
                + note,
            )
        )
    return out


def _missed(mechanism: Mechanism, analysis: MechanismAnalysis) -> list[Row]:
    known = [
        ("q2", float(two)) if one == "pi/3" else ("q1", float(one)) for one, two in printed.TABLE_4
    ]
    others = [
        p
        for p in analysis.points
        if p.kind == "type 1"
        and not any(
            m == p.moving and abs(p.inputs[0 if m == "q1" else 1] - v) < 1e-3 for m, v in known
        )
    ]
    same_mode = [p for p in others if p.mode.startswith("assembly +")]
    other_mode = [p for p in others if not p.mode.startswith("assembly +")]
    rows = [
        Row(
            "Type 1 points on the paper's own curves that Table 4 lacks",
            "(none)",
            "; ".join(_at(p) for p in same_mode),
            INCOMPLETE if same_mode else AGREES,
            "Same assembly mode, same curve of Figure 11a: its σ_min touches zero there too.",
        ),
        Row(
            "Type 1 points of the other assembly mode",
            "(none)",
            "; ".join(_at(p) for p in other_mode),
            INCOMPLETE if other_mode else AGREES,
            "The paper follows one root of y only.",
        ),
    ]
    ends = [p for p in analysis.points if p.kind == "type 2"]
    rows.append(
        Row(
            "“There is no mechanism singularity”",
            "none",
            "; ".join(_at(p) for p in ends),
            DIFFERS if ends and all(p.range_end and p.converged for p in ends) else AGREES,
            "σ_min of the second matrix reaches zero at the ends of the feasible range, where B1, "
            "P and B2 are in line: type 2.",
        )
    )
    ranges = "; ".join(
        f"{name} in {' or '.join(f'[{i.lower:.7f}, {i.upper:.7f}]' for i in found)}"
        for name, found in analysis.ranges.items()
    )
    rows.append(
        Row(
            "Feasible range of each input, the other at π/3",
            "(not given)",
            ranges,
            INCOMPLETE,
            "Beyond π a value means one turn less. Outside it the loop cannot be closed.",
        )
    )
    jump = _jump()
    before, after, last = (
        _mode_of_paper(mechanism, THIRD, value)
        for value in (jump - 1e-6, jump + 1e-6, 2 * np.pi - jump + 1e-6)
    )
    rows.append(
        Row(
            "Figure 11: one curve over q2",
            "the root y = (√(g² - 4dh) - g) / 2d throughout",
            f"assembly {before} below q2 = {jump:.7f}, assembly {after} above, assembly {last} "
            f"again above {2 * np.pi - jump:.7f}",
            DIFFERS if before != after else AGREES,
            "That root is the upper intersection of two circles. Where B1 and B2 have the same x "
            "(2 r3 + r1 cos q2 = r1 cos q1, the printed e and f are infinite) it jumps to the "
            "other assembly mode, which the mechanism cannot.",
        )
    )
    return rows


def _at(p: SingularPoint) -> str:
    index = 0 if p.moving == "q1" else 1
    mode = p.mode.partition(",")[0]
    return f"{p.moving} = {p.inputs[index]:.7f}" + ("" if p.kind == "type 2" else f" ({mode})")


def _jump() -> float:
    return float(np.arccos(np.cos(THIRD) - 2 * printed.R3 / printed.R1))


def _mode_of_paper(mechanism: Mechanism, q1: float, q2: float) -> str:
    """Assembly mode that the printed formula is in."""
    P = np.array(printed.five_bar_point(q1, q2))
    found = assemblies(mechanism, [q1, q2])
    best = min(
        found, key=lambda s: float(np.linalg.norm(mechanism_at(mechanism, s.q).position[:2] - P))
    )
    return best.mode.removeprefix("assembly ")[0]


def _figure11(mechanism: Mechanism, analysis: MechanismAnalysis, folder: Path) -> None:
    dyad = planar_dyad(mechanism)
    assert dyad is not None  # a 5R is closed by a dyad
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.9))
    left_is_plus = is_left(mechanism, dyad)
    for k, name in enumerate(mechanism.inputs):
        ends = analysis.ranges[name][0]
        middle, reach = (ends.lower + ends.upper) / 2, (ends.upper - ends.lower) / 2
        # Denser at the ends, where the curves are steep.
        grid = middle - reach * np.cos(np.linspace(0.002, np.pi - 0.002, 600))
        for sign, style in (("+", "-"), ("-", "--")):
            first, second = [], []
            for value in grid:
                inputs = np.full(2, THIRD)
                inputs[k] = value
                q = dyad.configuration(inputs, left_is_plus == (sign == "+"))
                A, B = leg_form(mechanism, q)
                first.append(np.linalg.svd(B * printed.R2)[1][-1])
                second.append(np.linalg.svd(A * printed.R2)[1][-1])
            label = f"{name}, assembly {sign}"
            for ax, values in zip(axes, (first, second), strict=True):
                ax.plot(np.degrees(grid), values, style, color=COLORS[k], label=label, lw=1.3)
        paper = _paper_curve(k, grid)
        for ax, values in zip(axes, paper.T, strict=True):
            ax.plot(np.degrees(grid), values, color="#9a9a9a", lw=4, alpha=0.35, zorder=1)
        for p in analysis.points:
            if p.moving == name:
                value = p.inputs[k] + (2 * np.pi if p.inputs[k] < ends.lower - 1e-6 else 0)
                ax = axes[0] if p.kind == "type 1" else axes[1]
                ax.plot(np.degrees(value), 0, "o", color=COLORS[k], mfc="white", ms=5, zorder=5)
    for ax in axes:
        for value in (_jump(), 2 * np.pi - _jump()):
            ax.axvline(np.degrees(value), color="#777", ls=":", lw=1)
    axes[0].set_title("(a) first matrix of Eq. (13): B, type 1")
    axes[1].set_title("(b) second matrix of Eq. (13): A, type 2")
    for ax in axes:
        ax.set_xlabel("q1 or q2 (°), the other at 60°")
        ax.set_ylabel("σ_min")
        ax.set_ylim(bottom=-0.03)
    axes[1].legend(fontsize=7, ncols=2, loc="upper center")
    axes[1].set_ylim(top=1.5)
    save(figure, folder, "fig11")


def _paper_curve(k: int, grid: np.ndarray) -> np.ndarray:
    out = np.full((len(grid), 2), np.nan)
    for i, value in enumerate(grid):
        q = [THIRD, THIRD]
        q[k] = (value + np.pi) % (2 * np.pi) - np.pi
        out[i] = [np.linalg.svd(m)[1][-1] for m in printed.five_bar_matrices(*q)]
    return out


def _map(mechanism: Mechanism, folder: Path) -> None:
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 5.4))
    for ax, sign in zip(axes, "+-", strict=True):
        input_map(mechanism, sign, ax)
        ax.set_xticks(range(-180, 181, 60))
        ax.set_yticks(range(-180, 181, 60))
        ax.axvline(60, color="#999", lw=0.7, ls=":")
        ax.axhline(60, color="#999", lw=0.7, ls=":")
        ax.set_title(f"assembly {sign} (dotted: the paper's curves)")
        map_legend(ax)
    save(figure, folder, "fig11_map")


def _linkages(mechanism: Mechanism, analysis: MechanismAnalysis, folder: Path) -> None:
    along = [p for p in analysis.points if p.moving == "q2"]
    shown = [p for p in along if p.kind == "type 1" and p.mode.startswith("assembly +")]
    shown += [p for p in along if p.kind == "type 2"]
    figure, axes = plt.subplots(1, len(shown), figsize=(2.6 * len(shown), 3.4))
    for ax, p in zip(axes, shown, strict=True):
        draw_linkage(mechanism, p.q, ax, ellipse=0.2)
        ax.set_title(f"{p.kind}\nq2 = {np.degrees(p.inputs[1]):.2f}°", fontsize=9)
    save(figure, folder, "fig11_poses")
