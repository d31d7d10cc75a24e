"""The documentation site. `make docs` builds it, and any warning fails the build.

The modules in `making/` draw the pictures and write the table of keys during each build, and
Sphinx-Gallery runs `examples/`, so that none of them goes stale.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE)]

from making.made import older  # noqa: E402 - found by the line above

from vtk_segdeform.version import __version__  # noqa: E402

# Draw without a window, in the examples and in the processes that draw pictures.
os.environ.update(PYVISTA_OFF_SCREEN="true", MPLBACKEND="Agg")
if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"

project = "vtk_segdeform"
author = "the vtk_segdeform authors"
copyright = author  # noqa: A001 - Sphinx's name
version = release = __version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "making.equations",
    "making.keys",
    "myst_parser",  # for CHANGELOG.md
    "making.headers",
    "making.made",
]
exclude_patterns = ["build"]

# Every example runs again if the package is newer than its page.
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": ".*",
    "ignore_pattern": "qt_application",  # needs a screen; embedding/qt shows it
    "image_scrapers": ("making.gallery.pictures",),
    "reset_argv": "making.gallery.arguments",
    "reset_modules": (),
    "run_stale_examples": older(HERE / "gallery" / "bend_the_cactus.py.md5", []),
    "within_subsection_order": "FileNameSortKey",
    "backreferences_dir": "gallery/backreferences",
    "doc_module": ("vtk_segdeform",),
    "capture_repr": (),
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
}

# Every reference must resolve. Names in single backticks link to their page; private names, which
# have no page, are set as code (`making.headers`).
nitpicky = True
default_role = "py:obj"

# The API pages. They are built without Qt.
autodoc_mock_imports = [
    "pyvistaqt",
    "qtpy",
    "vtk_segdeform.widgets.qt.controls",
    "vtk_segdeform.widgets.qt.panel",
]
autodoc_typehints = "none"  # the docstrings give types, with shapes
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
