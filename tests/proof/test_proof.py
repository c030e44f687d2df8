"""Certificates: made, accepted, and rejected as soon as they are anything but true."""

from __future__ import annotations

import copy
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from singular_sets import iiwa_with_offset
from tiers import tiered

import pinsing
from pinsing import load
from pinsing.families import closed_form, prove, proving
from pinsing.proof import checker
from pinsing.proof.checker import Certificate, Rejected, Ring, verify
from pinsing.proof.minors import combination
from pinsing.proof.produce import text_of
from pinsing.proof.skeleton import form_text

CHECKER = Path(checker.__file__)

ARMS = {
    "ur5": {"robot": "ur5"},
    "puma560": {"robot": "puma560"},
    "stanford": {"robot": "stanford"},
    "surgical7": {"robot": "surgical7"},
    "iiwa14": {"robot": "iiwa14"},
    "panda": {"robot": "panda"},
    "xarm7": {"robot": "xarm7"},
    "scara": {"robot": "scara"},
    "so101": {"robot": "so101"},
    "planar3r position": {"robot": "planar3r", "task": "position"},
    "planar3r one row": {"robot": "planar3r", "task": "vx"},
    "ur5 orientation": {"robot": "ur5", "task": "orientation"},
    # Zeros of its equations at complex infinity are no singular configurations.
    "head of alex": {"robot": "alex_nub_hands", "tip": "Head"},
}
SEVERAL_EQUATIONS = {
    "baxter": {"robot": "baxter", "tip": "left_gripper"},
    "tiago_pro": {"tip": "arm_left_tool_link", "base": "torso_lift_link"},
    "g1": {"tip": "left_rubber_hand", "base": "torso_link"},
}


@pytest.fixture(scope="module")
def certificates():
    made = {}

    def certificate(name):
        if name not in made:
            form = closed_form(load(**ARMS[name]), prove=True)
            assert form.word == "proven", form.proof.reason
            made[name] = form.certificate
        return copy.deepcopy(made[name])

    return certificate


def verdict(data):
    """What the checker says: empty if it accepts."""
    try:
        verify(data if isinstance(data, str) else text_of(data))
    except Rejected as reason:
        return str(reason)
    return ""


@pytest.mark.parametrize("name", tiered(ARMS, {*ARMS} - {"so101", "xarm7", "panda"}))
def test_an_arm_is_proven(name, certificates):
    data = certificates(name)
    assert verdict(data) == ""
    assert len(text_of(data)) < 100_000
    assert data["places"]
    assert data["schema"] == "pinsing/certificate/3"


@pytest.mark.slow
def test_an_arm_whose_complex_set_is_larger_is_proven():
    """Talos: a component without a real point, by a sum of squares."""
    how = {"tip": "gripper_left_base_link", "base": "torso_2_link"}
    form = closed_form(load("talos_full_v2", **how), prove=True)
    assert form.word == "proven", form.proof.reason
    cases = [case for place in form.certificate["places"] for case in place["cases"]]
    assert any(weights for _, weights, *_ in cases)


@pytest.mark.slow
def test_joint_values_that_depend_on_each_other_are_proven():
    """The KUKA with its 0.436 mm: four pairs of algebraic values, stated by two equations."""
    form = closed_form(iiwa_with_offset(), prove=True)
    assert form.word == "proven", form.proof.reason
    pair = next(f for f in form.certificate["families"] if len(f["forms"]) == 2)
    assert pair["least_codimension"] == 2
    assert form.proof.size < 20_000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "task", "count"), [("ur5", "position", 4), ("puma560", "vx,vy,wz", 3)]
)
def test_tasks_of_a_few_rows_are_proven(robot, task, count):
    """Two equations in the same two joints (UR5), and few equations where many may meet (PUMA)."""
    form = prove(closed_form(load(robot, task=task), seconds=600.0), 600.0)
    assert form.word == "proven", form.proof.reason
    assert len(form.families) == count
    assert form.proof.size < 20_000


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
    assert found is not None
    assert ring.stripped(sum(c * f for c, f in zip(found, both, strict=True))) == [x1]
    assert combination(Ring([False, False], [2]), p * x2, [p]) is None


