"""Headers of modules on the pages of the API: what is indented in them is set as it stands.

In the code they need no markup; here an indented block is a diagram or a piece of code.
"""

from __future__ import annotations

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


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx."""
    app.connect("autodoc-process-docstring", mark_blocks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
