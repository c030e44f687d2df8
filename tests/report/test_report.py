"""The report: one file, whole, readable without us, and safe whatever a robot is called."""

import base64
import functools
import json
import re
from html import unescape
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest
from arms import URDF, textbook
from command_line import run
from tiers import tiered_rows

import pinsing
from pinsing.errors import ConfigurationError, OptionError, OutputError
from pinsing.proof.checker import verify
from pinsing.proximity.trajectory import summary
from pinsing.report.arm_report import arm_report, write_report


def parsed(html: str) -> ElementTree.Element:
    """A page as a tree, without the text of scripts and styles; wrong nesting fails."""
    whole = re.sub(r"<(meta|link|img|br|input|hr)\b([^>]*)>", r"<\1\2/>", html.partition(">")[2])
    page = ElementTree.fromstring(whole)
    for element in page.iter():
        if element.tag in ("script", "style"):
            element.text = ""
    return page


def text(page: ElementTree.Element) -> str:
    return " ".join(" ".join(page.itertext()).split())


def headings(page: ElementTree.Element) -> list[tuple[int, str]]:
    found = [e for e in page.iter() if re.fullmatch("h[1-6]", e.tag)]
    return [(int(e.tag[1]), "".join(e.itertext())) for e in found]


def written(robot: Any, folder: Path, **options: Any) -> str:
    """The page of a report."""
    write_report(robot, folder / "r.html", **{"page": "none", **options})
    return (folder / "r.html").read_text()


@functools.cache
def planar() -> str:
    """A small arm's report without the interactive model."""
    arm = textbook("planar3r", task="position")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "0")
        return arm_report(arm, pinsing.closed_form(arm, prove=True), {}, False, None, True)[0]


def inside(html: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="pinsing-report">(.*?)</script>', html)
    assert found
    return dict(json.loads(found[1]))


def test_it_says_what_somebody_needs_who_was_not_there() -> None:
    page = parsed(planar())
    assert [words for level, words in headings(page) if level == 2] == [
        "Summary", "Map of two joints", "The families", "Special configurations",
        "How sure this is", "The robot", "What was assumed", "How it was computed",
        "What the words mean", "For programs",
    ]  # fmt: skip
    form = pinsing.closed_form(textbook("planar3r", task="position"))
    for family in form.families:
        assert (3, f"Family {family.name}") in headings(page)
        assert family.reason[1:] in text(page)
    for words in (
        "three joints between base_link and tool0", "proven", pinsing.__version__, "Pinocchio"
    ):  # fmt: skip
        assert words in text(page)


def test_it_is_accessible() -> None:
    page = parsed(planar())
    assert page.attrib == {"lang": "en"}
    levels = [level for level, _ in headings(page)]
    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in pairwise(levels))
    pictures = [*page.iter("img")]
    assert len(pictures) >= 2
    assert all(len(p.get("alt", "")) > 40 for p in pictures)
    assert len([*page.iter("caption")]) == len([*page.iter("table")])
    assert all(cell.get("scope") for cell in page.iter("th"))
    ids = [e.get("id") for e in page.iter() if "id" in e.attrib]
    assert len(ids) == len(set(ids))
    links = [e.get("href", "") for e in page.iter("a")]
    assert {link[1:] for link in links if link.startswith("#")} <= set(ids)


def test_nothing_comes_from_elsewhere_and_no_script_runs() -> None:
    page = parsed(planar())
    for element in page.iter():
        for key, value in element.items():
            assert key != "style"
            assert not key.startswith("on")
            if key in ("src", "href", "data", "action", "poster"):
                assert value.startswith(("#", "data:")), value
    assert [e.get("type") for e in page.iter("script")] == ["application/json"]
    policy = next(m.get("content", "") for m in page.iter("meta") if "http-equiv" in m.attrib)
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy


def test_the_data_in_it_are_results_and_the_certificate_is_accepted() -> None:
    (link,) = (a.get("href", "") for a in parsed(planar()).iter("a") if "download" in a.attrib)
    certificate = base64.b64decode(link.split(",", 1)[1]).decode()
    assert verify(certificate) is not None
    data = inside(planar())
    assert data["certificate"] == json.loads(certificate)
    form = pinsing.ClosedForm.from_dict(data["families"])
    assert [f.text for f in form.families] == ["q2 = 0° or 180° and q3 = 0° or 180°"]
    states = {s["name"]: pinsing.State.from_dict(s["state"]) for s in data["special"]}
    assert states["zero, which is mid-range"].singular
    assert data["versions"]["pinsing"] == pinsing.__version__


