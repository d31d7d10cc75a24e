"""Docstrings on the API pages.

Indented blocks in the docstring of a module, diagrams or code, become code blocks.  `names` in
docstrings become links if they are documented, and code otherwise.
"""

from __future__ import annotations

import ast
import re
import textwrap
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx


def mark_blocks(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Turn each indented block of a module's docstring into a code block, in place."""
    del app, name, obj, options
    if what != "module":
        return
    text = "\n".join(lines)
    for block in re.findall(r"(?m)(?:^    .*\n|^\n(?=    ))+", text + "\n"):
        marker = f"\n.. code-block:: {language_of(block)}\n\n"
        text = text.replace(block.rstrip("\n"), marker + block.strip("\n") + "\n")
    lines[:] = [*text.splitlines(), ""]


def language_of(block: str) -> str:
    """Return the language of an indented block."""
    try:
        ast.parse(textwrap.dedent(block))
    except SyntaxError:
        return "text"
    return "python"


def set_as_code(app: Sphinx, env: object, node: Any, content: nodes.Node) -> nodes.Node | None:
    """Return a name without a page unchanged."""
    del app, env
    return content if node.get("reftype") == "obj" else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.connect("autodoc-process-docstring", mark_blocks, priority=400)  # before numpydoc
    app.connect("missing-reference", set_as_code)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
