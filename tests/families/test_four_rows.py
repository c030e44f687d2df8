"""Tasks of four rows of six-joint arms: complete, against wrenches and finite fields."""

from pathlib import Path

import numpy as np
import pytest
from public import script
from tiers import tiered
from urdf_text import J, X, Y, Z, urdf

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.components import decompose
from pinsing.algebra.jacobian_matrix import corner
from pinsing.algebra.ring import make_ring

TASK = "vx,vy,vz,wz"
OFFSET_WRIST = str(Path(__file__).parents[2] / "examples" / "offset_wrist.dh.yaml")
TOOL = ((0.06, 0.02, 0.12), None)
"""Off the flange's axis, so that the last joint matters, too."""
WITH_TOOLS = {
    "three parallel axes and a tool": [
        ((0, 0, 0.09), "z"), ((0, 0.12, 0), "y"), ((0, -0.09, 0.425), "y"), ((0, 0, 0.39), "y"),
        ((0, 0.08, 0), "z"), ((0, 0, 0.095), "y"), TOOL,
    ],
    "offset wrist and a tool": [
        ((0, 0, 0.3), "z"), ((0.1, 0, 0), "y"), ((0, 0, 0.5), "y"), ((0.05, 0, 0.1), "x"),
        ((0.4, 0, 0.03), "y"), ((0.07, 0, 0.02), "x"), TOOL,
    ],
}  # fmt: skip
"""Places of the joints, metres, each seen from the one before, and their axes."""
ARMS = ("stanford", "ur5", "irb1400", "kinova", "z1", OFFSET_WRIST, *WITH_TOOLS)
SECONDS = 300.0
"""More than enough on a busy machine; idle it takes 1 to 8 s."""


def _name(source: str) -> str:
    return Path(source).stem.removesuffix(".dh")


def _urdf(rows):
    """A description of a chain that turns about axes of one frame when all joints are at zero."""
    axes = {"x": X, "y": Y, "z": Z}
    kinds = {True: "continuous", False: "fixed"}
    return urdf([
        J(f"j{i}", f"l{i - 1}", f"l{i}", place, axes.get(axis, Z), kinds[bool(axis)])
        for i, (place, axis) in enumerate(rows, 1)
    ])  # fmt: skip


@pytest.fixture(scope="module", params=tiered(list(ARMS), ("stanford",)), ids=_name)
def found(request):
    source = request.param
    if source in WITH_TOOLS:
        source = _urdf(WITH_TOOLS[source])
    arm = pinsing.load(source, task=TASK)
    return arm, pinsing.closed_form(arm, seconds=SECONDS, prove=False)


@pytest.mark.slow
def test_finite_fields_say_the_same(found):
    arm, form = found
    field = script("oracle.field")
    components = [c for f in form.families for c in f.components] + list(form.left_out)

    def missed(stated):
        """At how many of six primes a singular point is on none of these."""
        primes = field.PRIMES + field.MORE_PRIMES
        rows = arm.task.rows
        told = [*field.verdicts(form.geometry, rows, 4, stated, 40_000, 0, primes)]
        # With slices the search states equations and asks points of them for their rank,
        assert not form.slice_count or any("some regular configurations" in h for h in form.hints)
        assert all((form.slice_count or not len(v.false)) and v.rank == 4 for v in told)
        return sum(len(v.missed) > 0 for v in told)

    # A prime may divide a sum of lengths (161 mm of the Z1 by 23), and then makes a special arm
    # of it: not most of them.
    assert missed(components) <= 2
    one_less = [c for c in components if c is not components[0]]
    if components[0].codimension < 3:  # one of three is met too seldom
        assert missed(one_less) >= 4


def test_a_corner_beside_which_rows_are_zero():
    ring = make_ring((True,) * 4)
    a, b, c, d = (ring.context.gens()[ring.variables(j)[0]] for j in range(4))
    zero = ring.zero
    matrix = [[zero, a + b, b, c], [a, zero, b, d], [zero, zero, zero, c]]
    found = corner(matrix, ring, Budget(9))
    assert (found.rows, found.columns) == ((1,), (0,))  # beside it all other rows are zero
    assert (found.determinant, found.rest) == (a, [[a + b, b, c], [zero, zero, c]])
    assert corner([[a, b], [c, d]], ring, Budget(9)) is None


def test_the_regular_part_of_a_system_is_searched(rng):
    """Inside x (y + z) = 0 and x (y - w) = 0 the part x = 0 is singular, and a curve is not all."""
    ring = make_ring((True,) * 4)
    x, y, z, w = (ring.context.gens()[ring.variables(j)[0]] for j in range(4))
    matrix = [[x, y + z, ring.zero], [ring.zero, x * (z - 1), y - w]]
    result = decompose(lambda: matrix, 2, ring, Budget(60))
    assert not result.gaps
    for _ in range(2000):
        point = [int(v) for v in rng.integers(-2, 3, 4)]
        values = [[0 if e == 0 else int(str(e(*point))) for e in row] for row in matrix]
        singular = np.linalg.matrix_rank(np.array(values, dtype=float)) < 2
        on = any(
            all(point[j] == v[0] for j, v in c.values.items())
            and all(r(*point) == 0 for r in c.relations)
            for c in result.components
        )
        assert on == singular, point
