"""The directive ``.. keys::``: a section for each mode of the editor, from its table of keys."""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from vtk_segdeform.widgets.editor.bindings import DEFAULT_KEYS

Row = tuple[str, str]


class Keys(SphinxDirective):
    """A table of keys for each mode."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        self.env.note_dependency("../widgets/editor/bindings.py")
        found = []
        for heading, rows in DEFAULT_KEYS.sections():
            section = nodes.section("", nodes.title("", heading), ids=[nodes.make_id(heading)])
            section += table(rows)
            found.append(section)
        return list(found)


def table(rows: list[Row]) -> nodes.table:
    """Return a table of keys and labels."""
    body = nodes.tbody()
    for keys, label in rows:
        caps = nodes.paragraph()
        for key in keys.split("  "):
            caps += [nodes.literal("", key, classes=["kbd", "key"]), nodes.Text(" ")]
        entries = (nodes.entry("", caps), nodes.entry("", nodes.paragraph("", label)))
        body += nodes.row("", *entries)
    widths = [nodes.colspec(colwidth=width) for width in (30, 70)]
    return nodes.table("", nodes.tgroup("", *widths, body, cols=2), classes=["keys"])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.add_directive("keys", Keys)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
