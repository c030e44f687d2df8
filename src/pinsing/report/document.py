"""The whole file of a report: head, policy, contents, sections, data."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from collections.abc import Sequence
from typing import Any

from pinsing.report.markup import data_block, text
from pinsing.report.style import STYLE

Section = tuple[str, str, str]
"""Key, plain title, HTML."""

DATA = "pinsing-report"
"""The element that holds a report's JSON."""

_INLINE = re.compile(r"<script>(.*?)</script>", re.DOTALL)


def document(
    title: str, subtitle: str, sections: Sequence[Section], data: Any, page: str | None, foot: str
) -> str:
    """A report as one file.

    Parameters
    ----------
    title, subtitle : str
        Plain words.
    sections : sequence of Section
        In order.
    data : anything that JSON has
        What programs read.
    page : str or None
        The interactive page that stands inside, whose scripts the policy then names one by one.
    foot : str
        Plain words at the end.
    """
    contents = "".join(f'<li><a href="#{key}">{text(name)}</a></li>' for key, name, _ in sections)
    body = "\n".join(part for _, _, part in sections)
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
<p class="sub">{text(subtitle)}</p>
</header>
<nav aria-label="Contents"><ol>{contents}</ol></nav>
<main>
{body}
</main>
<footer><p>{text(foot)}</p></footer>
{data_block(DATA, data)}
</body>
</html>
"""


def embedded(page: str) -> str:
    """The interactive page in a frame, loaded when it is opened."""
    return (
        '<details class="screen"><summary>Open the interactive model here</summary>'
        '<iframe loading="lazy" title="Interactive model of the robot" '
        f'srcdoc="{html.escape(page)}"></iframe></details>'
    )


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
    digest = hashlib.sha256(code.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
