"""Docstrings as they are on the pages of the API.

What is indented in the header of a module, a diagram or a piece of code, is set as it stands.
`names` in docstrings become links where there is a page for them, and code elsewhere.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx


def mark_blocks(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Put a "::" before each indented block of a module's docstring, in place."""
    del app, name, obj, options
    if what != "module":
        return
    marked: list[str] = []
    for line in lines:
        begins = line.startswith("    ") and (not marked or not marked[-1].strip())
        after_text = not any(before.startswith("    ") for before in marked[-2:])
        if begins and after_text:
            marked += ["::", ""]
        marked.append(line)
    lines[:] = marked


def set_as_code(app: Sphinx, env: object, node: Any, content: nodes.Node) -> nodes.Node | None:
    """Return a name that has no page as it is."""
    del app, env
    return content if node.get("reftype") == "obj" else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx."""
    app.connect("autodoc-process-docstring", mark_blocks)
    app.connect("missing-reference", set_as_code)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
