"""Singular loci in the joint angles, and legs as arms: against the Jacobians and the checker."""

import json

import numpy as np
import pytest
from command_line import run
from mechanisms import URDF, closed_and_refined, shipped
from platforms import Way, left_side, planar, volume
from tiers import sampled, tiered

from pinsing import loops
from pinsing.errors import OptionError
from pinsing.loops.closure import Loops, random_closed
from pinsing.loops.joint_loci import ClosureForms, leg_proofs
from pinsing.loops.legs import Rod
from pinsing.proof.checker import verify

SHELF = ["five_bar", "four_bar", "planar_3rrr", "planar_3rpr", "gough_stewart", "delta", "rps3",
         "rssr", "agile_eye"]  # fmt: skip


def beside(name, mechanism, q):
    """What the forms leave out: a factor without real zeros, and the second power of a length."""
    inputs = q[list(mechanism.actuated)]
    if name == "rssr":
        return np.array([1 - 0.5 * np.sin(inputs[0]), 1])
    return abs(np.prod(inputs)) if name == "gough_stewart" else 1.0


def ratios(mechanism, q):
    """What the Jacobians of Pinocchio say, over what the forms say: type 2 and type 1."""
    closing, forms = Loops(mechanism), loops.joint_forms(mechanism)
    G, J = closing.at(q)[1], closing.output(q)[1]
    held = np.eye(mechanism.n)[list(mechanism.actuated)]
    values = {"type 1": 1.0, "type 2": 1.0, "passive": 1.0}
    for locus in forms.loci:
        values[locus.kind] *= left_side(locus, mechanism, q)
    return np.array([
        volume(np.vstack([G, rows])) / abs(values[kind] * values["passive"])
        for kind, rows in (("type 2", held), ("type 1", J))
    ])  # fmt: skip


QUICK = ("gough_stewart", "rssr", "planar_3rrr", "agile_eye")
TWICE = ["a1", "b1", "a2", "a3"]
"""Actuators of a 3-RRR, one more than it has freedoms."""


@pytest.mark.parametrize("name", tiered(SHELF, QUICK))
def test_the_forms_are_the_determinants_of_the_jacobians(name, rng):
    # Constant ratios over all closed configurations: zero together, and nowhere else.
    mechanism = shipped(name).without_limits()
    forms = loops.joint_forms(mechanism)
    assert forms.complete
    found = []
    for q in random_closed(mechanism, 8, rng):
        state = loops.mechanism_at(mechanism, q)
        if min(state.output_ratio, state.input_ratio, state.constraint_ratio) < 1e-4:
            continue  # both are zero to rounding
        found.append(ratios(mechanism, q) / beside(name, mechanism, q))
    assert len(found) >= 4
    assert (np.ptp(np.log(found), axis=0) < 1e-7).all()


CLOSURES = ["bennett", "five_bar", "planar_3rpr", "rps3", "agile_eye", "rssr",
            pytest.param("delta", marks=pytest.mark.slow)]  # fmt: skip


@pytest.mark.parametrize("name", sampled(CLOSURES))
def test_closure_equations_of_any_legs_are_those_of_pinocchio(name, rng):
    """The exact matrices have the ranks of the Jacobians; without a change of point the values."""
    mechanism = shipped(name).without_limits()
    made = ClosureForms(mechanism)
    held, rest = (loops.JointLocus("", "", (), None, made.matrix(rows)) for rows in made.matrices())
    closing = Loops(mechanism)
    found = random_closed(mechanism, 3, rng)
    assert found
    point = loops.refine(mechanism, found[0], "type 1")
    for q in [*found, *([point.q] if point.converged else [])]:
        G, J = closing.at(q)[1], closing.output(q)[1]
        pairs = ((held, G[:, list(mechanism.passive)]), (rest, np.vstack([G, J])))
        for locus, known in pairs:
            mine = np.linalg.svd(locus.entries(q, mechanism.joints), compute_uv=False)
            theirs = np.linalg.svd(known, compute_uv=False)[: len(mine)]
            if name != "bennett" and locus is held:
                np.testing.assert_allclose(mine, theirs, atol=1e-11)
            assert (mine > 1e-6).sum() == (theirs > 1e-6).sum()


@pytest.mark.parametrize("name", tiered(["bennett", "planar_3rrr"], ("bennett",)))
def test_where_rows_are_more_than_enough(name, rng):
    """No determinants: zero at singular configurations and at no other."""
    mechanism = shipped(name).without_limits()
    if name != "bennett":
        mechanism = mechanism.with_actuated(TWICE)
    forms, met = loops.joint_forms(mechanism), 0
    assert forms.complete
    for asked, q, kind in closed_and_refined(mechanism, 4, rng, "type 1", "type 2"):
        share = min(x.ratio(q, forms.joints) for x in forms.loci)
        met += asked == kind
        assert share < 1e-8 if asked == kind else asked or share > 1e-6
    assert met or name == "bennett"


