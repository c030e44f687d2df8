"""Singular loci over the pose in closed form, against geometry written here without pinsing."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import run
from mechanisms import URDF, shipped
from platforms import BASE, PLATFORM, on_legs, rps
from tiers import tiered_rows
from urdf_text import J, X, frame, row

import pinsing
from pinsing.loops import pose_forms
from pinsing.loops.legs import most_assemblies, why_no_rods


@pytest.mark.slow
def test_fichters_turn_by_90_degrees_is_found_by_itself():
    for name in ("gough_stewart", "stewart_6_3"):
        words = [str(f) for f in pose_forms(shipped(name)).everywhere]
        assert "turned by ±90° about z: singular at every position" in words
    # Level, only the plane of the base is singular.
    (level,) = pose_forms(shipped("gough_stewart")).level
    assert str(level.equation) == "z = 0"
    assert "sqrt(3)" not in level.equation.coefficients


def test_architecture_singularities_are_named():
    forms = pose_forms(shipped("griffis_duffy"))
    assert forms.architecture.startswith("architecture singularity: the leg lines are dependent")
    assert not forms.loci
    assert not pose_forms(shipped("gough_stewart")).architecture
    # What passes more than a force has no such form.
    assert [pose_forms(shipped(name)) for name in ("bennett", "rssr")] == [None, None]


def test_rows_that_leave_type_1_of_hinged_legs_open_are_said(tmp_path):
    base = np.array([[1, 0, 0], [-0.5, 0.87, 0], [-0.5, -0.87, 0]])
    hinges = np.array([[0, 1, 0], [-0.87, -0.5, 0], [0.87, -0.5, 0]])
    forms = pose_forms(rps(tmp_path, base, hinges, 0.5 * base, "vx, vy, vz, wx, wy, wz"))
    assert not forms.complete
    assert any("type 1 is not in these equations" in x for x in forms.notes)


STROKES = [("gough_stewart", 40), ("rps3", 16), ("planar_3rpr", 6)]


def counted_from_mid_stroke(folder, name, off=0.5):
    """A shipped mechanism with the zero of each slide moved by ``off`` along it."""
    tree = ElementTree.parse(URDF / f"{name}.urdf")
    slides = [j for j in tree.iter("joint") if j.get("type") == "prismatic"]
    for joint in slides:
        origin, axis, limit = (joint.find(k) for k in ("origin", "axis", "limit"))
        at, along = (np.array(x.get("xyz").split(), float) for x in (origin, axis))
        assert not origin.get("rpy") or not any(map(float, origin.get("rpy").split()))
        origin.set("xyz", row(at + off * along))
        for end in ("lower", "upper"):
            limit.set(end, repr(float(limit.get(end)) - off))
    tree.write(folder / f"{name}.urdf")
    text = (URDF / f"{name}.loops.yaml").read_text()
    names = "|".join(j.get("name") for j in slides)
    moved = re.sub(rf"\b({names}): ([\d.]+)", lambda m: f"{m[1]}: {float(m[2]) - off!r}", text)
    (folder / f"{name}.loops.yaml").write_text(moved)
    return pinsing.load_mechanism(folder / f"{name}.urdf")


@pytest.mark.parametrize(("name", "most"), tiered_rows(STROKES, STROKES[1:2]))
def test_the_loci_do_not_depend_on_where_slides_are_counted_from(name, most, tmp_path):
    plain, moved = shipped(name), counted_from_mid_stroke(tmp_path, name)
    one, two = pose_forms(plain), pose_forms(moved)
    assert [str(x) for x in two.loci] == [str(x) for x in one.loci]
    assert two.complete == one.complete
    assert most_assemblies(moved) == most_assemblies(plain) == most
    assert any("no length (p1 + 0.5 = 0 or" in x for x in two.notes)
    assert not any("+ 0.5" in x for x in one.notes)
    # What the limits say of a length is said of the length.
    excluded = [any("limits exclude" in x for x in f.notes) for f in (one, two)]
    assert excluded == [True, True]


@pytest.mark.slow
def test_a_locus_over_the_lengths_names_them_by_the_inputs(tmp_path):
    plain = pose_forms(shipped("planar_3rpr")).inputs[0].equation
    moved = pose_forms(counted_from_mid_stroke(tmp_path, "planar_3rpr")).inputs[0].equation
    assert moved.names == ("(p1 + 0.5)", "(p2 + 0.5)", "(p3 + 0.5)")
    np.testing.assert_array_equal(moved.powers, plain.powers)
    np.testing.assert_allclose(moved.values, plain.values, rtol=1e-9)
    assert "(p1 + 0.5)^24" in moved.exact()


def test_where_passive_joints_move_alone_is_said_where_singular_if_and_only_if_is():
    forms = pose_forms(shipped("hexaglide"))
    (only,) = (x for x in forms.notes if "if and only if" in x)
    assert only.endswith("or passive joints move by themselves (below)")
    below = forms.notes[forms.notes.index(only) :]
    assert any("universal joints whose rod lies in the plane of their two axes" in x for x in below)


REASONS = {
    "offset": "the leg of r1, p1 slides (p1) beside the line from its foot to its end",
    "elbow": "the leg of s1, r1 is driven at r1 behind the passive slide s1",
    "last": "the leg of r0, p0, turn is driven at its joint with the output (turn)",
}


@pytest.mark.parametrize("kind", REASONS)
def test_why_there_are_no_loci_over_the_pose_names_the_leg(kind, tmp_path):
    """Each leg passes one force, but one is of a kind that is not written over the pose."""
    legs, inputs = [], []
    for k in range(3):
        if kind == "elbow" and k == 1:
            slide = J("s1", "base", "c1", (*BASE[k], 0), X, "prismatic", (-2, 2))
            legs.append([slide, J("r1", "c1", "e1", (0.3, 0, 0)), frame("tip1", "e1", (0.4, 0, 0))])
            inputs.append("r1")
        else:
            aside = (0, 0.2 if kind == "offset" and k == 1 else 0.0, 0)
            slide = J(f"p{k}", f"c{k}", f"e{k}", aside, X, "prismatic", (-2, 2))
            legs.append([J(f"r{k}", "base", f"c{k}", (*BASE[k], 0)), slide])
            inputs.append("turn" if kind == "last" and k == 0 else f"p{k}")
    mechanism = on_legs(tmp_path, legs, PLATFORM, inputs, "vx, vy, wz", home={"p0": 0.6})
    assert pose_forms(mechanism) is None
    reason = f"{REASONS[kind]}, which is not supported over the pose"
    assert why_no_rods(mechanism) == reason
    assert why_no_rods(shipped("planar_3rpr")) == ""
    done = run("families", "-v", tmp_path / "made.urdf", "--loops")
    assert done.exit_code == 0
    assert reason in " ".join(done.stderr.split())
