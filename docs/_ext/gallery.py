"""The robots of the gallery: pages that compute by themselves, made while the site is built."""

from __future__ import annotations

import shutil
from pathlib import Path

from click.testing import CliRunner
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from pinsing.cli.app import command

ROOT = Path(__file__).parents[2]
URDF = ROOT / "urdf"

# What follows `pinsing view` for each. Meshes where they are light; the others are drawn as lines.
ROBOTS = {
    "ur5": ["ur5", "--deg"],
    "panda": ["panda", "--deg", "--skeleton"],
    "iiwa14": ["iiwa14", "--deg"],
    "xarm7": ["xarm7", "--deg", "--skeleton"],
    "offset_wrist": [str(ROOT / "examples/offset_wrist.dh.yaml"), "--deg"],
    "puma560": ["puma560", "--deg"],
    "stanford": ["stanford", "--deg"],
    "surgical7": ["surgical7", "--deg"],
    "so101": ["so101", "--deg", "--skeleton"],
    "five_bar": [
        *(str(URDF / "five_bar.urdf"), "--loops", str(URDF / "five_bar.loops.yaml")),
        "--deg",
    ],
}
PLACE = "robots"

log = logging.getLogger(__name__)


class Robot(SphinxDirective):
    """The page of a robot, within the text and by itself."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Refer to the page that `make_pages` has made."""
        name = self.arguments[0]
        if name not in ROBOTS:
            raise self.error(f"there is no robot {name} in the gallery")
        up = "../" * self.env.docname.count("/")
        if self.env.app.builder.name == "dirhtml":
            up += "../"
        address = f"{up}{PLACE}/{name}.html"
        return [
            nodes.raw(
                "",
                f'<iframe class="robot" src="{address}" title="{name}" loading="lazy"></iframe>'
                f'<p class="robot"><a href="{address}">By itself, full size</a></p>',
                format="html",
            )
        ]


def make_pages(app: Sphinx) -> None:
    """Write the page of each robot beside the site, unless it is there and younger than pinsing."""
    if app.builder.format != "html":
        return
    folder = Path(app.outdir).parent / PLACE
    folder.mkdir(parents=True, exist_ok=True)
    newest = max(p.stat().st_mtime for p in (ROOT / "src").rglob("*") if p.is_file())
    for name, words in ROBOTS.items():
        page = folder / f"{name}.html"
        if page.exists() and page.stat().st_mtime > newest:
            continue
        done = CliRunner().invoke(command, ["view", *words, "-o", str(page)])
        if done.exit_code:
            raise ExtensionError(f"no page of {name}: {done.output}")
        log.info("made the page of %s", name)


def copy_pages(app: Sphinx, failure: Exception | None) -> None:
    """Put the pages into the site."""
    if failure is None and app.builder.format == "html":
        folder = Path(app.outdir).parent / PLACE
        shutil.copytree(folder, Path(app.outdir) / PLACE, dirs_exist_ok=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("robot", Robot)
    app.connect("builder-inited", make_pages)
    app.connect("build-finished", copy_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
