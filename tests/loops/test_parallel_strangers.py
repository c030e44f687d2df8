"""Deltas with legs of their own sizes, from a URDF: what is found against Plücker lines here."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from test_pose_forms import pluecker
from urdf_text import J, Y, ball, frame, loop_text, written

import pinsing
from pinsing.loops import mechanism_at, residual
from pinsing.loops.closure import Loops, gauss_newton, random_closed

HALF = 0.05


def delta(folder, seed):
    """Three cranks at odd angles, each with two parallel rods between universal joint and ball."""
    rng = np.random.default_rng(seed)
    joints, loops = [], []
    for k in range(3):
        angle = 2 * np.pi * k / 3 + rng.uniform(-0.3, 0.3)
        base, top, crank, rod = np.round(
            rng.uniform([0.15, 0.05, 0.2, 0.5], [0.3, 0.12, 0.3, 0.6]), 2
        )
        joints.append(J(f"hip{k}", "base", f"h{k}", kind="fixed", rpy=(0, 0, angle)))
        joints.append(J(f"a{k}", f"h{k}", f"arm{k}", (base, 0, 0), Y, "revolute", (-1.5, 1.5)))
        joints.append(J(f"m{k}", "platform", f"mount{k}", kind="fixed", rpy=(0, 0, angle)))
        for side, y in (("l", HALF), ("r", -HALF)):
            name = f"{k}{side}"
            joints.append(J(f"u{name}", f"arm{k}", f"x{name}", (crank, y, 0), Y))
            joints.append(J(f"v{name}", f"x{name}", f"rod{name}", axis=(1, 0, 0)))
            joints.append(frame(f"e{name}", f"rod{name}", (0, 0, -rod)))
            if name == "0l":
                joints += ball("s", "e0l", "corner")
                c, s = np.cos(angle), np.sin(angle)
                away = (-(top * c - y * s), -(top * s + y * c), 0)
                joints.append(J("carry", "corner", "platform", away, kind="fixed"))
                continue
            joints.append(frame(f"g{name}", f"mount{k}", (top, y, 0)))
            loops.append((f"e{name}", f"g{name}"))
    home = {f"a{k}": 0.2 for k in range(3)}
    text = loop_text(loops, ["a0", "a1", "a2"], "platform", "vx, vy, vz", home=home)
    return pinsing.load_mechanism(written(folder, joints, text))


def rod_lines(mechanism, q):
    """Lines of the six rods by Pinocchio's placements, of unit length, and work on the cranks."""
    model, data = mechanism.model, mechanism.model.createData()
    pin.framesForwardKinematics(model, data, mechanism.model_q(q))
    lines, work = [], []
    for k in range(3):
        for side in "lr":
            inner = data.oMi[model.getJointId(f"u{k}{side}")].translation
            outer = data.oMf[model.getFrameId(f"e{k}{side}")].translation
            lines.append(pluecker(inner, outer) / np.linalg.norm(outer - inner))
            crank = data.oMi[model.getJointId(f"a{k}")]
            # Of a crank on its rod: the moment of the rod's line about the crank's axis.
            arm = np.cross(inner - crank.translation, lines[-1][:3])
            work.append(float(crank.rotation[:, 1] @ arm))
    return np.array(lines), np.array(work)


def smallest(rows):
    return np.linalg.svd(rows, compute_uv=False)[-1]


def by_themselves(mechanism, q):
    """Whether hinges of a ball or a universal joint are in line with each other or the rod."""
    names = [n for n in mechanism.joints if n == "sy" or n.startswith("v")]
    return min(abs(np.cos(q[mechanism.joints.index(n)])) for n in names) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_deltas_are_singular_where_their_lines_say_so(seed, tmp_path):
    mechanism = delta(tmp_path, seed)
    found = pinsing.loops.analyze_mechanism(mechanism)
    assert found.mobility == 3
    assert all(check.passed for check in found.checks)
    for point in found.points:
        if by_themselves(mechanism, point.q):
            continue
        lines, work = rod_lines(mechanism, point.q)
        if point.kind in ("type 2", "type 3"):
            assert smallest(lines) < 1e-9
        if point.kind in ("type 1", "type 3"):
            # Motions of platform and cranks that leave its centre at rest: it turns alone.
            rows = np.zeros((6, 6))
            rows[:, :3] = lines[:, 3:] - np.cross(point.position, lines[:, :3])
            rows[np.arange(6), 3 + np.arange(6) // 2] = -work
            assert smallest(rows) < 1e-9
    assert {"type 1", "type 2"} <= {p.kind for p in found.points}
    rng = np.random.default_rng(seed)
    for q in random_closed(mechanism, 12, rng):
        if not by_themselves(mechanism, q):
            assert smallest(rod_lines(mechanism, q)[0]) > 1e-7
            assert mechanism_at(mechanism, q).input_ratio > 1e-9
    # Near misses, closed again, are regular.
    beside = [
        closed_beside(mechanism, p.q, away)
        for p in found.points
        if p.kind == "type 2" and not by_themselves(mechanism, p.q)
        for away in (1e-3, 1e-4)
    ]
    assert beside
    for q in beside:
        assert smallest(rod_lines(mechanism, q)[0]) > 1e-8
        assert mechanism_at(mechanism, q).input_ratio > 1e-9


def closed_beside(mechanism, q, away):
    """A closed configuration beside q."""
    start = q + away * np.linspace(1, 2, mechanism.n)
    found, _ = gauss_newton(Loops(mechanism), start, np.ones(mechanism.n, dtype=bool))
    assert np.abs(residual(mechanism, found)).max() < 1e-10
    return found
