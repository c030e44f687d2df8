"""No text of a figure lies over another: every kind of plot, drawn by the command."""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from arms import URDF
from command_line import run
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import Axes3D
from tiers import tiered_rows

import pinsing
from pinsing.loops.solve import trace


def written(figure: Figure) -> list[tuple[str, Bbox]]:
    """What a figure says, box by box, pixels: a legend is one box."""
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    boxes: list[tuple[str, Any]] = []
    for part in [*figure.findobj(SubFigure), figure]:
        boxes += [(t.get_text(), t) for t in part.texts]
        boxes += [("legend", each) for each in part.legends]
        if part._suptitle is not None:
            boxes.append((part._suptitle.get_text(), part._suptitle))
    boxes = list({id(each): (name, each) for name, each in boxes}.values())
    for ax in figure.axes:
        if not ax.get_visible():
            continue
        three = isinstance(ax, Axes3D)  # its labels and texts stand within the picture
        own = [ax.title, ax._left_title, ax._right_title]
        own += [] if three else [ax.xaxis.label, ax.yaxis.label]
        own += [] if three else [t for t in ax.texts if not inside(t, ax)]
        boxes += [(t.get_text(), t) for t in own if t.get_visible()]
        if ax.get_legend() is not None:
            boxes.append(("legend", ax.get_legend()))
        if not three and ax.axison:
            for axis in (a for a in (ax.xaxis, ax.yaxis) if a.get_visible()):
                labels = [t for t in axis.get_ticklabels() if t.get_visible() and t.get_text()]
                low, high = sorted(axis.get_view_interval())
                places = axis.get_ticklocs()
                boxes += [
                    (f"tick {t.get_text()}", t)
                    for t, at in zip(labels, places, strict=False)
                    if low <= at <= high
                ]
    found = [(name, each.get_window_extent(renderer)) for name, each in boxes]
    return [(name, box) for name, box in found if name and box.width > 1 and box.height > 1]


def inside(text: Any, ax: Axes) -> bool:
    """Whether a text is a mark within the data, which may lie where data lie."""
    return bool(ax.get_window_extent().contains(*text.get_window_extent().get_points().mean(0)))


def overlaps(figure: Figure) -> list[str]:
    """Pairs of texts of which one covers more than two pixels of the other each way."""
    said = []
    for (one, a), (other, b) in combinations(written(figure), 2):
        both = Bbox.intersection(a, b)
        if both is not None and both.width > 2 and both.height > 2:
            said.append(f"{one!r} over {other!r}")
    return said


def test_overlaps_are_seen() -> None:
    figure, ax = plt.subplots()
    ax.plot([0, 1], label="a")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1))
    ax.text(0.5, -0.15, "a caption", transform=ax.transAxes, ha="center")
    assert "'a caption' over 'legend'" in overlaps(figure)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Figure]:
    """The figure that a command writes."""

    def draw(*words: str) -> Figure:
        kept: list[Figure] = []
        monkeypatch.setattr("pinsing.cli.show.save_figure", lambda f, *a, **k: kept.append(f))
        done = run("plot", *words, "-o", str(tmp_path / "a.png"))
        if done.exit_code == 2:
            pytest.skip(done.output.strip().splitlines()[-1])
        assert done.exit_code == 0, done.output
        return kept[0]

    return draw


def words_of(kind: str, arm: pinsing.Arm) -> list[str]:
    """What a kind needs besides the robot."""
    over = ["--over", ",".join(arm.joints[1:3])]
    zero = ",".join("0" for _ in arm.joints)
    more = ",".join("0.4" for _ in arm.joints)
    return {
        "map": over,
        "aspects": over,
        "locus": ["--family", "F1"],
        "along": [f"--q={zero}", f"--q={more}"],
    }.get(kind, [])


SERIAL = ("planar3r", "scara", "stanford", "surgical7", "puma560", "irb1400", "iiwa14", "ur5",
          "panda", "xarm7", "kinova", "z1", "tiago", "so101", "talos_arm")  # fmt: skip
KINDS = ("curves", "map", "locus", "ellipsoids", "along", "workspace", "aspects", "solutions")
QUICK_PLOTS = [("surgical7", "curves"), ("scara", "map")]


@pytest.mark.parametrize(
    ("robot", "kind"), tiered_rows([(r, k) for r in SERIAL for k in KINDS], QUICK_PLOTS)
)
def test_no_text_lies_over_another(drawn: Callable[..., Figure], robot: str, kind: str) -> None:
    assert overlaps(drawn(kind, robot, *words_of(kind, pinsing.load(robot)))) == []


def test_angles_of_figures_are_in_degrees_unless_radians_are_asked_for(drawn, monkeypatch):
    for words, unit in (([], "deg"), (["--deg"], "deg"), (["--rad"], "rad")):
        for kind in ("map", "locus"):
            figure = drawn(kind, "planar3r", *words_of(kind, pinsing.load("planar3r")), *words)
            assert f"[{unit}]" in figure.axes[0].get_xlabel()
    monkeypatch.setattr("pinsing.loops.curves", lambda arm, _, k: (trace(arm, arm.home, k),))
    figure = drawn("curves", str(URDF / "four_bar.urdf"), "--loops")
    assert any("deg" in ax.get_xlabel() for ax in figure.axes)


MECHANISMS = sorted(p.name.split(".")[0] for p in URDF.glob("*.loops.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map", "curves", "ellipsoids", "modes"])
@pytest.mark.parametrize("name", MECHANISMS)
def test_no_text_of_a_mechanism_lies_over_another(drawn, name, kind):
    assert overlaps(drawn(kind, str(URDF / f"{name}.urdf"), "--loops")) == []
