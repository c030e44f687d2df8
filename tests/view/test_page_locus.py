"""The curve of a family over two joints, as the page draws it: zeros of what Python evaluates."""

import numpy as np
import pytest
from node import needs_node, run
from tiers import tiered_rows

from pinsing import closed_form, load
from pinsing.view import Viewer

CURVE = """(m, {data, entry, q}) => {
  const branch = m.curveBranch(data.families.find((f) => f.entry === entry), q, data.joints);
  const held = q.slice();
  for (const v of branch.values) held[v.joint] = v.value;
  const [i, j] = branch.involved.slice(-2);
  const lines = m.locus(branch.equation, held, i, j, [-3.1, 3.1], [-3, 3.1]);
  return { i, j, held, lines, involved: branch.involved };
}"""


@pytest.mark.slow
@needs_node
@pytest.mark.parametrize(
    ("robot", "name"), tiered_rows([("ur5", "F3"), ("panda", "F5")], [("ur5", "F3")])
)
def test_every_end_of_the_curve_is_singular(robot: str, name: str) -> None:
    arm = load(robot)
    families = closed_form(arm).families
    viewer = Viewer(arm, families, skeleton=True)
    page = viewer._page(live=False)
    entry = [e["name"] for e in page["entries"]].index(name)
    family = families[entry]
    q = np.array(page["entries"][entry]["q"][0])
    found = run(CURVE, {"data": page["engine"], "entry": entry, "q": q.tolist()})
    assert len(found["lines"]) > 20
    branch = next(
        b for b in family.branches if b.equations
        and all(abs(found["held"][v.joint] - v.value) < 1e-9 for v in b.values)
    )  # fmt: skip
    (equation,) = branch.equations
    size = np.hypot(equation.cos, equation.sin).sum()
    for point in (p for line in found["lines"] for p in line):
        at = np.array(found["held"])
        at[[found["i"], found["j"]]] = point
        assert abs(float(equation(at))) < 1e-4 * size
    # Nothing is missed: along rows between the grid's, each change of sign has an end near it.
    ends = np.array([p for line in found["lines"] for p in line])
    for v in np.linspace(-2.9, 2.9, 7):
        row = np.repeat(np.array(found["held"])[None], 600, axis=0)
        row[:, found["i"]] = across = np.linspace(-3.05, 3.05, 600)
        row[:, found["j"]] = v
        f = np.array([float(equation(x)) for x in row])
        for k in np.flatnonzero(np.sign(f[:-1]) != np.sign(f[1:])):
            assert np.linalg.norm(ends - [across[k], v], axis=1).min() < 0.12


@needs_node
def test_a_curve_through_points_of_the_grid_passes_through_them() -> None:
    equation = {"amplitude": [1, -1], "phase": [0, 0], "rate": [[1, 0], [0, 1]], "power": None}
    equation |= {"noise": 0, "reach": 1, "curvature": 1, "size": 2}
    given = "(m, e) => m.locus(e, [0, 0], 0, 1, [-3, 3], [-3, 3])"
    ends = np.array(run(given, equation)).reshape(-1, 2)
    assert np.abs(np.ptp(np.cos(ends), axis=1)).max() < 1e-4


@pytest.mark.slow
def test_the_page_has_the_statement_of_a_long_equation() -> None:
    arm = load("panda")
    page = Viewer(arm, skeleton=True)._page(live=False)
    (said,) = [e["solved"] for e in page["entries"] if e["solved"]]
    assert said[0]["condition"].startswith("R cos(q3")
    assert said[0]["solution"].startswith("q3 = ")
    assert [name for name, _ in said[0]["where"]] == ["R cos \u03c6", "R sin \u03c6"]