@pytest.mark.slow
def test_minors_that_others_make_up_over_further_ones_are_told():
    """Baxter's finger: ten of 28 minors state the family, and Laplace's relations the rest."""
    how = {"tip": "r_gripper_l_finger_tip"}
    form = prove(closed_form(load("baxter", **how), seconds=600.0), 600.0)
    assert form.complete, form.gaps
    assert form.word == "proven", form.proof.reason


@pytest.mark.slow
@pytest.mark.parametrize("name", SEVERAL_EQUATIONS)
def test_systems_of_equations_are_proven(name):
    form = closed_form(load(**{"robot": name, **SEVERAL_EQUATIONS[name]}), prove=True)
    assert form.word == "proven", form.proof.reason
    assert form.proof.size < 100_000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "how"),
    [
        # Relations by the half dozen: split by resultants that fall apart.
        ("tiago", {"tip": "wrist_ft_tool_link"}),
        # Minors that are sums of multiples of a family's forms.
        ("pr2", {"tip": "l_gripper_l_finger_tip_link", "base": "torso_lift_link"}),
    ],
)
def test_arms_of_eight_joints_are_proven(name, how):
    form = prove(closed_form(load(name, **how), seconds=300, prove=False), 900)
    assert form.word == "proven", form.proof.reason
    assert form.proof.size < 100_000


