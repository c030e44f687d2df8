"""Types in docstrings lead to public names only: the n of a shape ``(n,)`` leads nowhere."""

from __future__ import annotations

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

import pinsing

# Where each public name is documented.
PLACES = {
    name: f"{module.__name__}.{name}"
    for module in (
        *(pinsing.sampling, pinsing.loops, pinsing.families, pinsing.robot, pinsing.proximity),
        *(pinsing.postures, pinsing.kinematics, pinsing),
    )
    for name in module.__all__
}


def unlink(app: Sphinx, doctree: nodes.document) -> None:
    """Replace what looks like a reference and is a shape or a word by its text."""
    for node in list(doctree.findall(addnodes.pending_xref)):
        if node.get("refdomain") == "py" and not node.get("refexplicit"):
            parts = str(node.get("reftarget", "")).split(".")
            if PLACES.keys().isdisjoint(parts):
                node.replace_self(plain(node))
            elif len(parts) == 1:
                node["reftarget"] = PLACES[parts[0]]


def plain(node: addnodes.pending_xref) -> list[nodes.Node]:
    """What stands there where there is no link."""
    either = [c for c in node.children if isinstance(c, addnodes.pending_xref_condition)]
    chosen = [c for c in either if c.get("condition") == "*"]
    return [child for part in chosen for child in part.children] if either else list(node.children)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("doctree-read", unlink)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