BENT = np.array([0.3, 1.0, 0.4, 0.2, 0.9, 0.1])


@functools.cache
def stanford() -> tuple[str, Any]:
    """Report of an arm that is singular at zero, and the form that it is of."""
    arm = textbook("stanford")
    form = pinsing.closed_form(arm)
    html, page = arm_report(arm, form, {"bent": BENT}, False, None, True)
    assert page is None
    return html, form


def typed(arm: Any, pattern: str, text: str) -> np.ndarray:
    """A configuration that a reader can type, in degrees and metres there."""
    q = np.array([float(x) for x in re.search(pattern, text)[1].split(",")])
    return np.where(arm.prismatic, q, np.radians(q))


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_what_is_lost_is_what_is_lost_at_the_configuration_that_stands_there() -> None:
    arm, html = textbook("stanford"), stanford()[0]
    parts = html.split('<h3 id="F')[1:]
    assert len(parts) == 3
    for part in parts:
        state = pinsing.at(arm, typed(arm, r"<pre>--deg --q[ =]([^<]*)</pre>", part))
        assert state.status == "singular"
        assert state.lost
        said = " ".join(unescape(re.sub("<[^>]*>", " ", part)).split())
        for motion in state.lost:
            assert str(motion)[1:] in said


@pytest.mark.usefixtures("undrawn")
def test_verdicts_are_those_of_at() -> None:
    arm, given = textbook("stanford"), {"bent": BENT}
    html, form = stanford()
    states = {s["name"]: s for s in inside(html)["special"]}
    assert set(states) == {"zero, which is mid-range", "bent", "clearest found"}
    assert states["clearest found"]["clearance"]["lower"] > 0.4
    assert states["bent"]["state"]["status"] == pinsing.at(arm, given["bent"]).status == "regular"
    near = float(pinsing.clearance(form, given["bent"], certify=True).upper)
    assert states["bent"]["clearance"]["upper"] == pytest.approx(near, abs=1e-6)
    said = text(parsed(html))
    assert f"{np.degrees(near):.3g}°" in said
    q = typed(arm, r"The zero pose is singular.*?--deg --q ([-0-9.,e]+\d)", said)
    assert pinsing.at(arm, q).status == "regular"


HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(2)>'


@pytest.mark.usefixtures("undrawn")
def test_hostile_names_are_shown_not_obeyed(tmp_path: Path) -> None:
    urdf = (URDF / "planar3r.urdf").read_text()
    for name in ("q2", "planar3r"):
        urdf = urdf.replace(f'name="{name}"', f"name={quoteattr(HOSTILE)}")
    arm = pinsing.load(urdf, task="position")
    assert HOSTILE in arm.joints
    html = written(arm, tmp_path)
    assert "<script>alert" not in html
    assert "<img src=x" not in html
    page = parsed(html)
    assert HOSTILE in text(page)
    assert [e.get("type") for e in page.iter("script")] == ["application/json"]
    assert HOSTILE in inside(html)["robot"]["arm"]["joints"]


@pytest.mark.usefixtures("undrawn")
def test_an_arm_without_singularities(tmp_path: Path) -> None:
    page = parsed(written(pinsing.load("planar3r", task="wz"), tmp_path))
    assert "has no singular configuration" in text(page)


@pytest.mark.slow
def test_a_trajectory_is_judged_and_pictures_have_their_size(tmp_path: Path) -> None:
    arm, way = textbook("planar3r", task="position"), [[0, -0.5, 0.2], [0, 0.5, -0.3]]
    outline = parsed(written(arm, tmp_path, trajectory=way))
    check = pinsing.check_trajectory(arm, way)
    assert (2, "The trajectory") in headings(outline)
    verdict = summary(check, file="path", robot="ROBOT").splitlines()[0]
    met = text(outline).partition("Summary")[2].partition(" has three joints")[0]
    assert " ".join(verdict.split()) in met
    assert "Slow down, or keep away from F1" in met
    pictures = [*outline.iter("img")]
    assert len(pictures) == len({one.get("src") for one in pictures}) > 3  # none twice
    # On paper 180 mm wide letters keep their nine points.
    assert all(100 < int(one.get("width", 0)) <= 7.1 * 96 for one in pictures)


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_one_without_a_complete_answer_says_so() -> None:
    arm = textbook("surgical7")
    form = pinsing.closed_form(arm, seconds=1e-3)
    assert not form.complete
    words = text(parsed(arm_report(arm, form, {}, False, None, True)[0]))
    assert "NOT complete" in words.split("Map of two joints")[0]  # on page one
    assert form.gaps[0].split("(")[0][:40] in words


