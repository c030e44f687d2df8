"""Closed forms in words: how sure they are, in one word everywhere, and the list of families."""

import itertools
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import Result
from command_line import run
from dh_arms import CRX, dh_arm
from pages import baked
from singular_sets import arm_of, closed
from tiers import tiered

import pinsing
from pinsing.algebra import budget
from pinsing.algebra.budget import Budget
from pinsing.families import certificate
from pinsing.families.certificate import prove_briefly, within
from pinsing.families.form import certainty, families_text
from pinsing.proximity.monitor import make_guard


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search that nobody asked for never has the time."""
    monkeypatch.setattr(certificate, "SHORT", 0.0)


# The arms of the gallery, as its pages are made (`docs/_ext/gallery.py`), and some whose families
# are long or whose certificate takes long.
EVERYWHERE = ["ur5", "stanford", "scara", "panda", "iiwa14", "xarm7", "puma560", "surgical7"]
EVERYWHERE += ["so101", "examples/offset_wrist.dh.yaml", "kinova", "talos_arm"]


def written(*words: str | Path) -> Result:
    result = run(*map(str, words))
    assert result.exit_code == 0, result.output
    return result


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("robot", tiered(EVERYWHERE, {"scara"}))
def test_one_arm_has_one_word_everywhere(robot: str, tmp_path: Path) -> None:
    arm = pinsing.load(robot)
    form = pinsing.closed_form(arm)
    assert form.word == "proven", form.proof
    words = {
        "text": certainty(form).split(":")[0].strip(),
        "families": re.findall("proven|probable|NOT", written("families", robot).stdout)[0],
    }
    out = {name: tmp_path / name for name in ("a.json", "page.html", "report.html", "guard.h")}
    written("families", robot, "-o", out["a.json"])
    words["JSON"] = json.loads(out["a.json"].read_text())["word"]
    words["JSON, read"] = pinsing.ClosedForm.from_json(out["a.json"].read_text()).word
    written("view", robot, "--skeleton", "-o", out["page.html"])  # as the gallery's
    words["page"] = baked(out["page.html"].read_text())["coverage"].split(":")[0].lower()
    with pinsing.Viewer(arm, skeleton=True) as viewer:
        words["live page"] = viewer._coverage.split(":")[0].lower()
    words["analyze"] = pinsing.analyze(arm, levels=(1,), random_starts=2).closed_form.word
    written("report", robot, "--skeleton", "--page", "none", "-o", out["report.html"])
    badge = r'class="badge[^"]*">(proven|probable|not complete)<'
    (words["report"],) = {*re.findall(badge, out["report.html"].read_text(encoding="utf-8"))}
    written("export", robot, "-o", out["guard.h"])
    words["guard"] = re.findall(r'_WORD "(.*)"', out["guard.h"].read_text())[0]
    words["in Python"] = make_guard(arm, "c").word
    said = {re.split(" for | of the", word)[0] for word in words.values()}
    assert said == {form.word}, words


def test_the_word_does_not_hang_on_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work is counted the same by every clock; a cap on seconds is said to be one."""
    form = pinsing.closed_form(arm_of("puma560"), prove=False)
    spent = []
    for tick in (1e-5, 4e-4):
        clock = SimpleNamespace(monotonic=itertools.count(0.0, tick).__next__)
        with monkeypatch.context() as patch:
            patch.setattr(budget, "time", clock)
            whole = Budget(1000.0, certificate.SHORT)
            assert within(form, whole, None).word == "proven"
            spent.append(whole.meter.done)
    assert spent[0] == spent[1] > 1e4
    assert prove_briefly(form, 1e-9).proof.reason.startswith("none was found in")


@pytest.mark.usefixtures("slow")
def test_what_took_longer_has_one_headline() -> None:
    done = run("families", "puma560", "--prove")
    assert done.exit_code == 0, done.stderr
    text, last = " ".join(done.stdout.split()), done.stdout.splitlines()[-1]
    assert text.startswith("3 families of singular configurations (closed forms, ")
    assert "; whether these are all stands at the end: F1 " in text
    assert last.startswith("  proven: certificate of ")
    assert "probable" not in done.stdout
    assert "no certificate" not in done.stdout


@pytest.mark.usefixtures("slow")
def test_without_time_it_says_how_much_there_was_and_what_to_do() -> None:
    done = run("families", "puma560", "-v")
    assert done.exit_code == 0
    text = " ".join(done.stdout.split())
    assert "no certificate: none was found in the 0 s of work allowed" in text
    assert "--prove, or prove=True, looks for one for 60 s" in text
    assert text.startswith("puma560: 3 families of singular configurations (probably complete)")


def test_a_search_that_failed_is_not_called_out_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise certificate.NotFound("a place could not be split")

    monkeypatch.setattr(certificate, "certificate", fail)
    form = prove_briefly(pinsing.closed_form(arm_of("puma560")), 100.0)
    assert form.proof.reason == "a place could not be split"
    assert not form.proof.out_of_time
    assert "no certificate: a place could not be split" in " ".join(certainty(form).split())


def test_names_of_joints_stand_before_the_families():
    text = families_text(closed("ur5"))
    assert text.index("joints: q1 = shoulder_pan_joint") < text.index("  F1  ")
    assert text.count("shoulder_pan_joint") == 1
    # where joints are called as their symbols are, there is nothing to say
    assert "joints:" not in families_text(closed("stanford"))


def test_half_angles_are_explained_where_they_are_printed():
    """Upper arm and forearm are equally long, so that they fold at one value of q3."""
    rows = [(*row[:2], 0.71) if row[2] == 0.54 else row for row in CRX]
    equal_links = pinsing.closed_form(dh_arm(rows), prove=False)
    assert equal_links.families[0].text == "q3 = 90°"
    text = " ".join(families_text(equal_links).split())
    assert "cos((3 q3)/2)" in text
    assert "half of q3 in F2: equations are factors of a longer one" in text
    assert "half of" not in families_text(closed("ur5"))
    equation = equal_links.families[1].branches[0].equations[0]
    q = np.array([0.3, 0.7, -1.1, 0.9, 1.3, 0.2])
    here, there = equation(q), equation(q + 2 * np.pi * np.eye(6)[2])
    assert abs(here) > 1e-3
    assert there == pytest.approx(-here)


@pytest.mark.slow
def test_a_single_term_has_no_number():
    form = pinsing.closed_form(pinsing.load("panda", task="position"), prove=False)
    assert " and sin(q3+q5) = 0" in " ".join(str(form).split())
