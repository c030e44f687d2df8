"""The last sections of every report: how it was computed, the interactive page, the data."""

from __future__ import annotations

from typing import Any

from pinsing.report.content import Made
from pinsing.report.document import embedded
from pinsing.report.markup import name, paragraph, section, terms, text

Section = tuple[str, str, str]


def computed(made: Made, engine: str, more: list[tuple[str, str]]) -> Section:
    """Versions, time, machine; ``more`` are plain words."""
    versions = ", ".join(f"{library} {version}" for library, version in made.versions.items())
    pairs = [
        ("made", made.when),
        ("computing took", f"{made.seconds:.2g} s"),
        *more,
        ("with", versions),
        ("engine", engine),
        ("on", made.machine),
    ]
    return section("computed", "How it was computed", terms([(text(a), text(b)) for a, b in pairs]))


def model(page: str | None, beside: str | None) -> Section | None:
    """The page with the robot in it: inside, beside, or not at all."""
    if page is not None:
        words = (
            "The robot in three dimensions, with sliders for its joints, the families to visit, "
            "and the distance to the nearest one while it moves. It runs in this file alone."
        )
        printed = (
            '<p class="paper">' + text("It is in the file that this was printed from.") + "</p>"
        )
        return section(
            "model", "Interactive model", paragraph(text(words)), printed, embedded(page)
        )
    if beside is not None:
        link = f'<a href="{text(beside)}">{text(beside)}</a>'
        words = "The robot in three dimensions, with sliders for its joints, is in the file beside:"
        return section("model", "Interactive model", paragraph(text(words), link))
    return None


def data(schema: str) -> Section:
    """Where programs find the same."""
    from pinsing.report.document import DATA

    return section(
        "data",
        "For programs",
        paragraph(
            text("Everything here, with more digits, is in this file as JSON, in the element"),
            name(f'script id="{DATA}"'),
            text("(schema"),
            name(schema) + text("; radians and metres)."),
        ),
    )


def result(value: Any) -> dict[str, Any]:
    """A result as plain data."""
    return dict(value.to_dict())