@pytest.mark.slow
def test_a_mechanism(tmp_path: Path) -> None:
    mechanism = pinsing.load_mechanism("five_bar")
    html = written(mechanism, tmp_path, poses={"far": [0.0, 0.0], "asked": [0.9, 2.2]})
    page = parsed(html)
    found = pinsing.loops.analyze_mechanism(mechanism)
    for locus in found.forms.loci:
        assert locus.words in text(page)
    assert {"type 1", "type 2"} <= {p["kind"] for p in inside(html)["mechanism"]["points"]}
    # The modes, the map over the inputs, the workspace, and each locus.
    pictures = [*page.iter("img")]
    assert len(pictures) == 3 + len(found.forms.loci)
    assert all(len(p.get("alt", "")) > 40 for p in pictures)
    names = [s["name"] for s in inside(html)["special"]]
    assert names == ["home", "zero", "far", "asked"]  # joints without limits have no middle


@pytest.mark.slow
def test_the_command_writes_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ("planar3r", "--task", "position", "--skeleton", "--deg", "--q", "10,20,30")
    result = run("report", *words, "-o", "r.html")
    assert result.exit_code == 0, result.output + repr(result.exception)
    assert [p.name for p in tmp_path.iterdir()] == ["r.html"]
    html = Path("r.html").read_text()
    assert len(html.encode()) < 3e6
    page = parsed(html)
    assert "10°, 20°, 30°" in text(page)
    (frame,) = page.iter("iframe")
    assert frame.get("srcdoc", "").startswith("<!DOCTYPE html>")
    assert frame.get("title")


FAILING = [(None, "needs Chromium"), ("/bin/false", "printed nothing")]


@pytest.mark.parametrize(("browser", "said"), tiered_rows(FAILING, FAILING[:1]))
def test_without_a_browser_that_prints_no_file_is_left(browser, said, tmp_path, monkeypatch):
    monkeypatch.setattr("pinsing.view.picture.find_browser", lambda: browser)
    arm = textbook("planar3r", task="position")
    with pytest.raises(OutputError, match=said):
        write_report(arm, tmp_path / "r.html", page="none", pdf=tmp_path / "r.pdf")
    assert not list(tmp_path.iterdir())


def test_forms_of_another_arm_are_refused(tmp_path: Path) -> None:
    form = pinsing.closed_form(textbook("stanford"))
    for file, given, error, words in (
        (tmp_path / "r.html", {"forms": form}, OptionError, "joints"),
        (tmp_path / "r.html", {"poses": {"home": [1.0]}}, ConfigurationError, "pose home"),
        (None, {}, OptionError, "nothing to write"),
    ):
        with pytest.raises(error, match=words):
            write_report(textbook("planar3r"), file, **given)


@pytest.mark.slow
def test_the_same_twice() -> None:
    """But for the time that it took."""
    times = r'"(check_)?seconds":[-e\d.]+|[\d.e+-]+ m?s\b|<dd>[\d.e-]+ s</dd>'
    one, other = (re.sub(times, "", planar.__wrapped__()) for _ in range(2))
    assert one == other
    assert "1970-01-01 00:00 UTC" in one


WIDER = """[...document.querySelectorAll('html, .wide, figure')]
  .filter((x) => x.scrollWidth > x.clientWidth).length"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar3r", "ur5", "panda", "surgical7", "so101", "hc10"])
def test_reports_of_real_arms_in_a_browser_and_on_paper(name, tmp_path: Path, page: Any) -> None:
    arm = textbook(name, task="position") if name == "planar3r" else pinsing.load(name)
    html = written(arm, tmp_path, page="inside", skeleton=True, pdf=tmp_path / "r.pdf")
    assert (tmp_path / "r.html").stat().st_size < 3_000_000
    paper = (tmp_path / "r.pdf").read_bytes()
    assert paper.startswith(b"%PDF")
    families = [words for _, words in headings(parsed(html)) if words.startswith("Family F")]
    assert len(families) == len(pinsing.closed_form(arm).families)
    most = {"ur5": 7, "panda": 8, "hc10": 5}.get(name, 12)  # pages, none of them half-empty
    assert len(re.findall(rb"/Type */Page\b", paper)) <= most
    page.goto((tmp_path / "r.html").as_uri())
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate(WIDER) == 0
    assert page.evaluate("document.querySelectorAll('math').length") > 3
    assert page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth > 200)")
    if name == "planar3r":  # so does the model inside
        page.click("summary")
        page.frame_locator("iframe").locator("body[data-ready=yes]").wait_for(timeout=90_000)
