"""Sections 3.1 and 3.2.1: the Stanford arm. Table 1, Figures 2 to 4, Appendix A."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from paper import printed
from paper.charts import Panel, sigma_panels
from paper.rows import AGREES, DIFFERS, Figure, Row, Section, judged, tiny
from pinsing.families import closed_form
from pinsing.kinematics.jacobian import frame_jacobian, singular_values, tip_placement
from pinsing.robot.load import load
from pinsing.sampling.sweeps import sweep

SAMPLES = 361


def configuration(angle: float, d3: float = printed.STANFORD_D3) -> np.ndarray:
    return np.array([angle, angle, d3, angle, angle, angle])


def make(folder: Path) -> list[Section]:
    arm = load("stanford")
    wrist = load("stanford", tip="link6")
    rng = np.random.default_rng(3)
    Q = rng.uniform(-1, 1, (50, 6)) * np.array([np.pi, np.pi, 0.5, np.pi, np.pi, np.pi])
    off = max(
        float(
            np.abs(
                tip_placement(arm, q).homogeneous
                - printed.dh_placement(printed.TABLE_1, q, modified=False)
            ).max()
        )
        for q in Q
    )
    rows = [
        Row(
            "Table 1: placement of the last frame",
            "standard DH table",
            f"URDF equals its product, difference {tiny(off)}",
            AGREES if off < 1e-12 else DIFFERS,
            "urdf/stanford.urdf is made from urdf/stanford.dh.yaml; 50 random configurations.",
        ),
        *_analytic(wrist, Q),
        *_sigma(arm, wrist),
    ]
    result = sweep(
        arm,
        nominal=configuration(np.pi / 3),
        special=(0.0, np.pi, -np.pi),
        levels=1,
        samples=SAMPLES,
        ignore_limits=True,
        prune=False,
    )
    flat = {name: result.curve({}, name) for name in ("q1", "q6")}
    spread = {n: float(np.ptp(c.sigma_min) / c.sigma_min.max()) for n, c in flat.items()}
    rows.append(
        Row(
            "Figure 2: σ_min over q1 and over q6",
            "constant",
            ", ".join(f"{n}: change {tiny(s, 1e-9)} of itself" for n, s in spread.items()),
            AGREES if max(spread.values()) < 1e-9 else DIFFERS,
            "q1 turns the whole arm, q6 turns about an axis through the tip.",
        )
    )
    form = closed_form(arm)
    found = {f.text for f in form.families}
    expected = {"q2 = 0° or 180°", "d3 = 0", "q5 = 0° or 180°"}
    rows.append(
        Row(
            "Singular configurations, Sections 3.1 and 3.2.1",
            "q2 = 0, ±π; d3 = 0; q5 = 0, ±π",
            "; ".join(f.text for f in form.families) + (" — complete" if form.complete else ""),
            AGREES if found == expected and form.complete else DIFFERS,
            "Closed form of the pose Jacobian over the rationals: these families and no others.",
        )
    )
    sigma_panels(
        result, [Panel("nominal: all at 60°, d3 = 0.3 m", (), ("q1", "q6"))], folder, "fig02"
    )
    sigma_panels(
        result,
        [
            Panel("(a) q2 = 0 (solid), ±180° (dashed)", ("q2",), ("q4", "q5")),
            Panel("(b) q4 = 0, ±180°", ("q4",), ("q2", "q5")),
            Panel("(c) q5 = 0, ±180°", ("q5",), ("q2", "q4")),
        ],
        folder,
        "fig03",
    )
    sigma_panels(
        result,
        [
            Panel("(a) q2 = 0, ±180°", ("q2",), ("d3",)),
            Panel("(b) q4 = 0 (solid), ±180° (dashed)", ("q4",), ("d3",)),
            Panel("(c) q5 = 0, ±180°", ("q5",), ("d3",)),
        ],
        folder,
        "fig04",
    )
    return [
        Section(
            "Stanford arm: Table 1, Section 3.1, Appendix A, Figures 2 to 4",
            text=(
                "The arm of Table 1, its tool 0.08 m (d6) beyond the wrist, judged by the full "
                "pose; lengths in metres. Where the paper says nothing else, all revolute joints "
                "rest at π/3 and d3 at 0.3 m.",
            ),
            rows=tuple(rows),
            figures=(
                Figure("fig02", "Figure 2. σ_min does not change with q1 and q6."),
                Figure(
                    "fig03",
                    "Figure 3. With q2 or q5 at 0 or ±180° σ_min is zero whatever moves; with "
                    "q4 there it vanishes only where q2 or q5 is 0 or ±180°.",
                ),
                Figure("fig04", "Figure 4. With q4 at 0 or ±180° σ_min vanishes at d3 = 0."),
            ),
        )
    ]


def _analytic(wrist, Q: np.ndarray) -> list[Row]:
    d2 = printed.TABLE_1[1][2]
    differ = max(
        float(np.abs(frame_jacobian(wrist, q) - printed.appendix_J(q, d2)).max()) for q in Q
    )
    whole = [printed.appendix_J(q, d2) for q in Q]
    det11 = np.array([np.linalg.det(J[:3, :3]) for J in whole])
    det22 = np.array([np.linalg.det(J[3:, 3:]) for J in whole])
    own = np.array([np.linalg.det(frame_jacobian(wrist, q)) for q in Q])
    d3, s2, s5 = Q[:, 2], np.sin(Q[:, 1]), np.sin(Q[:, 4])
    out = [
        Row(
            "Appendix A: J at the wrist centre",
            "J11, J21, J22",
            f"largest difference of an entry {tiny(differ)}",
            AGREES if differ < 1e-12 else DIFFERS,
            "50 random configurations. It is the Jacobian of the wrist centre, without d6.",
        )
    ]
    for what, value, formula in (("|J11|", det11, d3**2 * s2), ("|J22|", det22, s5)):
        sign = float(np.sign((value * formula).sum()))
        error = float(np.abs(value - sign * formula).max())
        body = "d3² sin q2" if what == "|J11|" else "sin q5"
        shown = f"{'-' if sign < 0 else ''}{body}, difference {tiny(error)}"
        out.append(
            Row(
                f"Section 3.1: {what}",
                f"-{body}",
                shown,
                AGREES if error < 1e-12 and sign < 0 else DIFFERS,
                "" if sign < 0 else "The sign differs; where it vanishes is the same.",
            )
        )
    error = float(np.abs(own - det11 * det22).max())
    out.append(
        Row(
            "Section 3.1: |J|",
            "|J11| |J22|",
            f"difference {tiny(error)}",
            AGREES if error < 1e-12 else DIFFERS,
            "pinsing's own determinant at the wrist centre.",
        )
    )
    return out


def _sigma(arm, wrist) -> list[Row]:
    def last(a, q) -> float:
        return float(singular_values(a, q)[0, -1])

    third, half = configuration(np.pi / 3), configuration(np.pi / 2)
    needed = brentq(
        lambda d3: last(arm, configuration(np.pi / 3, d3)) - float(printed.STANFORD_THIRD), 0.1, 0.3
    )
    zero = max(last(arm, configuration(x)) for x in (0.0, np.pi, -np.pi))
    return [
        judged(
            "σ_min, all revolute π/3, d3 = 0.3 m",
            printed.STANFORD_THIRD,
            last(arm, third),
            f"At the wrist centre {last(wrist, third):.5f}. Not reproducible from Table 1: "
            f"{printed.STANFORD_THIRD} would need d3 = {needed:.4f} m.",
        ),
        judged(
            "σ_min, all revolute π/2, d3 = 0.3 m",
            printed.STANFORD_HALF,
            last(arm, half),
            f"At the wrist centre {last(wrist, half):.5f}.",
        ),
        Row(
            "σ_min, all revolute 0 or ±π, d3 = 0.3 m",
            "0",
            tiny(zero),
            AGREES if zero < 1e-12 else DIFFERS,
        ),
    ]
