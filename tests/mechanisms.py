"""Mechanisms that the tests share, and what is computed of linkages by hand."""

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin
import yaml
from arms import URDF
from node import ask
from urdf_text import J, frame, loop_text, written

from pinsing.loops import (
    MechanismAnalysis,
    PoseEquation,
    analyze_mechanism,
    mechanism_at,
    refine,
)
from pinsing.loops.closure import at_zero, plane_normal, random_closed, residual
from pinsing.robot.mechanism import Mechanism, load_mechanism
from pinsing.view.mechanism_viewer import linkage_sizes, mechanism_data

R1, R2, R3 = 1.2, 1.0, 0.8


@functools.cache
def shipped(name: str) -> Mechanism:
    """One of the mechanisms in ``urdf/``."""
    return load_mechanism(URDF / f"{name}.urdf")


@functools.cache
def analyzed(name: str) -> MechanismAnalysis:
    """Its analysis at home."""
    return analyze_mechanism(shipped(name))


def hexagons(name: str) -> Iterator[np.ndarray]:
    """Points (6, 3) of base and platform, as the table of a shipped platform has them."""
    table = yaml.safe_load((URDF / f"{name}.mechanism.yaml").read_text(encoding="utf-8"))
    for row in (table["base"], table["platform"]):
        angles = np.radians(row["angles"])
        yield row["radius"] * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)


def data_of(mechanism: Mechanism) -> dict[str, Any]:
    """What its page computes with."""
    return mechanism_data(
        mechanism, linkage_sizes(mechanism), plane_normal(mechanism, at_zero(mechanism).axis)
    )


def asked(mechanism: Mechanism, code: str, **more: Any) -> Any:
    """What an expression is in the page's engine: it sees ``m``, ``data`` and more by name."""
    return ask(code, data=data_of(mechanism), **more)


def placed(mechanism: Mechanism, q: np.ndarray) -> pin.Data:
    """Where Pinocchio has joints (oMi) and frames (oMf) at q."""
    data = mechanism.model.createData()
    pin.framesForwardKinematics(mechanism.model, data, mechanism.model_q(q))
    return data


def value(equation: PoseEquation, at: Mapping[str, float]) -> float:
    """Its left side where variables have these values."""
    return float(equation(np.array([at[n] for n in equation.names])))


def closed_and_refined(
    mechanism: Mechanism, count: int, rng: np.random.Generator, *kinds: str
) -> Iterator[tuple[str, np.ndarray, str]]:
    """Random closed configurations, each before the singular ones that it is refined to.

    Of each the kind that was asked for (none: as drawn), its joints, and the kind that it is of.
    """
    for q in random_closed(mechanism, count, rng):
        yield "", q, mechanism_at(mechanism, q).kind
        for kind in kinds:
            there = refine(mechanism, q, kind).q
            if np.abs(residual(mechanism, there)).max() <= 1e-9:
                yield kind, there, mechanism_at(mechanism, there).kind


def planar_chains(
    chains: dict[str, tuple[tuple[float, float], list[tuple[str, float]]]],
) -> list[J]:
    """Planar chains of turning joints: per chain its pivot and (joint, length of its link).

    The last link of chain ``c`` ends in frame ``c_end``; the base has a frame ``ground``.
    """
    joints = [frame("ground", "base", (0.4, 0, 0))]
    for chain, (pivot, links) in chains.items():
        parent, at = "base", (*pivot, 0.0)
        for name, length in links:
            joints.append(J(name, parent, f"{name}_link", at))
            parent, at = f"{name}_link", (length, 0.0, 0.0)
        joints.append(frame(f"{chain}_end", parent, at))
    return joints


def four_bar(ground: float, crank: float, coupler: float, rocker: float) -> Mechanism:
    """A four-bar, driven by its crank, whose output is the turning of the other side's link."""
    one = ((0.0, 0.0), [("crank", crank), ("coupler", coupler)])
    joints = planar_chains({"one": one, "two": ((ground, 0.0), [("rocker", rocker)])})
    return linkage(joints, [("one_end", "two_end")], ["crank"], "two_end", "wz")


def assembled(folder: Path, joints: list[J], *loops: Any, **more: Any) -> Mechanism:
    """One that is written as files, from joints and what its loop file says."""
    return load_mechanism(written(folder, joints, loop_text(*loops, **more)))


def linkage(joints: list[J], *loops: Any, home: Mapping[str, float] = {}, **more: Any) -> Mechanism:
    """One whose files are gone; where no home is said, its joints are far from straight there."""
    names = [j.name for j in joints if j.kind != "fixed"]
    more["home"] = home or dict(zip(names, np.linspace(0.4, 1.1, len(names)), strict=True))
    with TemporaryDirectory() as folder:
        return assembled(Path(folder), joints, *loops, **more)


def circles(c1: Any, r1: float, c2: Any, r2: float) -> list[np.ndarray]:
    """Intersections of two circles, by hand."""
    c1, c2 = np.asarray(c1, dtype=float), np.asarray(c2, dtype=float)
    d = np.linalg.norm(c2 - c1)
    a = (r1**2 - r2**2 + d**2) / (2 * d)
    if r1**2 < a**2:
        return []
    h = np.sqrt(r1**2 - a**2)
    u = (c2 - c1) / d
    return [c1 + a * u + s * h * np.array([-u[1], u[0]]) for s in (1, -1)]
