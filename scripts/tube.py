#!/usr/bin/env python3
"""Attack tubes: calibrations at random, searches for singular configurations, paths across walls.

    scripts/tube.py [ARM ...] [--robots N] [--searches N] [--paths N] [--rounds N] [--seed N]

Of each arm N robots with lengths off by 0.5 mm and axes off by 3 mrad; a singular configuration
outside of the tube, a clearance beside one that is larger than its distance, or a path across a
wall without one, ends it with exit code 1. From the farthest ones that are found searches climb
on, for as many rounds; arms of seven joints need 40. Where no width is proven it says why.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin

import pinsing
from pinsing.algebra.conditions import two_sided
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.measures import Chain
from pinsing.proximity.clearance import watch
from pinsing.robot.nominal import flatten, on_chain

ARMS = ("ur5e", "puma560", "irb1400", "iiwa14", "panda")


def perturb(arm: pinsing.Arm, rng: np.random.Generator) -> pinsing.Arm:
    """Return a robot of this design: each placement off by up to 0.5 mm and 3 mrad."""
    chain = flatten(arm)
    R = np.array([r @ pin.exp3(rng.uniform(-1, 1, 3) * 3e-3) for r in chain.R])
    t = chain.t + rng.uniform(-5e-4, 5e-4, chain.t.shape)
    made = Chain(R, t, chain.prismatic)
    return on_chain(arm, made)


def find_singular(arm: pinsing.Arm, Q: np.ndarray) -> np.ndarray:
    """Singular configurations (K, n) near starts (N, n): Newton's method on a bordered Jacobian.

    With singular vectors of J about zero, ``J V + u g = 0`` and ``W V = 1`` have a solution V, g;
    J has lower rank where g is zero: one number for as many joints as rows, two for one joint more.
    """
    n, found = arm.n, [Q[:0]]
    left, _, right = np.linalg.svd(frame_jacobians(arm, Q))
    bordered = np.zeros((len(Q), n + 1, n + 1))
    bordered[:, :6, n:], bordered[:, 6:, :n] = left[:, :, 5:], right[:, 5:]
    for _ in range(40):
        bordered[:, :6, :n] = J = frame_jacobians(arm, Q)
        solved = np.linalg.inv(bordered)
        u, V, g = solved[:, n, :6], solved[:, :n, 6:], solved[:, n, 6:, None]
        slope = slopes(J, u, V)
        square = slope @ np.swapaxes(slope, 1, 2)
        # Where walls meet slopes vanish, or are alike.
        least = np.maximum(1e-18 * np.trace(square, axis1=1, axis2=2), 1e-300)
        square += least[:, None, None] * np.eye(n - 5)
        move = (np.swapaxes(slope, 1, 2) @ np.linalg.solve(square, g))[:, :, 0]
        size = np.linalg.norm(move, axis=1)
        Q = Q + move * np.minimum(1, 0.3 / np.maximum(size, 1e-300))[:, None]
        bordered[:, :6, n] = u / np.linalg.norm(u, axis=1, keepdims=True)
        bordered[:, 6:, :n] = np.swapaxes(np.linalg.qr(V).Q, 1, 2)
        moving = size > 1e-12
        found.append(Q[~moving])
        Q, bordered = Q[moving], bordered[moving]
    Q = np.concatenate([*found, Q])
    s = np.linalg.svd(frame_jacobians(arm, Q), compute_uv=False)
    return Q[s[:, -1] < 1e-11 * s[:, 0]]


def slopes(J: np.ndarray, u: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Derivatives (N, K, n) of u J V by the joints, for u (N, 6) and V (N, n, K)."""
    speeds = J[:, :, :, None] * V[:, None]
    # A joint turns the columns from its own on, and moves the tip about the axes before it.
    after = np.cumsum(speeds[:, :, ::-1], axis=2)[:, :, ::-1]
    before = np.cumsum(speeds[:, 3:], axis=2) - speeds[:, 3:]
    move, turn = J[:, :3, :, None], J[:, 3:, :, None]
    line = np.cross(turn, after[:, :3], axis=1) + np.cross(before, move, axis=1)
    angle = np.cross(turn, after[:, 3:], axis=1)
    return np.einsum("na,najk->nkj", u, np.concatenate([line, angle], axis=1))


def distances(form: pinsing.ClosedForm, Q: np.ndarray) -> np.ndarray:
    """Distances (K, F) of Q from each family of the design: lower bounds, close ones."""
    plain, names = replace(form, tube=None), [f.name for f in form.families]
    close = partial(pinsing.clearance, plain, Q, certify=True, gap=1e-4, boxes=500)
    return np.stack([close(families=[name]).lower for name in names], axis=1)


def counted(form: pinsing.ClosedForm, Q: np.ndarray) -> np.ndarray:
    """Those of Q that the tube is about: within the joint limits, if it is of these."""
    assert form.tube is not None
    if not form.tube.within_limits:
        return Q
    low, high = ranges(form)
    Q = low + np.mod(Q - low, 2 * np.pi)
    return Q[(high >= Q).all(axis=1)]


def ranges(form: pinsing.ClosedForm) -> tuple[np.ndarray, np.ndarray]:
    """Joint values to begin at: a circle, or the limits that the tube is within."""
    assert form.tube is not None
    limited = form.tube.within_limits & np.isfinite(form.arm.lower)
    low = np.where(limited, form.arm.lower, -np.pi)
    return low, np.where(limited, np.minimum(form.arm.upper, low + 2 * np.pi), np.pi)


