"""The report: one file, whole, readable without us, and safe whatever a robot is called."""

import base64
import functools
import json
import re
from html import unescape
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import URDF, textbook
from command_line import run
from tiers import tiered_rows

import pinsing
from pinsing.errors import ConfigurationError, OptionError, OutputError
from pinsing.proof.checker import verify
from pinsing.proximity.trajectory import summary
from pinsing.report import document
from pinsing.report.arm_report import arm_report, write_report

_VOID = {"meta", "link", "img", "br", "input", "hr"}


class Outline(HTMLParser):
    """What stands in a page: elements in order, headings, links, pictures; wrong nesting fails."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.headings: list[tuple[int, str]] = []
        self.words: list[str] = []
        self.feed(html)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if re.fullmatch("h[1-6]", tag):
            self.headings.append((int(tag[1]), ""))
        if tag not in _VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in _VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and re.fullmatch("h[1-6]", self.open[-1]):
            level, words = self.headings[-1]
            self.headings[-1] = (level, words + data)
        if "script" not in self.open and "style" not in self.open:
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attrs for name, attrs in self.elements if name == tag]


@functools.cache
def planar() -> str:
    """A small arm's report without the interactive model; its workspace is not drawn."""
    drawn = document.png
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(document, "png", lambda x, only=(): bytes(24) if only else drawn(x))
        return planar_again()


def planar_again() -> str:
    arm = textbook("planar3r", task="position")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "0")
        return arm_report(arm, pinsing.closed_form(arm, prove=True), {}, False, None, True)[0]


def inside(html: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="pinsing-report">(.*?)</script>', html)
    assert found
    return dict(json.loads(found[1]))


def test_it_says_what_somebody_needs_who_was_not_there() -> None:
    page = Outline(planar())
    titles = [words for level, words in page.headings if level == 2]
    assert titles == [
        "Summary", "Map of two joints", "The families", "Special configurations",
        "How sure this is", "The robot", "What was assumed", "How it was computed",
        "What the words mean", "For programs",
    ]  # fmt: skip
    form = pinsing.closed_form(textbook("planar3r", task="position"))
    for family in form.families:
        assert f"Family {family.name}" in [words for _, words in page.headings]
        assert family.reason[1:] in page.text
    assert "three joints between base_link and tool0" in page.text
    for words in ("proven", pinsing.__version__, "Pinocchio"):
        assert words in page.text


def test_it_is_accessible() -> None:
    page = Outline(planar())
    assert page.all("html") == [{"lang": "en"}]
    levels = [level for level, _ in page.headings]
    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in pairwise(levels))
    pictures = page.all("img")
    assert len(pictures) >= 2
    assert all(len(p["alt"] or "") > 40 for p in pictures)
    assert len(page.all("caption")) == len(page.all("table"))
    assert all(cell.get("scope") for cell in page.all("th"))
    ids = [a["id"] for _, a in page.elements if "id" in a]
    assert len(ids) == len(set(ids))
    local = [(a["href"] or "")[1:] for a in page.all("a") if (a["href"] or "").startswith("#")]
    assert set(local) <= set(ids)


def test_nothing_comes_from_elsewhere_and_no_script_runs() -> None:
    page = Outline(planar())
    for _, attrs in page.elements:
        for key in ("src", "href", "data", "action", "poster"):
            value = attrs.get(key)
            assert value is None or value.startswith(("#", "data:")), value
        assert "style" not in attrs
        assert not any(key.startswith("on") for key in attrs)
    assert [s.get("type") for s in page.all("script")] == ["application/json"]
    policy = next(m["content"] for m in page.all("meta") if "http-equiv" in m)
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy


def test_the_certificate_in_it_is_accepted() -> None:
    html = planar()
    link = next(a for a in Outline(html).all("a") if "download" in a)
    data = base64.b64decode((link["href"] or "").split(",", 1)[1]).decode()
    assert verify(data) is not None
    assert inside(html)["certificate"] == json.loads(data)


def test_the_data_in_it_are_results() -> None:
    data = inside(planar())
    form = pinsing.ClosedForm.from_dict(data["families"])
    assert [f.text for f in form.families] == ["q2 = 0° or 180°"] or form.families
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
    page = Outline(html)
    assert f"{np.degrees(near):.3g}°" in page.text
    q = typed(arm, r"The zero pose is singular.*?--deg --q ([-0-9.,e]+\d)", page.text)
    assert pinsing.at(arm, q).status == "regular"


HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(2)>'


@pytest.mark.usefixtures("undrawn")
def test_hostile_names_are_shown_not_obeyed(tmp_path: Path) -> None:
    text = (URDF / "planar3r.urdf").read_text()
    escaped = HOSTILE.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    text = text.replace('name="q2"', f'name="{escaped}"')
    text = text.replace('<robot name="planar3r"', f'<robot name="{escaped}"')
    file = tmp_path / "odd.urdf"
    file.write_text(text)
    arm = pinsing.load(file, task="position")
    assert HOSTILE in arm.joints
    write_report(arm, tmp_path / "odd.html", page="none")
    html = (tmp_path / "odd.html").read_text()
    assert "<script>alert" not in html
    assert "<img src=x" not in html
    page = Outline(html)
    assert HOSTILE in page.text
    assert [s.get("type") for s in page.all("script")] == ["application/json"]
    assert HOSTILE in inside(html)["robot"]["arm"]["joints"]


