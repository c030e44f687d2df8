"""The whole file of a report: head, policy, contents, sections, data."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import html
import io
import json
import os
import platform
import re
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timezone
from importlib import metadata
from itertools import combinations
from math import degrees, isfinite
from typing import Any

import numpy as np

from pinsing._version import __version__
from pinsing.families import Branch, Family
from pinsing.notebook import mathml
from pinsing.prose import escaped as text
from pinsing.robot.arm import Arm

STYLE = """
:root { color-scheme: light dark; --ink: #1b2430; --soft: #4a5563; --line: #d5dae1;
  --ground: #f5f7f9; --link: #0b5394; --paper: #fff; --alarm: #b00020; --caution: #8a5a00;
  --good: #1b6e3c; --other: #4a5563; }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e6eaf0; --soft: #a9b3c0; --line: #3a434f; --ground: #1d232b; --link: #7db8f0;
    --paper: #14181d; --alarm: #c62840; --caution: #936208; --good: #217a45; }
  figure img { background: #fff; border-radius: .4rem; filter: brightness(.88); }
}
* { box-sizing: border-box; }
html { font: 16px/1.5 system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; color: var(--ink);
  background: var(--paper); -webkit-text-size-adjust: 100%; }
body { margin: 0 auto; max-width: 62rem; padding: 1.5rem 1.2rem 4rem; overflow-wrap: anywhere; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.35rem; margin: 2.6rem 0 .6rem; padding-bottom: .2rem;
  border-bottom: 2px solid var(--line); }
h3 { font-size: 1.1rem; margin: 1.6rem 0 .4rem; }
p { margin: .5rem 0; }
.sub { color: var(--soft); margin-top: 0; }
.lead { font-size: 1.08rem; }
a { color: var(--link); }
a:focus-visible, .wide:focus-visible, summary:focus-visible { outline: 3px solid #0b5394;
  outline-offset: 2px; }
.skip { position: absolute; left: -100rem; }
.skip:focus { left: 1rem; background: var(--paper); padding: .5rem; }
nav { background: var(--ground); border: 1px solid var(--line); border-radius: .4rem;
  padding: .6rem 1rem; margin: 1.2rem 0; }
nav ol { columns: 2; margin: .2rem 0; padding-left: 1.3rem; }
code { font: .95em ui-monospace, "DejaVu Sans Mono", Consolas, monospace; }
pre { background: var(--ground); border: 1px solid var(--line); border-radius: .3rem;
  padding: .5rem .7rem; margin: .5rem 0; white-space: pre-wrap; font-size: .9rem; }
.equation { background: var(--ground); border-left: 4px solid #7a8796; padding: .6rem .9rem;
  margin: .6rem 0; font-size: 1.15rem; }
.equation .math { display: block; overflow-x: auto; overflow-y: hidden; }
.equation .math math { margin: .1rem 0; }
.equation p { margin: .25rem 0; }
.wide { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; width: 100%; font-size: .95rem; }
caption { text-align: left; color: var(--soft); padding-bottom: .25rem; }
th, td { text-align: left; vertical-align: top; padding: .3rem .7rem .3rem 0;
  border-bottom: 1px solid var(--line); overflow-wrap: normal; }
thead th { color: var(--soft); font-weight: 600; }
tbody th { font-weight: 600; }
.n { text-align: right; font-variant-numeric: tabular-nums; }
.badge { border-radius: .3rem; padding: .05rem .45rem; color: #fff; background: var(--other);
  box-decoration-break: clone; -webkit-box-decoration-break: clone; }
td > .badge { display: inline-block; }
.badge.alarm { background: var(--alarm); }
.badge.caution { background: var(--caution); }
.badge.good { background: var(--good); }
figure { margin: 1rem 0; }
figure img { max-width: 100%; height: auto; display: block; }
.maps { display: flex; flex-wrap: wrap; gap: 0 1rem; align-items: flex-start; }
.maps figure { flex: 0 1 21rem; min-width: 0; }
.maps.slices { gap: 0; } .slices figure { flex: 0 0 auto; max-width: 100%; margin: .5rem 0 0; }
figcaption { color: var(--soft); font-size: .95rem; }
dl { margin: .6rem 0; }
dl > div { display: grid; grid-template-columns: 11rem 1fr; gap: .8rem; padding: .2rem 0;
  border-bottom: 1px solid var(--line); }
dt { color: var(--soft); }
dd { margin: 0; }
ul { padding-left: 1.3rem; }
li { margin: .2rem 0; }
iframe { width: 100%; height: 46rem; border: 1px solid var(--line); border-radius: .3rem; }
summary { cursor: pointer; font-weight: 600; padding: .4rem 0; }
footer { margin-top: 3rem; color: var(--soft); font-size: .9rem; }
@media screen and (max-width: 40rem) {
  nav ol { columns: 1; }
  dl > div { grid-template-columns: 1fr; gap: 0; }
  iframe { height: 90vh; }
  /* A row is a card: each cell with the head of its column. */
  thead { display: none; }
  table, caption, tbody { display: block; }
  tbody tr { display: flex; flex-wrap: wrap; gap: 0 1rem; padding: .4rem 0;
    border-bottom: 1px solid var(--line); }
  tbody th { flex: 0 0 100%; }
  tbody th, td { border: 0; padding: 0; text-align: left; overflow-wrap: anywhere; }
  td::before { content: attr(data-head) " "; color: var(--soft); }
}
@page { size: A4; margin: 16mm 15mm 18mm; }
@media print {
  html { font-size: 10.5pt; line-height: 1.4; }
  body { max-width: none; padding: 0; }
  nav, .screen, .skip, #model, #data { display: none; }
  h2, h3, caption { break-after: avoid; }
  #trajectory { break-before: page; }
  figure, .equation, tr, p, dl, li, .wide.short { break-inside: avoid; }
  .lead, p:has(+ pre), p:has(+ ul), .maps:has(+ .sub) { break-after: avoid; }
  h2 { margin-top: 1.2rem; }
  h3 { margin-top: 1rem; }
  dl { margin: .4rem 0; }
  dl > div, th, td { padding-top: .12rem; padding-bottom: .12rem; }
  .wide, .equation .math { overflow: visible; }
  .badge { color: #000; background: none; border: 1px solid #000; }
  .badge.alarm, .badge.caution, .badge.good { background: none; }
  figure { margin: .5rem 0; }
  .maps { display: block; break-inside: avoid; }
  .maps figure { display: inline-block; width: 49%; vertical-align: top; }
  .slices figure { width: auto; }
  /* Its one line is not a page of its own. */
  footer { margin-top: 1rem; break-before: avoid; }
  a { color: inherit; }
}
"""


SCHEMA = "pinsing/report/1"
_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def counted(number: int, one: str, many: str) -> str:
    """``one family``, ``three families``, ``12 families``."""
    said = _COUNTS[number] if number < len(_COUNTS) else str(number)
    return f"{said} {one if number == 1 else many}"


def name(words: str) -> str:
    """A name out of a file."""
    return f"<code>{text(words)}</code>"


def math(latex: str) -> str:
    """LaTeX of our own making, as MathML."""
    return f'<span class="math">{mathml(latex)}</span>'


def badge(words: str, tone: str = "") -> str:
    """A verdict; its colour repeats what the word says."""
    return f'<strong class="badge {tone}">{text(words)}</strong>'


def paragraph(*parts: str, kind: str = "") -> str:
    """Parts that are HTML already."""
    return f"<p{_class(kind)}>{' '.join(part for part in parts if part)}</p>"


def bullets(items: Iterable[str]) -> str:
    """Items that are HTML already; nothing where there are none."""
    rows = "".join(f"<li>{item}</li>" for item in items)
    return f"<ul>{rows}</ul>" if rows else ""


def terms(pairs: Iterable[tuple[str, str]], kind: str = "") -> str:
    """Names and what they mean, HTML already."""
    rows = "".join(f"<div><dt>{head}</dt><dd>{body}</dd></div>" for head, body in pairs)
    return f"<dl{_class(kind)}>{rows}</dl>"


def table(
    caption: str, header: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = ()
) -> str:
    """A table: plain words on top, cells that are HTML already; the first of each row heads it."""

    def cells(row: Sequence[str]) -> str:
        out = [f'<th scope="row"{_class("n" if 0 in numbers else "")}>{row[0]}</th>']
        out += [
            f'<td data-head="{text(header[k])}"{_class("n" if k in numbers else "")}>{c}</td>'
            for k, c in enumerate(row[1:], 1)
        ]
        return "".join(out)

    head = "".join(
        f'<th scope="col"{_class("n" if k in numbers else "")}>{text(h)}</th>'
        for k, h in enumerate(header)
    )
    lines = [f"<tr>{cells(row)}</tr>" for row in rows]
    body = "".join(lines)
    # A wide table scrolls by itself, also by keyboard; a short one stays on one page of paper.
    # So many rows, of some lines each, have room on a page of paper.
    kind = "wide short" if len(lines) <= 12 else "wide"
    return (
        f'<div class="{kind}" role="region" tabindex="0" aria-label="{text(caption)}"><table>'
        f"<caption>{text(caption)}</caption><thead><tr>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table></div>"
    )


def figure(png: bytes, alt: str, caption: str) -> str:
    """A picture at its own size; ``alt`` is plain words, ``caption`` HTML."""
    data = base64.b64encode(png).decode("ascii")
    # The head of a PNG file has its width; letters have their points on paper then.
    width = round(int.from_bytes(png[16:20], "big") * 96 / _DPI)
    return (
        f'<figure><img width="{width}" alt="{text(alt)}" src="data:image/png;base64,{data}">'
        + f"<figcaption>{caption}</figcaption>" * bool(caption)
        + "</figure>"
    )


def section(key: str, title: str, *parts: str) -> tuple[str, str, str]:
    """Key, plain title and HTML of a section."""
    body = "\n".join(part for part in parts if part)
    return key, title, f'<section id="{key}"><h2>{text(title)}</h2>\n{body}\n</section>'


def download(words: str, file: str, data: str) -> str:
    """A link that saves text as a file, without any network."""
    packed = base64.b64encode(data.encode()).decode("ascii")
    return (
        f'<a download="{text(file)}" href="data:application/json;base64,{packed}">{text(words)}</a>'
    )


def data_block(key: str, data: Any) -> str:
    """JSON that programs find in the page; nothing in it ends the element."""
    written = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        written = written.replace(sign, f"\\u{ord(sign):04x}")
    return f'<script type="application/json" id="{key}">{written}</script>'


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


Section = tuple[str, str, str]
"""Key, plain title, HTML."""

DATA = "pinsing-report"
"""The element that holds a report's JSON."""

_INLINE = re.compile(r"<script>(.*?)</script>", re.DOTALL)


def document(
    about: str,
    subtitle: str,
    sections: Sequence[Section | None],
    glossary: Section,
    content: Mapping[str, Any],
    *,
    started: float,
    engine: str,
    page: str | None,
    beside: str | None,
    more: Sequence[tuple[str, str]] = (),
) -> str:
    """Return a report as one file, with JSON for programs.

    The interactive ``page`` stands inside it if any, else in the file ``beside``. ``started`` is a
    value of ``time.monotonic``; ``more`` is said, in plain words, of how it was computed.
    """
    # The policy names the scripts of the page, if any, one by one.
    made = _made(started)
    computed = [
        ("made", made["made"]),
        ("computing took", f"{made['seconds']:.2g} s"),
        *more,
        (
            "with",
            ", ".join(f"{library} {version}" for library, version in made["versions"].items()),
        ),
        ("engine", engine),
        ("on", f"{sys.platform}, {platform.machine()}"),
    ]
    facts = terms([(text(head), text(said)) for head, said in computed])
    last = (model(page, beside), section("computed", "How it was computed", facts), glossary, _DATA)
    (_, _, answer), *rest = [part for part in (*sections, *last) if part is not None]
    contents = "".join(f'<li><a href="#{key}">{text(name)}</a></li>' for key, name, _ in rest)
    body = "\n".join(part for _, _, part in rest)
    title = f"Singular configurations of {about}"
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{html.escape(_policy(page))}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="pinsing">
<link rel="icon" href="data:,">
<title>{text(title)}</title>
<style>{STYLE}</style>
</head>
<body>
<a class="skip" href="#summary">To the summary</a>
<header>
<h1>{text(title)}</h1>
<p class="sub">{text(f"{subtitle}; {made['made']}")}</p>
</header>
<main>
{answer}
<nav aria-label="Contents"><ol>{contents}</ol></nav>
{body}
</main>
<footer><p>{text(f"Made by pinsing {__version__}.")}</p></footer>
{data_block(DATA, {"schema": SCHEMA, **made, **content})}
</body>
</html>
"""


def _made(started: float) -> dict[str, Any]:
    """When and by what: the time, the seconds since ``started``, and versions of libraries."""
    versions = {"pinsing": __version__, "Python": platform.python_version()}
    for library in ("numpy", "pin", "python-flint", "matplotlib", "meshcat"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[library] = metadata.version(library)
    # SOURCE_DATE_EPOCH, of reproducible builds, says another time.
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    stamp = int(given) if given.isdecimal() else time.time()
    now = datetime.fromtimestamp(stamp, timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
    return {"made": now, "seconds": time.monotonic() - started, "versions": versions}


def _policy(page: str | None) -> str:
    """Nothing from anywhere; of scripts only those of the page inside, by their hashes."""
    parts = ["default-src 'none'", "base-uri 'none'", "form-action 'none'"]
    if page is None:
        return "; ".join([*parts, f"style-src {_hash(STYLE)}", "img-src data:"])
    scripts = " ".join(dict.fromkeys(_hash(code) for code in _INLINE.findall(page)))
    return "; ".join(
        [
            *parts,
            f"script-src {scripts}",
            "style-src 'unsafe-inline'",  # meshcat sets styles as it runs
            "img-src data: blob:",
            "connect-src data: blob:",
            "worker-src blob:",
        ]
    )


def _hash(code: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(code.encode()).digest()).decode('ascii')}'"


def model(page: str | None, beside: str | None) -> Section | None:
    """The page with the robot in it: inside, beside, or not at all."""
    if page is not None:
        words = (
            "The robot in three dimensions, with sliders for its joints, the families to visit, "
            "and the distance to the nearest one while it moves. It runs in this file alone."
        )
        frame = (
            '<details class="screen"><summary>Open the interactive model here</summary>'
            '<iframe loading="lazy" title="Interactive model of the robot" '
            f'srcdoc="{html.escape(page)}"></iframe></details>'
        )
        return section("model", "Interactive model", paragraph(text(words)), frame)
    if beside is not None:
        link = f'<a href="{text(beside)}">{text(beside)}</a>'
        words = "The robot in three dimensions, with sliders for its joints, is in the file beside:"
        return section("model", "Interactive model", paragraph(text(words), link))
    return None


_DATA = section(
    "data",
    "For programs",
    paragraph(
        text("Everything here, with more digits, is in this file as JSON, in the element"),
        name(f'script id="{DATA}"'),
        text("(schema"),
        name(SCHEMA) + text("; radians and metres)."),
    ),
)


def limit_text(limit: float, slides: bool) -> str:
    """A joint limit with its unit."""
    if not isfinite(limit):
        return "none"
    return f"{limit:.6g} m" if slides else f"{degrees(limit) + 0.0:.6g}°"


_DPI = 150
_LETTERS = 9.0  # points at least
_WIDE, _TALL = 7.0, 5.0  # inches at most: the width of a page, and half of its height


def png(figure: Any, only: Sequence[Any] = ()) -> bytes:
    """A figure, or some axes of it, as PNG of few colours, a third as large; it is closed."""
    from matplotlib import pyplot as plt
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox
    from PIL import Image

    wide, tall = figure.get_size_inches()
    figure.set_size_inches(*(min(1.0, _WIDE / wide, _TALL / tall) * np.array([wide, tall])))
    for letters in figure.findobj(Text):
        letters.set_fontsize(max(letters.get_fontsize(), _LETTERS))
    drawn = io.BytesIO()
    part: Any = "tight"
    if only:
        figure.draw_without_rendering()
        part = Bbox.union([ax.get_tightbbox() for ax in only])
        part = part.transformed(figure.dpi_scale_trans.inverted()).padded(0.03)
    figure.savefig(drawn, format="png", dpi=_DPI, bbox_inches=part, pad_inches=0.05)
    plt.close(figure)
    image = Image.open(drawn).convert("RGB")
    out = io.BytesIO()
    reduced = image.quantize(128, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    reduced.save(out, format="png", optimize=True)
    return out.getvalue()


def quiet_backend() -> None:
    """Draw without a screen, unless somebody has chosen how to draw already."""
    import matplotlib as mpl

    if "matplotlib.pyplot" not in sys.modules:
        mpl.use("agg")


def map_planes(arm: Arm, families: Sequence[Family]) -> list[tuple[int, int]]:
    """Return up to two pairs of joints (indices) over which maps show the most."""

    def counts(pair: tuple[int, int]) -> tuple[int, int]:
        """How many families show, and how many of them as curves that need both joints."""
        shown = [[b for b in f.branches if _shows(b, pair)] for f in families]
        both = [any(set(pair) <= set(e.involved) for b in x for e in b.equations) for x in shown]
        return sum(map(bool, shown)), sum(both)

    found = {pair: counts(pair) for pair in combinations(range(arm.n), 2)}
    first = max(found, key=lambda pair: found[pair], default=None)
    if first is None or not found[first][0]:
        return []
    second = max(found, key=lambda pair: found[pair][::-1])
    return [first, second] if found[second][1] > found[first][1] else [first]


def _shows(branch: Branch, pair: tuple[int, int]) -> bool:
    """Return True if a branch meets the plane of two joints, whatever the others are."""
    values = {v.joint for v in branch.values}
    return (
        values <= set(pair)
        and all(set(e.involved) & set(pair) for e in branch.equations)
        and len(branch.equations) + len(values) <= 2
    )


def pose_pictures(arm: Arm, state: Any) -> list[bytes]:
    """The arm at a configuration with what is lost, once with each of its velocity ellipsoids."""
    from pinsing.plot.ellipsoids import KINDS, ellipsoids

    out = []
    for kind in KINDS:
        ax = ellipsoids(state, kind=kind, arm=arm)
        ax.get_legend().remove()  # its words stand beside
        ax.figure.suptitle("")
        ax.figure.set_size_inches(3.4, 2.4)
        ax.locator_params(nbins=4)
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.labelpad = 2
        out.append(png(ax.figure))
    return out


def workspace_pictures(arm: Arm) -> list[bytes]:
    """Three slices of the workspace, by how well the tool moves there."""
    from matplotlib import pyplot as plt

    from pinsing.plot.plane import workspace

    drawn = plt.figure(figsize=(7.0, 2.7), layout="constrained")
    axes = drawn.subplots(1, 3)
    workspace(arm, axes)
    drawn.suptitle("")  # the caption says it
    for ax in axes:
        ax.locator_params(nbins=4)
    bar = drawn.axes[3]
    return [png(drawn, (axes[0],)), png(drawn, (axes[1],)), png(drawn, (axes[2], bar))]


def map_picture(arm: Arm, families: Sequence[Family], pair: tuple[int, int]) -> tuple[bytes, str]:
    """sigma_min over two joints, in degrees, with the loci; and the values of the others."""
    from pinsing.plot.plane import sigma_plane

    a, b = (arm.joints[j] for j in pair)
    axes = sigma_plane(arm, a, b, families=families, degrees=True, samples=121)
    held = re.sub(r"[${}_\\]", "", axes.get_title()).partition(", ")[2]  # without the name
    axes.set_title("")
    return png(axes.figure), held