def test_the_checker_stands_alone(tmp_path, certificates):
    """A copy of the file, in a process that cannot import pinsing."""
    text = CHECKER.read_text(encoding="utf-8")
    assert "import pinsing" not in text
    assert "from pinsing" not in text
    alone = tmp_path / "checker.py"
    alone.write_text(text, encoding="utf-8")
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    data = certificates("ur5")
    good.write_text(text_of(data), encoding="utf-8")
    data["rank"] = 5
    bad.write_text(text_of(data), encoding="utf-8")
    code = f"import sys; sys.modules['pinsing'] = None; sys.argv[1:] = [{str(good)!r}]\n"
    code += f"import runpy; runpy.run_path({str(alone)!r}, run_name='__main__')"
    run = subprocess.run(
        [sys.executable, "-I", "-c", code], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run
    assert run.stdout.startswith("ACCEPTED: ur5")
    for path in (bad, tmp_path / "none.json"):
        command = [sys.executable, "-I", str(alone), str(path)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 1, run
        assert run.stdout.startswith("REJECTED")
        assert run.stdout.count("\n") == 1
        assert not run.stderr


def test_the_checker_draws_and_factors_nothing():
    text = CHECKER.read_text(encoding="utf-8")
    for word in ("random", "factor(", "float(", "numpy"):
        assert word not in text.replace("no\nfactoring, no floats, no random numbers", ""), word


# Mutants: every one is false, but those that are named -------------------------------------


def without_family(data, k):
    """Family k taken out; cases that end in it end in the one before."""
    data["families"].pop(k)
    for place in data["places"]:
        for case in place["cases"]:
            if case[3] == "family" and case[4] >= k:
                case[4] = max(0, case[4] - 1)
    return data


MUTATED = [
    "ur5",
    "stanford",
    "scara",
    "planar3r position",
    pytest.param("surgical7", marks=pytest.mark.slow),
    pytest.param("iiwa14", marks=pytest.mark.slow),
    pytest.param("panda", marks=pytest.mark.slow),
]


@pytest.mark.parametrize("name", MUTATED)
def test_no_family_may_be_dropped(name, certificates):
    for k in range(len(certificates(name)["families"])):
        assert verdict(without_family(certificates(name), k)), k


@pytest.mark.parametrize("name", MUTATED)
def test_no_branch_may_be_dropped(name, certificates):
    data = certificates(name)
    for i in range(len(data["places"])):
        for k in range(len(data["places"][i]["cases"])):
            data = certificates(name)
            data["places"][i]["cases"].pop(k)
            assert verdict(data), (i, k)


@pytest.mark.parametrize("name", MUTATED)
def test_no_two_branches_may_be_swapped(name, certificates):
    for i, place in enumerate(certificates(name)["places"]):
        cases = place["cases"]
        for a in range(len(cases)):
            for b in range(a):
                leads = cases[a][3:], cases[b][3:]
                # Where a case is too small whatever comes after it, a place for it is no lie.
                if leads[0] == leads[1] or "nowhere" in (leads[0][0], leads[1][0]):
                    continue
                data = certificates(name)
                mine = data["places"][i]["cases"]
                mine[a][3:], mine[b][3:] = leads[1], leads[0]
                assert verdict(data), (i, a, b)


@pytest.mark.parametrize("name", MUTATED)
def test_a_joint_value_may_not_change(name, certificates):
    for k, family in enumerate(certificates(name)["families"]):
        for i, form in enumerate(family["forms"]):
            data = certificates(name)
            text = data["polynomials"][form]
            if len(re.findall("[xy]", text)) > 2 or len({*re.findall(r"[xy](\d+)", text)}) > 1:
                continue  # no joint's value
            joint = re.search(r"[xy](\d+)", text)[1]
            moved = f"100x{joint} 1y{joint}" if "y" in text else f"1x{joint} 1/100y{joint}"
            data["polynomials"].append(moved)
            data["families"][k]["forms"][i] = len(data["polynomials"]) - 1
            assert verdict(data), (k, text)


@pytest.mark.parametrize("name", MUTATED)
def test_a_polynomial_may_not_change(name, certificates):
    """A sign, and a coefficient, of each."""
    for k, text in enumerate(certificates(name)["polynomials"]):
        data = certificates(name)
        if " " in text:
            last = text.split(" ")[-1]
            other = last[1:] if last.startswith("-") else f"-{last}"
            data["polynomials"][k] = text.removesuffix(last) + other
        else:
            data["polynomials"][k] = (
                text.replace("x", "y") if "x" in text else text.replace("y", "x")
            )
        assert verdict(data), text


@pytest.mark.parametrize("name", MUTATED)
def test_rank_and_rows_may_not_change(name, certificates):
    for rank in range(7):
        data = certificates(name)
        if rank != data["rank"]:
            data["rank"] = rank
            assert verdict(data), rank
    data = certificates(name)
    data["rows"] = data["rows"][1:]
    assert verdict(data)


def determinant(data):
    """The one minor of a 6-joint arm, and its ring."""
    read = Certificate(data)
    (minor,) = read.minors(read.rank, {})
    return read.ring, read.ring.stripped(minor)[0]


def proportional(a, b):
    return a.leading_coefficient() * b == b.leading_coefficient() * a


@pytest.mark.parametrize("name", tiered(["ur5", "puma560", "stanford"], ("puma560",)))
def test_a_length_may_not_change(name, certificates):
    """Accepted if and only if the determinant stays what it was: then what it says is true."""
    accepted = rejected = 0
    _ring, before = determinant(certificates(name))
    for i in range(len(certificates(name)["chain"])):
        for axis in range(3):
            data = certificates(name)
            t = data["chain"][i]["translation"]
            t[axis] = f"{t[axis]} 1/50"
            same = proportional(before, determinant(data)[1])
            assert bool(verdict(data)) != same, (i, axis)
            accepted, rejected = accepted + same, rejected + (not same)
    assert accepted >= 4
    assert rejected >= 4
    data = certificates(name)
    tip = data["tip"]["translation"]
    tip[0] = f"{tip[0]} 1/50"
    assert verdict(data) == ""  # for the pose the tip does not matter


def test_a_rotation_may_not_change(certificates):
    data = certificates("ur5")
    data["chain"][2]["rotation"] = [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "2"]]
    assert "rotation" in verdict(data)
    data["chain"][2]["rotation"] = [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "-1"]]
    assert "rotation" in verdict(data)