@pytest.mark.usefixtures("undrawn")
def test_an_arm_without_singularities(tmp_path: Path) -> None:
    file = tmp_path / "a.html"
    write_report(pinsing.load("planar3r", task="wz"), file, page="none")
    assert "has no singular configuration" in Outline(file.read_text()).text


@pytest.mark.slow
def test_a_trajectory_is_judged_and_pictures_have_their_size(tmp_path: Path) -> None:
    arm, way = textbook("planar3r", task="position"), [[0, -0.5, 0.2], [0, 0.5, -0.3]]
    page = tmp_path / "arm.html"
    write_report(arm, page, trajectory=way, page="none")
    outline = Outline(page.read_text())
    check = pinsing.check_trajectory(arm, way)
    assert (2, "The trajectory") in outline.headings
    verdict = summary(check, file="path", robot="ROBOT").splitlines()[0]
    met = outline.text.partition("Summary")[2].partition(" has three joints")[0]
    assert " ".join(verdict.split()) in met
    assert "Slow down, or keep away from F1" in met
    pictures = outline.all("img")
    assert len(pictures) == len({one["src"] for one in pictures}) > 3  # none twice
    # On paper 180 mm wide letters keep their nine points.
    assert all(100 < int(one["width"] or 0) <= 7.1 * 96 for one in pictures)


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_one_without_a_complete_answer_says_so() -> None:
    arm = textbook("surgical7")
    form = pinsing.closed_form(arm, seconds=1e-3)
    assert not form.complete
    words = Outline(arm_report(arm, form, {}, False, None, True)[0]).text
    assert "NOT complete" in words.split("Map of two joints")[0]  # on page one
    assert form.gaps[0].split("(")[0][:40] in words


@pytest.mark.slow
def test_a_mechanism(tmp_path: Path) -> None:
    file = tmp_path / "five.html"
    mechanism = pinsing.load_mechanism("five_bar")
    write_report(mechanism, file, page="none", poses={"far": [0.0, 0.0], "asked": [0.9, 2.2]})
    html = file.read_text()
    page = Outline(html)
    found = pinsing.loops.analyze_mechanism(mechanism)
    for locus in found.forms.loci:
        assert locus.words in page.text
    assert {"type 1", "type 2"} <= {p["kind"] for p in inside(html)["mechanism"]["points"]}
    # The modes, the map over the inputs, the workspace, and each locus.
    assert len(page.all("img")) == 3 + len(found.forms.loci)
    assert all(len(p["alt"] or "") > 40 for p in page.all("img"))
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
    page = Outline(html)
    assert "10°, 20°, 30°" in page.text
    (frame,) = page.all("iframe")
    assert (frame["srcdoc"] or "").startswith("<!DOCTYPE html>")
    assert frame["title"]


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
    one, other = (re.sub(times, "", planar_again()) for _ in range(2))
    assert one == other
    assert "1970-01-01 00:00 UTC" in one


@pytest.mark.slow
def test_it_opens_in_a_browser_and_so_does_the_model_inside(page: Any, tmp_path: Path) -> None:
    file = tmp_path / "r.html"
    write_report(textbook("planar3r", task="position"), file, skeleton=True)
    page.goto(file.as_uri())
    assert page.evaluate("document.querySelectorAll('math').length") > 3
    assert page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth > 300)")
    for width in (400, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        wide = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert page.evaluate(wide) <= 0
    page.click("summary")
    page.frame_locator("iframe").locator("body[data-ready=yes]").wait_for(timeout=90_000)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5", "panda", "surgical7", "so101", "hc10"])
def test_reports_of_real_arms(name: str, tmp_path: Path, page: Any) -> None:
    arm = pinsing.load(name)
    write_report(arm, tmp_path / "r.html", skeleton=True, pdf=tmp_path / "r.pdf")
    assert (tmp_path / "r.html").stat().st_size < 3_000_000
    paper = (tmp_path / "r.pdf").read_bytes()
    assert paper.startswith(b"%PDF")
    outline = Outline((tmp_path / "r.html").read_text())
    form = pinsing.closed_form(arm)
    families = [w for _, w in outline.headings if w.startswith("Family F")]
    assert len(families) == len(form.families)
    most = {"ur5": 7, "panda": 8, "hc10": 5}.get(name, 12)  # pages, none of them half-empty
    assert len(re.findall(rb"/Type */Page\b", paper)) <= most
    page.goto((tmp_path / "r.html").as_uri())
    page.set_viewport_size({"width": 390, "height": 800})
    wide = "[...document.querySelectorAll('html, .wide, figure')].filter(WIDE).length"
    assert page.evaluate(wide.replace("WIDE", "(x) => x.scrollWidth > x.clientWidth")) == 0
