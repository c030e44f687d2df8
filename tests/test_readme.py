"""The README's commands and code do what it shows."""

import re

import pytest
from pages import ROOT, Reader, blocks, commands, reader as reader

README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_readme_does_what_it_shows(reader: Reader):
    """In its order: later commands use files of earlier ones."""
    reader.read(README)


def test_its_session_leaves_nothing_out():
    shown = [text for b in blocks(README) if b.kind == "console" for *_, text in commands(b.text)]
    assert "3 families" in shown[2]
    assert not [text for text in shown if "..." in text]


@pytest.mark.parametrize("target", re.findall(r"\]\((?!https?:)([^)#]+)\)", README))
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists(), f"README links to {target}"
