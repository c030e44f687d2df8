"""The site: Sphinx over the pages of this folder. `scripts/docs` builds it."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import pinsing

project = "pinsing"
author = "The pinsing developers"
copyright = "2026, the pinsing developers"
release = version = pinsing.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "formulas",
    "command_line",
    "json_schemas",
    "gallery",
    "house",
    "api_links",
]
exclude_patterns = ["_ext", "_static"]
nitpicky = False
suppress_warnings = ["config.cache"]

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist", "attrs_block"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
smartquotes = False  # --option stays what one types

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # types stand in the docstrings, with shapes and units
autodoc_class_signature = "mixed"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
add_module_names = False
python_use_unqualified_type_names = True

html_theme = "furo"  # its fonts are those of the reader's system: nothing is fetched
html_title = "pinsing"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_show_sphinx = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True}
pygments_style = "default"
