"""Pages out of parts: the live one in several files, the static one in a single file."""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import json
import re
from functools import cache
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

ENGINE = (
    "limits",
    "linear",
    "chain",
    "measures",
    "sums",
    "families",
    "boxes",
    "distance",
    "lost",
    "arm",
    "paths",
    "clearance",
    "led",
    "trajectory",
    "locus",
    "loops",
    "mechanism",
    "pose_drive",
    "singular_points",
    "surroundings",
    "mechanism_frame",
    "mechanism_paths",
)
"""Modules of the engine, each after those that it imports."""

SCRIPTS = (
    "labels.js",
    "pace.js",
    "scene.js",
    "panel.js",
    "locus.js",
    "source.js",
    "player.js",
    "drag.js",
    "postures.js",
    "take.js",
    "main.js",
    "mechanism_panel.js",
    "mechanism.js",
    "start.js",
)

_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./(\w+)\.mjs";', re.MULTILINE)
_EXPORT = re.compile(r"^export (const|function\*?|class) (\w+)", re.MULTILINE)

# Nothing is ever fetched from elsewhere; meshcat adds styles, and textures as data.
LIVE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self' data: blob:; worker-src blob:; "
    "base-uri 'none'; form-action 'none'"
)
_STATIC_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src data: blob:; worker-src blob:; base-uri 'none'; "
    "form-action 'none'"
)


@cache
def asset(name: str) -> str:
    """Text of a file that belongs to the page."""
    return files("pinsing.view").joinpath("assets", name).read_text(encoding="utf-8")


@cache
def meshcat_script() -> str:
    """Meshcat's own viewer, three.js included, after the texts of their licences."""
    # Found, not imported: its Python side brings IPython, and a browser waits for this file.
    spec = importlib.util.find_spec("meshcat")
    assert spec is not None
    assert spec.origin is not None
    folder = Path(spec.origin).parent / "viewer" / "dist"
    code = (folder / "main.min.js").read_text(encoding="utf-8")
    return f"/*\n{asset('licences.txt')}*/\n{code}"


@cache
def engine_script() -> str:
    """Return the engine as one classic script that sets ``Engine``."""
    # A page from a file may not import modules: each becomes a function that returns its exports.
    folder = files("pinsing.view").joinpath("engine")
    parts, names = [], []
    for name in ENGINE:
        code = folder.joinpath(f"{name}.mjs").read_text(encoding="utf-8")
        code = _IMPORT.sub(lambda m: f"const {{{m[1]}}} = engine_{m[2]};", code)
        exported = _EXPORT.findall(code)
        code = _EXPORT.sub(lambda m: f"{m[1]} {m[2]}", code)
        given = ", ".join(what for _, what in exported)
        parts.append(f"const engine_{name} = (() => {{\n{code}\nreturn {{ {given} }};\n}})();")
        names.append(f"...engine_{name}")
    # As a function, so that a worker beside the page can have its own.
    inside = "\n".join([*parts, f"return {{ {', '.join(names)} }};"])
    return f"function engineOf() {{\n{inside}\n}}\nconst Engine = engineOf();"


def script() -> str:
    """Our part of the page's program."""
    return "\n".join([engine_script(), *(asset(name) for name in SCRIPTS)])


def live_html(title: str) -> str:
    """The page that fetches its parts from the server."""
    return Template(asset("page.html")).substitute(
        title=html.escape(title),
        head=_policy(LIVE_POLICY) + '\n<link rel="icon" href="data:,">',
        style='<link rel="stylesheet" href="page.css">',
        data="",
        scripts='<script src="begin.js"></script>',
        links="",
    )


def static_html(title: str, page: dict[str, Any], scene: bytes, links: bytes) -> str:
    """Return the page that opens from a file, meshes last: the skeleton shows before them."""
    text = json.dumps(page, separators=(",", ":"), allow_nan=False)
    baked = [_baked("page", text.encode()), _baked("scene", scene)]
    scripts = [f"<script>\n{code}\n</script>" for code in (meshcat_script(), script())]
    return Template(asset("page.html")).substitute(
        title=html.escape(title),
        head=_policy(_STATIC_POLICY) + '\n<link rel="icon" href="data:,">',
        style=f"<style>\n{asset('page.css')}\n</style>",
        data="\n".join(baked),
        scripts="\n".join(scripts),
        links=_baked("links", links),
    )


def _baked(name: str, data: bytes) -> str:
    # mtime=0: the same arm gives the same bytes. Level 9 takes ten times as long, for 5 percent.
    packed = base64.b64encode(gzip.compress(data, 4, mtime=0)).decode("ascii")
    return f'<script id="baked-{name}" type="application/octet-stream">{packed}</script>'


def _policy(policy: str) -> str:
    return f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
