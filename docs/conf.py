"""The documentation site: `make docs` builds it, any warning ends the build.

Pages are written; these things are made when the site is built, by what lies in `making/`, so
that they cannot go stale: the pictures, the gallery of `examples/`, the table of keys.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE)]

from vtk_segdeform.version import __version__  # noqa: E402 - only now can it be found

project = "vtk_segdeform"
author = "the vtk_segdeform authors"
copyright = author  # noqa: A001 - Sphinx's word
version = release = __version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "making.equations",
    "making.keys",
    "making.changelog",
    "making.headers",
    "making.made",
]
exclude_patterns = ["build"]

# Whatever a page refers to must be there.  Names in single backticks, as docstrings have them,
# lead to what is public, and are set as code where they name inner things (`making.headers`).
nitpicky = True
default_role = "py:obj"

# What the pages of the API show, and how.  Qt need not be there to be written about.
autodoc_mock_imports = ["pyvistaqt", "qtpy", "vtk_segdeform.widgets.panel"]
autodoc_typehints = "none"  # the docstrings tell types, with shapes
autodoc_member_order = "bysource"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
add_module_names = False
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = "vtk_segdeform"
html_static_path = ["style"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_show_sourcelink = False
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#0B4F82",
        "color-brand-content": "#0B5A94",
        "color-api-name": "#0B4F82",
        "color-api-pre-name": "#5a6673",
    },
    "dark_css_variables": {
        "color-brand-primary": "#7FBFEA",
        "color-brand-content": "#7FBFEA",
        "color-api-name": "#9CD0F2",
        "color-api-pre-name": "#9aa6b2",
    },
}
pygments_style = "friendly"
pygments_dark_style = "github-dark"
