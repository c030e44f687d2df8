"""Closed forms as LaTeX."""

from __future__ import annotations

from pinsing.closed_form import ClosedForm


def families_latex(found: ClosedForm) -> str:
    """Return an ``align*`` of the families, with the legend of their symbols as comments."""
    rows = [rf"  \text{{{f.name}:}} \quad & {f.latex}" for f in found.families]
    legend = [f"% {symbol} = {name}" for symbol, name in found.legend if symbol != name]
    return "\n".join([*legend, r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"])
