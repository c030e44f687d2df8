"""Every link within the built site leads somewhere, and nothing is fetched from elsewhere."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# What a browser fetches by itself when it shows a page.
FETCHED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "video": "src"}
STYLE = re.compile(r"@import\s+[\"']?(?:url\()?[\"']?([^\"')\s;]+)|url\(\s*[\"']?([^\"')\s]+)")
OWN = "robots"
"""Pages that pinsing itself writes; tests/view/test_view_browser.py looks at what they fetch."""


class Page(HTMLParser):
    """Anchors of a page, where it leads, and what it fetches."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take in one tag."""
        values = {name: value or "" for name, value in attrs}
        self.anchors |= {values[k] for k in ("id", "name") if k in values}
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if tag == "link" and values.get("rel") != "canonical":
            self.fetched.append(values.get("href", ""))
        if values.get(FETCHED.get(tag, "")):
            self.fetched.append(values[FETCHED[tag]])


def problems(folder: Path) -> Iterator[str]:
    """Say what is wrong with a site, a line each."""
    pages = {
        path.resolve(): Page(path.read_text(encoding="utf-8"))
        for path in sorted(folder.rglob("*.html"))
        if OWN not in path.relative_to(folder).parts
    }
    for path, page in pages.items():
        shown = path.relative_to(folder.resolve())
        for link in page.fetched:
            if urlsplit(link).scheme not in ("", "data") or link.startswith("//"):
                yield f"{shown} fetches {link}"
        for link in (*page.links, *page.fetched):
            parts = urlsplit(link)
            if parts.scheme or link.startswith("//"):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                yield f"{shown} links to {link}: there is no such file"
            elif (
                parts.fragment
                and target in pages
                and unquote(parts.fragment) not in pages[target].anchors
            ):
                yield f"{shown} links to {link}: there is no such place in it"
    for path in sorted(folder.rglob("*.css")):
        for match in STYLE.finditer(path.read_text(encoding="utf-8")):
            link = match[1] or match[2]
            parts = urlsplit(link)
            if parts.scheme not in ("", "data") or link.startswith("//"):
                yield f"{path.relative_to(folder)} fetches {link}"


def main(words: list[str]) -> int:
    """Check one site; the exit code is 1 if something is wrong."""
    folder = Path(words[0])
    found = list(problems(folder))
    if not (folder / "index.html").exists():
        found.append(f"{folder} holds no index.html")
    print("\n".join(found) or "links: all lead somewhere, nothing is fetched from elsewhere")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