# Hostile files --------------------------------------------------------------------------


def test_what_claims_without_proof_is_rejected(certificates):
    every = [[*range(6)], [*range(6)]]
    leaf = {"forms": [], "of_forms": [], "of_minors": [], "of_resultants": [], "cases": []}
    one = [["1", every, []]]
    for closing in (
        {},
        {"of_forms": [["1", 0]]},
        {"of_minors": [["0", every, []]]},
        {"of_minors": one},
        {"of_minors": [["1", [[], []], []]]},
        {"of_minors": [["1", [[0, 0, 0], [0, 1, 2]], []]]},
        {"of_minors": one, "cases": [[[], [], 1, "nowhere", 0]]},
        {"of_minors": one, "cases": [[[], [], 1, "family", 0]]},
        {"of_minors": one, "cases": [[[0], [], 1, "family", 0]]},
        {"of_minors": one, "cases": [[[0], [], 1, "family", -1]]},
        {"of_minors": one, "cases": [[[0], [], 1, "place", 0]]},
        {"of_minors": one, "cases": [[[0], [], 1, "nowhere", 0]]},
        {"of_minors": one, "cases": [[[0], ["1"], 1, "family", 0]]},
        {"of_minors": one, "cases": [[[0, 1], [], 1, "family", 0]]},
    ):
        for families in ([], certificates("ur5")["families"]):
            data = certificates("ur5")
            data["families"], data["places"] = families, [{**leaf, **closing}]
            assert verdict(data), closing
    data = certificates("ur5")
    data["places"] = []
    assert verdict(data)


def test_cases_lead_forward_only(certificates):
    data = certificates("surgical7")
    i, case = next(
        (i, case)
        for i, place in enumerate(data["places"])
        for case in place["cases"]
        if i and case[3] == "place"
    )
    for then in (0, i, -1, 10**9, True, "1", 1.0, None):
        case[4] = then
        assert verdict(data), then
    for to in ("", "Place", "polynomials", None, 0):
        case[3] = to
        assert verdict(data), to


@pytest.mark.parametrize(
    "number",
    ["NaN", "1e400", "1/0", "0x10", "", "--1", "1//2", "1.5", "1x1", "9" * 5000, "1s2", "inf"],
)
def test_odd_numbers_are_rejected(number, certificates):
    data = certificates("ur5")
    data["chain"][1]["translation"][0] = number
    assert verdict(data)


def test_powers_of_x_may_be_left_out():
    """What docs/proof.md says of forms."""
    ring = Ring([False, True, False], [2])
    (x1, y1), (x2, y2), (x3, y3) = ring.pairs
    s2 = ring.context.gens()[6]
    assert ring.parse("2 -1/3y1^2y3s2") == 2 * x1 * x1 * x3 - y1 * y1 * y3 * s2 / 3
    assert ring.parse("2x1^2x3 -1/3y1^2y3s2") == ring.parse("2 -1/3y1^2y3s2")
    assert ring.parse("1x1y2 1") == x1 * y2 + x1 * x2
    assert ring.parse("1x1 1") == 2 * x1
    forms = [x1, y1, x1 * y2 + x1 * x2, x1 * x1 * y2 - s2 * y1 * x1 * x2, ring.one, 0 * x1]
    forms += [(3 * x1 - y1) ** 2 * x3**2 * (x2 - s2 * y2) + y1 * x1 * x3 * y3 * x2]
    for form in forms:
        assert ring.parse(form_text(form)) == form


