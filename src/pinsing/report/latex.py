"""Closed forms as LaTeX."""

from __future__ import annotations

from pinsing.families import ClosedForm


def families_latex(found: ClosedForm) -> str:
    """Return an ``align*`` of the families, with the legend of their symbols as comments."""
    rows = [rf"  \text{{{f.name}:}} \quad & {f.latex}" for f in found.families]
    # A line break in a name would end the comment, and what follows would be run.
    legend = [f"% {symbol} = {_one_line(name)}" for symbol, name in found.legend if symbol != name]
    return "\n".join([*legend, r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"])


def _one_line(name: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in name)
