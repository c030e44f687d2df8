"""Slides that are counted from elsewhere than no length, and joints that the pose does not tell."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import run
from mechanisms import URDF, shipped, value
from tiers import tiered_rows
from urdf_text import J, X, frame, loop_text, written

import pinsing
from pinsing.loops import pose_forms
from pinsing.loops.closure import random_closed
from pinsing.loops.legs import most_assemblies, why_no_rods
from pinsing.loops.pose_loci import variables_at

OFF = 0.5
STROKES = [("gough_stewart", 40), ("rps3", 16), ("planar_3rpr", 6)]


def counted_from_mid_stroke(folder, name, off=OFF):
    """A shipped mechanism with the zero of each slide moved by ``off`` along it."""
    tree = ElementTree.parse(URDF / f"{name}.urdf")
    slides = [j for j in tree.iter("joint") if j.get("type") == "prismatic"]
    for joint in slides:
        origin, axis, limit = (joint.find(k) for k in ("origin", "axis", "limit"))
        at = np.array(origin.get("xyz").split(), float) + off * np.array(
            axis.get("xyz").split(), float
        )
        assert not origin.get("rpy") or not any(map(float, origin.get("rpy").split()))
        origin.set("xyz", " ".join(map(repr, at.tolist())))
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


BASE = [(-0.5, -0.31), (0.62, -0.2), (0.07, 0.55)]
ELBOWS = [(-0.51, 0.08), (0.33, -0.42), (0.41, 0.35)]
ENDS = [(-0.13, -0.09), (0.17, -0.11), (0.02, 0.19)]


def planar_rrr(folder, driven):
    """A 3-RRR with each leg driven at its first joint (1) or at its elbow (2)."""
    joints, loops = [], []
    base, elbow, end = (np.array(p) for p in (BASE, ELBOWS, ENDS))
    for k in range(3):
        joints.append(J(f"r{k}1", "base", f"a{k}", (*base[k], 0)))
        joints.append(J(f"r{k}2", f"a{k}", f"b{k}", (*(elbow - base)[k], 0)))
        if k == 0:
            joints.append(J("turn", "b0", "platform", (*(end - elbow)[0], 0)))
        else:
            joints.append(frame(f"e{k}", f"b{k}", (*(end - elbow)[k], 0)))
            joints.append(frame(f"v{k}", "platform", (*(end[k] - end[0]), 0)))
            loops.append((f"e{k}", f"v{k}"))
    joints.append(frame("out", "platform", (*-end[0], 0)))
    inputs = [f"r{k}{d}" for k, d in enumerate(driven)]
    text = loop_text(loops, inputs, "out", "vx, vy, wz")
    return pinsing.load_mechanism(written(folder, joints, text))


@pytest.mark.parametrize("driven", [(1, 2, 1), (2, 2, 2)])
def test_a_leg_driven_at_its_elbow_has_its_condition_as_equations(driven, tmp_path):
    mechanism = planar_rrr(tmp_path, driven)
    forms = pose_forms(mechanism)
    shapes = [x for x in forms.loci if "actuated elbow" in x.words]
    assert len(shapes) == 2 * driven.count(2)
    assert not any("nowhere else" in x for x in forms.notes)
    links = np.linalg.norm(np.diff(np.array([BASE, ELBOWS, ENDS]), axis=0), axis=2)
    first = [np.subtract(e, b) for e, b in zip(ELBOWS, BASE, strict=True)]
    second = [np.subtract(v, e) for v, e in zip(ENDS, ELBOWS, strict=True)]
    ratios: dict[str, list[float]] = {}
    for q in random_closed(mechanism, 4, np.random.default_rng(5)):
        at = dict(zip(mechanism.joints, q.tolist(), strict=True))
        known = variables_at(mechanism, q)
        for x in shapes:
            k = int(re.search(r"leg (\d)", x.words)[1]) - 1
            l1, l2 = links[:, k]
            bend = np.arctan2(*second[k][::-1]) - np.arctan2(*first[k][::-1]) + at[f"r{k}2"]
            reach = l1**2 + l2**2 + 2 * l1 * l2 * np.cos(bend)
            edge = (l1 + l2 if "stretched" in x.words else l1 - l2) ** 2
            ratios.setdefault(x.words, []).append(value(x.equation, known) / (reach - edge))
    assert len(ratios) == len(shapes)
    for found in ratios.values():
        np.testing.assert_allclose(found, found[0], rtol=1e-6)


def test_where_passive_joints_move_alone_is_said_where_singular_if_and_only_if_is():
    forms = pose_forms(shipped("hexaglide"))
    assert len([x for x in forms.notes if "if and only if" in x]) == 1
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
    base, end = np.array(BASE), np.array(ENDS)
    joints, loops, inputs = [], [], []
    for k in range(3):
        if kind == "elbow" and k == 1:
            joints.append(J("s1", "base", "c1", (*base[k], 0), X, "prismatic", (-2, 2)))
            joints.append(J("r1", "c1", "e1", (0.3, 0, 0)))
            joints.append(frame("tip1", "e1", (0.4, 0, 0)))
            inputs.append("r1")
        else:
            aside = 0.2 if kind == "offset" and k == 1 else 0.0
            joints.append(J(f"r{k}", "base", f"c{k}", (*base[k], 0)))
            joints.append(J(f"p{k}", f"c{k}", f"e{k}", (0, aside, 0), X, "prismatic", (-2, 2)))
            joints.append(frame(f"tip{k}", f"e{k}", (0, 0, 0)))
            inputs.append("turn" if kind == "last" and k == 0 else f"p{k}")
        if k == 0:
            joints.append(J("turn", "e0", "platform"))
        else:
            joints.append(frame(f"v{k}", "platform", (*(end[k] - end[0]), 0)))
            loops.append((f"tip{k}", f"v{k}"))
    joints.append(frame("out", "platform", (*-end[0], 0)))
    text = loop_text(loops, inputs, "out", "vx, vy, wz", home={"p0": 0.6})
    path = written(tmp_path, joints, text)
    mechanism = pinsing.load_mechanism(path)
    assert pose_forms(mechanism) is None
    reason = f"{REASONS[kind]}, which is not supported over the pose"
    assert why_no_rods(mechanism) == reason
    assert why_no_rods(shipped("planar_3rpr")) == ""
    done = run("families", "-v", path, "--loops")
    assert done.exit_code == 0
    assert reason in " ".join(done.stderr.split())