@pytest.mark.parametrize("name", MUTATED)
def test_powers_of_x_may_be_written(name, certificates):
    """The same certificate with all powers of x in each term."""
    data = certificates(name)
    ring = Certificate(data).ring
    whole = data["polynomials"]
    for k, text in enumerate(whole):
        whole[k] = " ".join(
            str(c) + "".join(f"{v}^{e}" for v, e in zip(ring.names, m, strict=True) if e)
            for m, c in ring.parse(text).to_dict().items()
        )
    assert "x" in "".join(whole)
    assert verdict(data) == ""


@pytest.mark.parametrize(
    "polynomial",
    [
        *("", " ", "x1", "1x1 1", "1x1^999y1", "1x1**2", "1x99", "1x1 ", "1x1 - 1y1", "1x1*1"),
        *("1é", "1x1^-1", "1x0", "1x1^0", "1/0x1", "1.0x1", "1z1", 1, None, [], "１x1", "1x1\n"),
    ],
)
def test_odd_polynomials_are_rejected(polynomial, certificates):
    data = certificates("ur5")
    data["polynomials"][0] = polynomial
    assert verdict(data)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "1",
        "NaN",
        '{"schema": "pinsing/certificate/1"}',
        '{"schema": "pinsing/certificate/2"}',
        '{"schema": "pinsing/certificate/3"}',
        '{"schema": 1, "schema": 2}',
        "[" * 100_000,
        '{"a":' * 50_000,
        '{"rank": 1e5}',
        '{"rank": Infinity}',
        " " * 5_000_000,
    ],
)
def test_what_is_no_certificate_is_rejected(text):
    reason = verdict(text)
    assert reason
    assert "\n" not in reason
    assert len(reason) < 300


def test_an_old_format_is_named():
    for old in (1, 2):
        reason = verdict(json.dumps({"schema": f"pinsing/certificate/{old}"}))
        assert "pinsing/certificate/3" in reason
        assert "anew" in reason


def test_keys_may_not_repeat_and_floats_may_not_be(certificates):
    text = text_of(certificates("ur5"))
    assert verdict(text) == ""
    assert "twice" in verdict(text.replace('{"schema"', '{"rank":6,"schema"', 1))
    assert verdict(text.replace('"rank":6', '"rank":6.0'))


@pytest.mark.slow
def test_what_would_take_for_ever_is_rejected(certificates):
    """Long polynomials in a resultant, and to a high power."""
    powers = range(1, 20)
    text = " ".join(
        f"1x1^{a}y1^{20 - a}x2^{b}y2^{20 - b}x3^{c}y3^{20 - c}"
        for a in powers
        for b in powers
        for c in powers
    )
    data = certificates("ur5")
    data["polynomials"] += [text, text.replace("1x1", "-1x1")]
    last = len(data["polynomials"]) - 1
    none = {"of_forms": [], "of_minors": [], "cases": []}
    place = {"forms": [last, last - 1], "of_resultants": [["1", 0, 1, 0]], **none}
    data["places"].append(place)
    assert "tells nothing" in verdict(data)
    place |= {"of_resultants": [], "of_forms": [["1", 0]]}
    place["cases"] = [[[last], [], 50, "nowhere", 0]]
    assert "too long" in verdict(data)
    place["cases"] = [[[0], [], 10**9, "nowhere", 0]]
    assert "no index" in verdict(data)


def test_a_relation_of_a_joint_that_is_fixed_counts_not_twice(certificates):
    """A family may not look smaller than it is."""
    data = certificates("ur5")
    family = data["families"][0]
    (form,) = family["forms"]
    family["least_codimension"] = 2
    assert "larger" in verdict(data)
    family["forms"] = [form, form]
    assert "larger" in verdict(data)
    data["polynomials"].append(
        "2".join(re.split("(?<![0-9^xy/])1(?=[xy])", data["polynomials"][form]))
    )
    family["forms"] = [form, len(data["polynomials"]) - 1]
    assert "larger" in verdict(data)


# Words ----------------------------------------------------------------------------------


