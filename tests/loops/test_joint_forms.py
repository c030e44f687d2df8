"""Singular loci in the joint angles: against the Jacobians, and geometry written here."""

import json

import numpy as np
import pytest
from command_line import run
from mechanisms import URDF, shipped
from test_parallel_geometry import Way, planar
from tiers import sampled, tiered
from urdf_text import J, frame, loop_text, stewart, written

import pinsing
from pinsing.loops import (
    JointForms,
    JointLocus,
    LoopForms,
    PoseForms,
    joint_forms,
    mechanism_at,
    refine,
)
from pinsing.loops.closure import Loops, random_closed
from pinsing.loops.joint_loci import ClosureForms

SHELF = ["five_bar", "four_bar", "planar_3rrr", "planar_3rpr", "gough_stewart", "delta", "rps3",
         "rssr", "agile_eye"]  # fmt: skip


def left_side(locus, mechanism, q):
    """The value as it is: no row scaled."""
    if locus.equation is not None:
        return float(locus.equation(q))
    return float(np.linalg.det(locus.entries(q, mechanism.joints)))


def beside(name, mechanism, q):
    """What the forms leave out: a factor without real zeros, and the second power of a length."""
    at = dict(zip(mechanism.joints, q, strict=True))
    if name == "rssr":
        return 0.5 * np.sin(at["crank"]) - 1
    if name == "gough_stewart":
        return np.prod([at[f"p{k}"] for k in range(1, 7)])
    return 1.0


def volume(M):
    """Product of the singular values: the determinant where rows are redundant too."""
    return float(np.prod(np.linalg.svd(M, compute_uv=False)[: M.shape[1]]))


def ratios(mechanism, q):
    """What the Jacobians of Pinocchio say, over what the forms say: type 2 and type 1."""
    loops, forms = Loops(mechanism), joint_forms(mechanism)
    G, J = loops.at(q)[1], loops.output(q)[1]
    held = np.eye(mechanism.n)[list(mechanism.actuated)]
    values = {"type 1": 1.0, "type 2": 1.0, "passive": 1.0}
    for locus in forms.loci:
        values[locus.kind] *= left_side(locus, mechanism, q)
    return [
        volume(np.vstack([G, rows])) / abs(values[kind] * values["passive"])
        for kind, rows in (("type 2", held), ("type 1", J))
    ]


@pytest.mark.parametrize(
    "name", tiered(SHELF, ("gough_stewart", "rssr", "planar_3rrr", "agile_eye"))
)
def test_the_forms_are_the_determinants_of_the_jacobians(name, rng):
    # Constant ratios over all closed configurations: zero together, and nowhere else.
    mechanism = shipped(name).without_limits()
    forms = joint_forms(mechanism)
    assert forms.complete
    found = []
    for q in random_closed(mechanism, 8, rng):
        state = mechanism_at(mechanism, q)
        if min(state.output_ratio, state.input_ratio, state.constraint_ratio) < 1e-4:
            continue  # both are zero to rounding
        one = ratios(mechanism, q)
        found.append((one[0] / abs(beside(name, mechanism, q)), one[1]))
        if name == "gough_stewart":
            found[-1] = (found[-1][0], one[1] / abs(beside(name, mechanism, q)))
    assert len(found) >= 4
    assert (np.ptp(np.log(found), axis=0) < 1e-7).all()


def test_the_agile_eye_is_of_type_1_where_a_middle_joint_is_at_a_right_angle():
    forms = joint_forms(shipped("agile_eye"))
    ones = [x for x in forms.loci if x.kind == "type 1"]
    assert [str(x.equation) for x in ones] == [f"cos v{k} = 0" for k in (1, 2, 3)]


CLOSURES = ["bennett", "five_bar", "planar_3rpr", "rps3", "agile_eye", "rssr"]


@pytest.mark.parametrize(
    "name", sampled([*CLOSURES, pytest.param("delta", marks=pytest.mark.slow)])
)
def test_closure_equations_of_any_legs_are_those_of_pinocchio(name, rng):
    """The exact matrices have the ranks of the Jacobians; without a change of point the values."""
    mechanism = shipped(name).without_limits()
    made = ClosureForms(mechanism)
    held, rest = (JointLocus("", "", (), None, made.matrix(rows)) for rows in made.matrices())
    loops = Loops(mechanism)
    found = random_closed(mechanism, 3, rng)
    assert found
    point = refine(mechanism, found[0], "type 1")
    for q in [*found, *([point.q] if point.converged else [])]:
        G, J = loops.at(q)[1], loops.output(q)[1]
        pairs = ((held, G[:, list(mechanism.passive)]), (rest, np.vstack([G, J])))
        for locus, known in pairs:
            mine = np.linalg.svd(locus.entries(q, mechanism.joints), compute_uv=False)
            theirs = np.linalg.svd(known, compute_uv=False)[: len(mine)]
            if name != "bennett" and locus is held:
                np.testing.assert_allclose(mine, theirs, atol=1e-11)
            assert (mine > 1e-6).sum() == (theirs > 1e-6).sum()


