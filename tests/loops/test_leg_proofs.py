"""Legs as arms: certificates that the checker accepts, and what they say of the whole."""

import json

import numpy as np
import pytest
from command_line import run
from mechanisms import URDF, shipped
from test_parallel_geometry import Way, planar
from tiers import tiered

import pinsing
from pinsing.errors import OptionError
from pinsing.loops import joint_forms
from pinsing.loops.closure import random_closed
from pinsing.loops.joint_loci import leg_proofs
from pinsing.loops.legs import Rod
from pinsing.proof.checker import Rejected, verify

LEGS = {"planar_3rrr": 3, "planar_3rpr": 3, "gough_stewart": 6, "delta": 6, "rps3": 3,
        "agile_eye": 3, "five_bar": 2}  # fmt: skip


@pytest.mark.parametrize("name", tiered(LEGS, ("planar_3rrr", "rps3", "agile_eye")))
def test_each_leg_is_proven(name):
    found = leg_proofs(shipped(name))
    assert len(found) == LEGS[name]
    for leg in found:
        assert leg.form.word == "proven"
        verify(json.dumps(leg.form.certificate))
        assert str(leg).endswith("proven")
        assert all(j in shipped(name).joints for j in leg.joints)


@pytest.mark.parametrize("name", tiered(["planar_3rrr", "five_bar", "agile_eye"], ()))
def test_the_legs_say_what_the_whole_says_of_type_1_and_passive_joints(name, rng):
    mechanism = shipped(name).without_limits()
    forms = joint_forms(mechanism)
    legs = leg_proofs(mechanism)
    # A leg put on one of its families: one of the equations of the whole is zero there.
    met = 0
    for leg in legs:
        for family in leg.form.families:
            for at in family.sample(2, np.random.default_rng(1)):
                q = random_closed(mechanism, 1, rng)[0].copy()
                q[[mechanism.joints.index(j) for j in leg.joints]] = at
                met += 1
                assert (
                    min(
                        abs(float(x.equation(q)))
                        for x in forms.loci
                        if x.kind in ("type 1", "passive")
                    )
                    < 1e-9
                )
    assert met


def test_a_plane_that_is_tilted_and_a_certificate_that_was_changed(tmp_path):
    found = leg_proofs(planar(tmp_path, Way("rrr", rpy=(np.pi / 2, 0, 0))))
    assert [leg.task for leg in found] == ["vx,vz"] * 3
    assert all(leg.form.word == "proven" for leg in found)
    changed = json.loads(json.dumps(found[0].form.certificate))
    changed["families"] = []
    with pytest.raises(Rejected):
        verify(json.dumps(changed))


def test_why_there_is_none_is_said():
    with pytest.raises(OptionError, match="bennett: no leg has a certificate of its own"):
        leg_proofs(shipped("bennett"))


def test_files_of_the_legs_are_checked_by_the_command(tmp_path):
    tree, target = URDF / "planar_3rrr.urdf", tmp_path / "c.cert.json"
    done = run("families", "-v", tree, "--loops", "-o", target)
    assert done.exit_code == 0
    assert "leg 2: a2, b2 up to its end (vx,vy) singular if and only if b2 = 0" in done.stdout
    assert run("verify", *(tmp_path / f"c_leg{k}.cert.json" for k in (1, 2, 3))).exit_code == 0
    assert not target.exists()
    assert pinsing.load_mechanism(tree).n == 7


def test_a_crank_whose_end_is_on_its_axis_reaches_no_other_length() -> None:
    half = 0.5 * np.eye(3)
    rod = Rod("crank", 0, np.zeros(3), np.zeros(3), first=half[0], second=half[1])
    for end in (np.zeros(3), np.array([0, 0, 0.1])):
        assert rod.solutions(end, True, 0.3) == rod.solutions(end, False, 0.3) == ()
