"""Configuration of Sphinx: `make docs` builds the pages into out/docs/."""

import sys
from pathlib import Path

import pdmp

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "PDMP"
author = "the PDMP authors"
version = release = pdmp.__version__
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "docstrings",
    "examples",
    "mathml",
    "snippets",
]
exclude_patterns = ["_ext", "_generated", "paper/*.md"]
html_theme = "furo"
html_math_renderer = "mathml"
html_title = f"PDMP {release}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_show_sphinx = False
html_copy_source = False
html_show_copyright = False

myst_enable_extensions = ["attrs_inline", "deflist", "dollarmath"]
myst_heading_anchors = 3
autodoc_member_order = "groupwise"  # compiled classes have no order of source
autodoc_typehints = "none"  # the docstrings have types and shapes
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
copybutton_exclude = ".linenos, .gp, .go"

nitpicky = True