def test_what_holds_everywhere_and_what_nowhere_is_said():
    assert "type 2: nowhere" in loops.joint_forms(shipped("bennett")).notes
    with pytest.raises(OptionError, match="bennett: no leg has a certificate of its own"):
        leg_proofs(shipped("bennett"))
    (always,) = [
        x for x in loops.joint_forms(shipped("griffis_duffy")).notes if "singular every" in x
    ]
    assert "type 2 holds" in always
    extra = shipped("planar_3rrr").with_actuated(TWICE)
    forms = loops.joint_forms(extra)
    assert "rank of 4 x 3 entries below 3" in str(forms)
    assert any("4 forces where 3" in x for x in forms.notes)


def test_what_is_left_of_rounded_axes_is_no_term():
    """Cranks along a rounded root of 3 leave terms of 1e-14 and less in both forms."""
    for locus in loops.joint_forms(shipped("rus6")).loci:
        whole = locus.equation and [np.concatenate([locus.equation.cos, locus.equation.sin])]
        for row in whole or [np.concatenate([x.values for x in row]) for row in locus.matrix]:
            size = np.abs(row[row != 0])
            assert size.min() > 1e-9 * size.max()


def test_they_are_said_by_the_command():
    done = run("families", "-v", URDF / "agile_eye.urdf", "--loops")
    assert done.exit_code == 0
    assert "determinant of 3 x 3 entries" in done.stdout
    assert "(-cos v1, -sin a1 sin v1, cos a1 sin v1)" in done.stdout
    ones = [x for x in loops.joint_forms(shipped("agile_eye")).loci if x.kind == "type 1"]
    assert [str(x.equation) for x in ones] == [f"cos v{k} = 0" for k in (1, 2, 3)]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        pytest.param("planar_3rpr", loops.PoseForms, marks=pytest.mark.slow),
        ("five_bar", loops.LoopForms),
        ("bennett", loops.JointForms),
    ],
)
def test_json_of_the_command_has_both(name, kind):
    done = run("families", URDF / f"{name}.urdf", "--loops", "-o", "-")
    assert done.exit_code == 0
    found = kind.from_json(done.stdout)
    assert found.complete
    joints = found if kind is loops.JointForms else found.joint_forms
    assert str(joints) == str(loops.joint_forms(shipped(name)))


LEGS = {"planar_3rrr": 3, "planar_3rpr": 3, "gough_stewart": 6, "delta": 6, "rps3": 3,
        "agile_eye": 3, "five_bar": 2}  # fmt: skip


@pytest.mark.parametrize("name", tiered(LEGS, ("planar_3rrr", "rps3", "agile_eye")))
def test_each_leg_is_proven_and_says_what_the_whole_says(name, rng):
    """On a family of a leg one of the whole's type 1 and passive joints' equations is zero."""
    free, found = shipped(name).without_limits(), leg_proofs(shipped(name))
    assert len(found) == LEGS[name]
    loci = loops.joint_forms(free).loci if name in ("planar_3rrr", "five_bar", "agile_eye") else ()
    equations = [x.equation for x in loci if x.kind in ("type 1", "passive")]
    for leg in found:
        verify(json.dumps(leg.form.certificate))
        assert str(leg).endswith("proven")
        places = [free.joints.index(j) for j in leg.joints]
        for family in leg.form.families if loci else ():
            for at in family.sample(2, np.random.default_rng(1)):
                q = random_closed(free, 1, rng)[0].copy()
                q[places] = at
                assert min(abs(float(x(q))) for x in equations) < 1e-9
    assert not loci or any(leg.form.families for leg in found)


def test_legs_in_a_plane_that_is_tilted(tmp_path):
    found = leg_proofs(planar(tmp_path, Way("rrr", rpy=(np.pi / 2, 0, 0))))
    assert [(leg.task, leg.form.word) for leg in found] == [("vx,vz", "proven")] * 3


def test_files_of_the_legs_are_checked_by_the_command(tmp_path):
    tree, target = URDF / "planar_3rrr.urdf", tmp_path / "c.cert.json"
    done = run("families", "-v", tree, "--loops", "-o", target)
    assert done.exit_code == 0
    assert "leg 2: a2, b2 up to its end (vx,vy) singular if and only if b2 = 0" in done.stdout
    assert run("verify", *(tmp_path / f"c_leg{k}.cert.json" for k in (1, 2, 3))).exit_code == 0
    assert not target.exists()


def test_a_crank_whose_end_is_on_its_axis_reaches_no_other_length() -> None:
    half = 0.5 * np.eye(3)
    rod = Rod("crank", 0, np.zeros(3), np.zeros(3), first=half[0], second=half[1])
    for end in (np.zeros(3), np.array([0, 0, 0.1])):
        assert rod.solutions(end, True, 0.3) == rod.solutions(end, False, 0.3) == ()