def test_answer_first_and_proof_on_top():
    plain = closed_form(load("ur5"), prove=False)
    assert plain.proof is None
    assert plain.word == "probable"
    assert plain.certificate is None
    proven = pinsing.families.prove(plain)
    assert proven.word == "proven"
    assert proven.proof.size == len(text_of(proven.certificate))
    again = type(proven).from_json(proven.to_json())
    assert again.word == "proven"
    assert again.certificate is None
    assert json.loads(proven.to_json())["proof"]["accepted"] is True


@pytest.mark.parametrize(("factor", "word"), [(4.0, "proven"), (1e-3, "probable")])
def test_work_decides_the_word_and_no_clock(monkeypatch, factor, word):
    """Unasked, a proof has so much work: it takes as much on any machine."""
    monkeypatch.setattr(proving, "SHORT", factor * proving.SHORT)
    tried = proving.prove_briefly(closed_form(load("ur5"), prove=False), 600.0)
    assert tried.word == word
    assert tried.proof.accepted or "of work allowed" in tried.proof.reason


def test_what_is_missing_is_not_proven():
    """A closed form without one of its families finds no certificate."""
    from dataclasses import replace

    form = closed_form(load("ur5"))
    for k in range(3):
        less = replace(form, families=form.families[:k] + form.families[k + 1 :])
        tried = pinsing.families.prove(less, seconds=5)
        assert tried.word == "probable"
        assert tried.certificate is None
        assert tried.proof.reason


# Commands -------------------------------------------------------------------------------


def pinsing_command(*args):
    command = [sys.executable, "-m", "pinsing", *map(str, args)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_certificate_is_written_and_verified(tmp_path):
    path = tmp_path / "ur5.cert.json"
    run = pinsing_command("families", "ur5", "-o", path)
    assert run.returncode == 0, run
    assert "(proven complete)" in run.stdout
    run = pinsing_command("verify", path)
    assert run.returncode == 0, run
    assert run.stdout.startswith("proven (")
    data = json.loads(path.read_text(encoding="utf-8"))
    data["families"].pop()
    path.write_text(json.dumps(data), encoding="utf-8")
    run = pinsing_command("verify", path)
    assert run.returncode == 1, run
    assert run.stdout.startswith("rejected: ")
    assert run.stdout.count("\n") == 1


def test_what_cannot_be_verified_is_said_in_one_line(tmp_path):
    run = pinsing_command("verify", tmp_path / "none.json")
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    folder = pinsing_command("verify", tmp_path)
    assert folder.returncode == 2
    assert "Traceback" not in folder.stderr
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe\x00")
    run = pinsing_command("verify", tmp_path / "bytes.json")
    assert run.returncode == 1
    assert run.stdout.startswith("rejected: ")
    run = pinsing_command("families", "ur5", "--no-prove", "-o", tmp_path / "x.cert.json")
    assert run.returncode == 2
    assert not (tmp_path / "x.cert.json").exists()


def test_several_certificates_are_verified_at_once(tmp_path, certificates):
    text = text_of(certificates("scara"))
    good, short, long = (tmp_path / f"{name}.json" for name in ("good", "short", "long"))
    good.write_text(text, encoding="utf-8")
    short.write_text(text[:-50], encoding="utf-8")
    long.write_text(text + " " * 5_000_000, encoding="utf-8")
    run = pinsing_command("verify", good, good)
    assert run.returncode == 0, run
    assert run.stdout.count("proven (") == 2
    run = pinsing_command("verify", good, short, long)
    assert run.returncode == 1, run
    assert [": rejected: " in line for line in run.stdout.splitlines()] == [False, True, True]
    assert pinsing_command("verify").returncode == 2
    assert pinsing_command("verify", good, tmp_path).returncode == 2


def test_families_without_names_are_rejected(certificates):
    data = certificates("stanford")
    for family in data["families"]:
        del family["name"]
    assert "families" in verdict(data)