def climb(
    form: pinsing.ClosedForm, Q: np.ndarray, rounds: int, rng: np.random.Generator
) -> np.ndarray:
    """Singular configurations that are farther and farther from the families, from some Q.

    Of those near one family and of those near several the farthest 20 are kept.
    """
    assert form.loaded is not None
    assert form.tube is not None
    Q = counted(form, Q)
    every = [Q]
    for _ in range(rounds if len(Q) else 0):
        each = distances(form, Q)
        order = np.sort(each, axis=1)
        alone = (order[:, 1:2] > form.tube.near).all(axis=1)
        kind = np.where(alone, each.argmin(axis=1), -1)
        far = np.argsort(-order[:, 0], kind="stable")
        best = Q[np.concatenate([far[kind[far] == k][:20] for k in np.unique(kind)])]
        starts = np.repeat(best, 4, axis=0)
        size = 10 ** rng.uniform(-3, -0.5, (len(starts), 1))
        beside = starts + size * rng.normal(size=starts.shape)
        fresh = counted(form, find_singular(form.loaded, beside))
        every.append(fresh)
        Q = np.concatenate([best, fresh])
    return np.concatenate(every)


def outside(form: pinsing.ClosedForm, Q: np.ndarray) -> tuple[int, np.ndarray]:
    """How many of Q lie outside of the tube, and the largest distances: by one family, and any."""
    each, tube = distances(form, Q), form.tube
    order = np.sort(each, axis=1)
    assert tube is not None
    alone = (order > tube.near)[:, 1] if each.shape[1] > 1 else np.ones(len(Q), bool)
    width = np.array([f.width for f in tube.families])[each.argmin(axis=1)]
    wrong = (order[:, 0] > tube.width) | (alone & (order[:, 0] > width))
    far = [order[alone, 0].max(initial=0.0), order[:, 0].max(initial=0.0)]
    return int(wrong.sum()), np.array(far)


def too_clear(form: pinsing.ClosedForm, Q: np.ndarray, rng: np.random.Generator) -> int:
    """How many configurations beside singular ones Q have a lower bound that is too large."""
    steps = rng.normal(size=Q.shape)
    steps *= rng.uniform(0, 0.5, (len(Q), 1)) / np.linalg.norm(steps, axis=1, keepdims=True)
    lower = pinsing.clearance(form, Q + steps).lower
    return int((lower > np.linalg.norm(steps, axis=1)).sum())


def unmet(form: pinsing.ClosedForm, paths: int, rng: np.random.Generator) -> tuple[int, int]:
    """Paths across each wall from outside of the tube on which no singular configuration is."""
    arm, wrong, tried = form.loaded, 0, 0
    assert arm is not None
    assert form.tube is not None
    for family, part in zip(form.families, form.tube.families, strict=True):
        if not part.persists:
            continue
        middle = family.sample(paths, rng)
        away = rng.normal(size=middle.shape)
        away *= rng.uniform(0.2, 1.2, (len(middle), 1)) / np.linalg.norm(away, axis=1)[:, None]
        ends = np.stack([middle - away, middle + away])
        flat = ends.reshape(-1, arm.n)
        design_each = two_sided(watch(form).conditions.zeros, flat, each=True).each
        margin = watch(form).margin
        assert margin is not None
        beyond = margin.take_off(flat, design_each).min(axis=1) > 0
        clear = beyond.reshape(2, -1).all(axis=0)
        D = np.linalg.det(frame_jacobians(arm, flat)).reshape(2, -1)
        design = form.geometry.arm  # type: ignore[union-attr]
        D0 = np.linalg.det(frame_jacobians(design, flat)).reshape(2, -1)
        crossed = clear & (D0[0] * D0[1] < 0)
        tried += int(crossed.sum())
        wrong += int((crossed & (D[0] * D[1] > 0)).sum())
    return wrong, tried


def attack(name: str, robots: int, searches: int, paths: int, rounds: int, seed: int) -> int:
    """Print a line for each robot of an arm; how many faults were found.

    ``rounds`` is how often each 10,000 searches climb on from the farthest that they found.
    """
    design, faults = pinsing.load(name), 0
    for i in range(robots):
        rng = np.random.default_rng([seed, i])
        robot = perturb(design, rng)
        began = time.process_time()
        form = pinsing.closed_form(robot, design=design)
        took, tube = time.process_time() - began, form.tube
        assert tube is not None
        out, most, found, near = 0, np.zeros(2), 0, 0
        for first in range(0, searches, 10_000):
            starts = rng.uniform(*ranges(form), (min(10_000, searches - first), robot.n))
            Q = climb(form, find_singular(robot, starts), rounds, rng)
            wrong, far = outside(form, Q)
            out, most, found = out + wrong, np.maximum(most, far), found + len(Q)
            near += too_clear(form, Q, rng)
        missed, tried = unmet(form, paths, rng) if tube.proven else (0, 0)
        faults += out + missed + near
        alone, wide, by_one, far = np.degrees([tube.alone, tube.width, *most])
        told = f"{alone:.2f}° alone, {by_one:.2f}° found; {wide:.2f}° where two meet"
        widths = told if tube.proven else f"no width ({tube.reason})"
        print(
            f"{name} {i}: {'within limits ' * tube.within_limits}{widths}, "
            f"{far:.2f}° found; {out} of {found} outside, "
            f"{near} beside them too clear, {missed} of {tried} paths unmet; {took:.1f} s",
            flush=True,
        )
    return faults


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", default=ARMS)
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--searches", type=int, default=2000)
    parser.add_argument("--paths", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--seed", type=int, default=34)
    given = parser.parse_args()
    counts = given.robots, given.searches, given.paths, given.rounds, given.seed
    sys.exit(int(any([attack(name, *counts) for name in given.names])))