ODD = {
    "from the platform": lambda folder: planar(folder, Way("rpr", from_platform=(1, 2))),
    "cut at the elbow": lambda folder: planar(
        folder, Way("rrr", cut_at_elbow=(1, 2), rpy=(0.4, 0.3, 0.2))
    ),
    "driven at the base": lambda folder: planar(folder, Way("rpr", driven="r")),
    "driven twice": lambda folder: shipped("planar_3rrr").with_actuated(["a1", "b1", "a2", "a3"]),
    "overconstrained": lambda folder: shipped("bennett"),
    "legs from the platform": lambda folder: pinsing.load_mechanism(
        written(folder, *stewart(*POINTS, hanging=(1, 2, 3, 4, 5)))
    ),
}
POINTS = np.round(np.random.default_rng(8).uniform(-1, 1, (2, 6, 3)) * [1, 1, 0.2], 2) * [
    [[1.0]], [[0.5]]
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", tiered(ODD, ("overconstrained", "cut at the elbow")))
def test_however_a_mechanism_is_written_and_driven(case, tmp_path, rng):
    """Zero at singular configurations, found by the Jacobians, and at no other."""
    mechanism = ODD[case](tmp_path).without_limits()
    forms = joint_forms(mechanism)
    assert forms.complete
    met = 0
    for q in random_closed(mechanism, 4, rng):
        state = mechanism_at(mechanism, q)
        if min(state.output_ratio, state.input_ratio, state.constraint_ratio) > 1e-3:
            assert min(x.ratio(q, forms.joints) for x in forms.loci) > 1e-6
        for kind in ("type 1", "type 2"):
            point = refine(mechanism, q, kind)
            if point.converged and point.kind == kind:
                met += 1
                assert min(x.ratio(point.q, forms.joints) for x in forms.loci) < 1e-8
    assert met or case == "overconstrained"


def test_what_holds_everywhere_and_what_nowhere_is_said():
    assert "type 2: nowhere" in joint_forms(shipped("bennett")).notes
    (always,) = [x for x in joint_forms(shipped("griffis_duffy")).notes if "singular every" in x]
    assert "type 2 holds" in always
    extra = shipped("planar_3rrr").with_actuated(["a1", "b1", "a2", "a3"])
    forms = joint_forms(extra)
    assert "rank of 4 x 3 entries below 3" in str(forms)
    assert any("4 forces where 3" in x for x in forms.notes)


def test_what_is_left_of_rounded_axes_is_no_term(tmp_path):
    """A slide along a direction that is not exact: no term comes of its last decimals."""
    joints, loops = [], []
    corners = [(0.0, 0.0, 0), (1.0, 0.1, 0), (0.4, 0.9, 0)]
    ends = [(-0.2, -0.1, 0), (0.25, -0.1, 0), (0.0, 0.3, 0)]
    for k, at in enumerate(corners):
        along = np.array([np.cos(0.3 + 2.1 * k), np.sin(0.3 + 2.1 * k), 0]).round(6)
        joints.append(J(f"p{k}", "base", f"s{k}", at, along, "prismatic", (-2, 2)))
        joints.append(J(f"b{k}", f"s{k}", f"rod{k}"))
        if k == 0:
            joints.append(J("turn", "rod0", "platform", (0.6, 0, 0)))
        else:
            joints.append(frame(f"e{k}", f"rod{k}", (0.6, 0, 0)))
            joints.append(frame(f"v{k}", "platform", np.subtract(ends[k], ends[0])))
            loops.append((f"e{k}", f"v{k}"))
    text = loop_text(loops, ["p0", "p1", "p2"], "platform", "vx, vy, wz")
    forms = joint_forms(pinsing.load_mechanism(written(tmp_path, joints, text)))
    for locus in forms.loci:
        size = np.concatenate([np.abs(locus.equation.cos), np.abs(locus.equation.sin)])
        assert size[size > 0].min() > 1e-9 * size.max()


def test_they_survive_json_and_the_command_line():
    forms = joint_forms(shipped("gough_stewart"))
    again = JointForms.from_dict(json.loads(forms.to_json()))
    q = np.linspace(0.1, 0.9, 21)
    assert np.array_equal(again.values(q), forms.values(q))
    assert str(again) == str(forms)
    done = run("families", "-v", URDF / "agile_eye.urdf", "--loops")
    assert done.exit_code == 0
    assert "determinant of 3 x 3 entries" in done.stdout
    assert "(-cos v1, -sin a1 sin v1, cos a1 sin v1)" in done.stdout
    assert "cos v2 = 0" in done.stdout


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        pytest.param("planar_3rpr", PoseForms, marks=pytest.mark.slow),
        ("five_bar", LoopForms),
        ("bennett", JointForms),
    ],
)
def test_json_of_the_command_has_both(name, kind):
    done = run("families", URDF / f"{name}.urdf", "--loops", "-o", "-")
    assert done.exit_code == 0
    found = kind.from_json(done.stdout)
    assert found.complete
    if kind is JointForms:
        assert str(found) == str(joint_forms(shipped(name)))
        return
    assert found.joint_forms is not None
    assert str(found.joint_forms) == str(joint_forms(shipped(name)))
