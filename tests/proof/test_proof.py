"""Certificates: made, accepted, and rejected as soon as they are anything but true."""

import itertools
import json
import re
import time
from dataclasses import replace
from pathlib import Path

import pytest
from certificates import certificate, more, place_of, proven, verdict
from command_line import python, run as pinsing_command
from singular_sets import iiwa_with_offset
from tiers import tiered

from pinsing import load
from pinsing.algebra.budget import FORKS
from pinsing.families import closed_form, prove
from pinsing.families.certificate import combination, text_of
from pinsing.families.proof_forms import form_text
from pinsing.proof import checker
from pinsing.proof.checker import Certificate, Ring

LONG = ["so101", "xarm7", "panda"]
NAMES = ["ur5", "puma560", "stanford", "surgical7", "iiwa14", "scara", "planar3r position"]
NAMES += ["planar3r one row", "ur5 orientation", "head of alex", "ur5 tool axis", "planar3r tip"]


@pytest.mark.parametrize("name", tiered([*NAMES, *LONG], NAMES))
def test_an_arm_is_proven_to_both_checkers(name):
    data = certificate(name)
    assert verdict(data) == ""
    assert len(text_of(data)) < 100_000
    assert data["places"]
    assert data["schema"] == "pinsing/certificate/3"


HARD = {
    "talos": ("talos_full_v2", "gripper_left_base_link", "torso_2_link"),
    # Four pairs of algebraic values, stated by two equations: the KUKA with its 0.436 mm.
    "iiwa14": (),
    # Two equations in the same two joints, and few equations where many may meet.
    "ur5 position": ("ur5",),
    "puma560 vx,vy,wz": ("puma560",),
    "baxter": ("baxter", "left_gripper"),
    "tiago_pro": ("tiago_pro", "arm_left_tool_link", "torso_lift_link"),
    "g1": ("g1", "left_rubber_hand", "torso_link"),
    # Relations by the half dozen: split by resultants that fall apart.
    "tiago": ("tiago", "wrist_ft_tool_link"),
    # Minors that are sums of multiples of a family's forms.
    "pr2": ("pr2", "l_gripper_l_finger_tip_link", "torso_lift_link"),
    # Ten of 28 minors state the family, and Laplace's relations the rest.
    "baxter_finger": ("baxter", "r_gripper_l_finger_tip"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HARD)
def test_systems_of_equations_are_proven(name):
    _, _, task = name.partition(" ")
    how = dict(zip(("robot", "tip", "base"), HARD[name], strict=False))
    arm = load(**how, task=task or "pose") if how else iiwa_with_offset()
    form = prove(closed_form(arm, seconds=600, prove=False), 900)
    data = proven(form)
    assert form.complete, form.gaps
    assert form.proof.size < (20_000 if task or not how else 100_000)
    if task:
        assert len(form.families) == {"position": 4, "vx,vy,wz": 3}[task]
    elif name == "talos":  # a component without a real point, by a sum of squares
        assert any(weights for place in data["places"] for _, weights, *_ in place["cases"])
    elif not how:
        assert {f["least_codimension"] for f in data["families"] if len(f["forms"]) == 2} == {2}


def test_a_form_is_a_sum_of_multiples_of_others():
    """Two equations in the same two joints: no order of these in which one could divide."""
    ring = Ring([False, False], [])
    (x1, y1), (x2, y2) = ring.pairs
    p, g = x1 * y2 + 2 * y1 * x2, 3 * x1 * x2 - y1 * y2
    first, second = combination(ring, p * x2 - 5 * g * y2, [p, g])
    assert ring.reduced(first * p + second * g) == p * x2 - 5 * g * y2
    assert combination(ring, x1 * x2, [p, g]) is None  # not zero at their common zeros
    # x1 x2 + y1 y2 and x1 y2 - y1 x2 are zero together at a complex zero of units alone.
    both = [x1 * x2 + y1 * y2, x1 * y2 - y1 * x2]
    found = combination(ring, x1, both)
    assert ring.stripped(sum(c * f for c, f in zip(found, both, strict=True))) == [x1]
    assert combination(Ring([False, False], [2]), p * x2, [p]) is None


def test_resultants_of_one_term_are_those_that_remainders_give():
    ring = Ring([False, False], [2])
    (_, y1), (x2, y2) = ring.pairs
    g = ring.parse("1x2 2x1y1y2 -1y1^2s2")
    for p in (3 * y1**4 * y2, ring.parse("1s2") * y1**3, y1 * x2**2):
        of_p = ring.resultant(p, g, 0)
        assert of_p == ring.reduced(p.resultant(g.subs({"x1": 1}), "y1")) != 0
    assert ring.resultant(y1**2, y1 * g, 0) == 0


def test_the_checker_stands_alone(tmp_path):
    text = Path(checker.__file__).read_text(encoding="utf-8")
    assert not re.search("(import|from) pinsing", text)
    alone, good, bad = (tmp_path / name for name in ("checker.py", "good.json", "bad.json"))
    alone.write_text(text, encoding="utf-8")
    data = certificate("ur5")
    good.write_text(text_of(data), encoding="utf-8")
    bad.write_text(text_of({**data, "rank": 5}), encoding="utf-8")
    code = f"import sys; sys.modules['pinsing'] = None; sys.argv[1:] = [{str(good)!r}]\n"
    code += f"import runpy; runpy.run_path({str(alone)!r}, run_name='__main__')"
    run = python("-I", "-c", code)
    assert run.returncode == 0, run
    assert run.stdout.startswith("ACCEPTED: ur5")
    for path in (bad, tmp_path / "none.json"):
        run = python("-I", alone, path)
        assert run.returncode == 1, run
        assert run.stdout.startswith("REJECTED")
        assert run.stdout.count("\n") == 1
        assert not run.stderr


def test_powers_of_x_may_be_left_out():
    """What docs/proof.md says of forms."""
    ring = Ring([False, True, False], [2])
    (x1, y1), (x2, y2), (x3, y3) = ring.pairs
    s2 = ring.context.gens()[6]
    assert ring.parse("2 -1/3y1^2y3s2") == 2 * x1 * x1 * x3 - y1 * y1 * y3 * s2 / 3
    assert ring.parse("2x1^2x3 -1/3y1^2y3s2") == ring.parse("2 -1/3y1^2y3s2")
    assert (ring.parse("1x1y2 1"), ring.parse("1x1 1")) == (x1 * y2 + x1 * x2, 2 * x1)
    forms = [x1, y1, x1 * y2 + x1 * x2, x1 * x1 * y2 - s2 * y1 * x1 * x2, ring.one, 0 * x1]
    forms += [(3 * x1 - y1) ** 2 * x3**2 * (x2 - s2 * y2) + y1 * x1 * x3 * y3 * x2]
    for form in forms:
        assert ring.parse(form_text(form)) == form


@pytest.mark.parametrize("name", ["ur5", "stanford", "scara", "planar3r position"])
def test_powers_of_x_may_be_written(name):
    data = certificate(name)
    ring = Certificate(data).ring
    whole = data["polynomials"]
    for k, text in enumerate(whole):
        whole[k] = " ".join(
            str(c) + "".join(f"{v}^{e}" for v, e in zip(ring.names, m, strict=True) if e)
            for m, c in ring.parse(text).to_dict().items()
        )
    assert "x" in "".join(whole)
    assert verdict(data) == ""


@pytest.mark.slow
def test_what_would_take_for_ever_is_rejected():
    powers = itertools.product(range(1, 20), repeat=3)
    text = " ".join(f"1x1^{a}y1^{20 - a}x2^{b}y2^{20 - b}x3^{c}y3^{20 - c}" for a, b, c in powers)
    data = more(certificate("ur5"), "polynomials", text, text.replace("1x1", "-1x1"))
    last = len(data["polynomials"]) - 1
    for said, place in (
        ("something else", place_of([last, last - 1], of_resultants=[["1", 0, 1, 0]])),
        ("too long", place_of([last], [[last], [], 50, "nowhere", 0], of_forms=[["1", 0]])),
        ("no index", place_of([last], [[0], [], 10**9, "nowhere", 0], of_forms=[["1", 0]])),
    ):
        with pytest.raises(checker.Rejected, match=said):  # the second has no limits of work
            checker.verify(text_of(more(data, "places", place)))


def test_what_is_missing_is_not_proven():
    """A family, or one of its branches."""
    form = closed_form(load("stanford"))
    assert prove(form).word == "proven"
    for k, family in enumerate(form.families):
        for less in ((), (replace(family, branches=family.branches[1:]),)):
            families = form.families[:k] + less + form.families[k + 1 :]
            tried = prove(replace(form, families=families), seconds=5)
            assert (tried.word, tried.certificate) == ("probable", None)
            assert ("on no family that is stated" if less else "split") in tried.proof.reason


def test_certificates_are_written_and_verified(tmp_path):
    """One, or several at once; what is none is rejected or cannot be read, in one line."""
    names = "good", "less", "short", "long", "bytes", "none", "unproven"
    good, less, short, long, odd, none, unproven = (tmp_path / f"{n}.cert.json" for n in names)
    run = pinsing_command("families", "ur5", "-o", good)
    assert (run.exit_code, "(proven complete)" in run.stdout) == (0, True), run
    text = good.read_text(encoding="utf-8")
    data = json.loads(text)
    less.write_text(text_of({**data, "families": data["families"][1:]}), encoding="utf-8")
    short.write_text(text[:-50], encoding="utf-8")
    long.write_text(text + " " * 5_000_000, encoding="utf-8")
    odd.write_bytes(b"\xff\xfe\x00")
    bad = [less, short, long, odd]
    for files in ([good], [good, good], *([file] for file in bad), [good, *bad]):
        run = pinsing_command("verify", *files)
        assert run.exit_code == (files[-1] != good), run
        said = re.findall(r"(?:^|\.json: )(proven \(|rejected: )", run.stdout, re.MULTILINE)
        assert said == ["proven (" if file == good else "rejected: " for file in files]
        assert run.stdout.count("\n") == len(files) or files[-1] == good
    for words in ([none], [tmp_path], [good, tmp_path], []):
        run = pinsing_command("verify", *words)
        assert (run.exit_code, run.stderr.count("\n")) == (2, 1 if words else 2), run
    run = pinsing_command("families", "ur5", "--no-prove", "-o", unproven)
    assert (run.exit_code, unproven.exists()) == (2, False)


@pytest.mark.skipif(not FORKS, reason="processes cannot be forked here")
def test_a_check_that_is_long_ends_with_its_time(monkeypatch):
    def long(text, most=None):
        if most is not None:
            raise checker.Rejected("it would take too long")
        time.sleep(600)

    monkeypatch.setattr("pinsing.families.certificate.verify", long)
    found = prove(closed_form(load("planar3r"), prove=False), 1.0).proof
    assert not found.accepted
    assert "ran out in one step of the algebra" in found.reason
