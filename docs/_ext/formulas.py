"""Formulas as MathML, which browsers typeset by themselves: no script, no font, no network."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

log = logging.getLogger(__name__)


def formula(self: Any, node: nodes.math | nodes.math_block) -> None:
    """Write a formula of the text, or one that has a line of its own."""
    block = isinstance(node, nodes.math_block)
    try:
        markup = tex2mathml(node.astext(), as_block=block)
    except MathError as error:
        log.warning("formula that cannot be set: %s", error, location=node)
        raise nodes.SkipNode from None
    self.body.append(f'<div class="formula">{markup}</div>' if block else markup)
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_html_math_renderer("mathml", (formula, None), (formula, None))
    app.config["html_math_renderer"] = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
