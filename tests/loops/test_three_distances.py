"""Inputs of 3-RPR and 3-RRR at which two poses meet, and how many there are: by plane geometry."""

import numpy as np
import pytest
from mechanisms import shipped
from test_parallel_geometry import Way, planar
from tiers import tiered

import pinsing
from pinsing.loops.legs import count_poses, input_loci


def turned(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def triangles(seed):
    """Corners of base and platform at random; with an odd seed both equilateral, unlike turned."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        third = 2 * np.pi * np.arange(3) / 3
        corners = np.stack([np.cos(third), np.sin(third)], axis=1)
        return corners, 0.45 * corners @ turned(np.pi / 3).T
    return np.round(rng.uniform(-1, 1, (3, 2)), 2), np.round(rng.uniform(-0.5, 0.5, (3, 2)), 2)


def pose_with_lines_through_a_point(base, platform, rng):
    """A position and turn at which the three leg lines meet, from their own determinant."""
    while True:
        angle, y = rng.uniform(-np.pi, np.pi), rng.uniform(-1, 1)
        b = platform @ turned(angle).T

        def together(x, b=b, y=y):
            ends = b + np.array([x, y])
            lines = [[*(e - a), a[0] * e[1] - a[1] * e[0]] for a, e in zip(base, ends, strict=True)]
            return np.linalg.det(lines)

        at = np.array([-1.0, 0, 1])
        roots = np.roots(np.polyfit(at, [together(x) for x in at], 2))
        real = [r.real for r in roots if abs(r.imag) < 1e-9 and abs(r) < 3]
        if real:
            return np.array([real[0], y]), angle


def lengths(base, platform, at, angle):
    return np.linalg.norm(at + platform @ turned(angle).T - base, axis=1)


def relative(equation, values):
    size = np.abs(np.prod(values**equation.powers, axis=1) * equation.values).sum()
    return abs(float(equation(values))) / size


@pytest.mark.slow
@pytest.mark.parametrize("seed", tiered(range(6), (1,)))
def test_leg_lengths_at_which_the_lines_meet_are_on_the_locus(seed, tmp_path):
    rng = np.random.default_rng(seed)
    base, platform = triangles(seed)
    found = input_loci(planar(tmp_path, Way("rpr", base=base, platform=platform)))
    assert found
    on, beside = [], []
    for _ in range(12):
        rho = lengths(base, platform, *pose_with_lines_through_a_point(base, platform, rng))
        other = lengths(base, platform, rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi))
        on.append(min(relative(x, rho) for x in found))
        beside.append(min(relative(x, other) for x in found))
    # Of degree 24, so that terms cancel to many digits everywhere.
    assert max(on) < 1e-14
    assert np.median(beside) > 1e4 * max(on)
    if seed % 2 == 0:
        # Twelve in the squares of the lengths, dense.
        (one,) = found
        assert (len(one.values), one.degree(one.names)) == (455, 24)


def poses_by_scanning(base, platform, rho):
    """Sign changes of what the third distance misses, over the two branches of the other two."""
    count = 0
    angles = np.linspace(-np.pi, np.pi, 40_001)
    for side in (1, -1):
        miss = np.full(len(angles), np.nan)
        c, s = np.cos(angles), np.sin(angles)

        def out(k, c=c, s=s):
            x, y = platform[k]
            return np.stack([c * x - s * y, s * x + c * y], axis=1)

        # The position is on two circles, about base - turned platform point.
        one, two = base[0] - out(0), base[1] - out(1)
        apart = two - one
        d = np.linalg.norm(apart, axis=1)
        along = (d**2 + rho[0] ** 2 - rho[1] ** 2) / (2 * d)
        height = rho[0] ** 2 - along**2
        ok = height >= 0
        unit = apart / d[:, None]
        normal = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
        at = one + along[:, None] * unit + side * np.sqrt(np.abs(height))[:, None] * normal
        miss[ok] = (np.linalg.norm(at + out(2) - base[2], axis=1) - rho[2])[ok]
        count += int((miss[1:] * miss[:-1] < 0).sum())
    return count


@pytest.mark.parametrize("seed", tiered((0, 2, 4, 6), (2,)))
def test_poses_are_as_many_as_the_circles_have(seed, tmp_path):
    rng = np.random.default_rng(seed)
    base, platform = triangles(seed)
    mechanism = planar(tmp_path, Way("rpr", base=base, platform=platform))
    numbers = set()
    for _ in range(12):
        rho = lengths(base, platform, rng.uniform(-0.5, 0.5, 2), rng.uniform(-np.pi, np.pi))
        if rho.min() < 0.1:
            continue
        known = poses_by_scanning(base, platform, rho)
        # Branches that end within a step of the scan are seen by neither or both signs.
        if known % 2 == 0:
            assert count_poses(mechanism, rho) == known
            numbers.add(known)
    assert len(numbers) > 1


@pytest.mark.slow
def test_the_modes_say_that_they_are_all():
    for name, working in (("planar_3rrr", 8), ("planar_3rpr", 1), ("gough_stewart", 1)):
        found = pinsing.loops.working_modes(shipped(name))
        assert (len(found.modes), found.complete) == (working, True)
        assert "all there are, by the two solutions of each leg" in found.statement
    for name in ("planar_3rrr", "planar_3rpr"):
        found = pinsing.loops.assembly_modes(shipped(name))
        assert (len(found.modes), found.complete) == (2, True)
        assert "the real roots of a polynomial of degree 6" in found.statement
    # With one start not all are found, and it says how many there are.
    few = pinsing.loops.assembly_modes(shipped("planar_3rrr"), starts=1)
    assert (len(few.modes), few.complete) == (1, False)
    assert "there are 2, by the real roots" in few.statement
