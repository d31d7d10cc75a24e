"""The editor's keys, from the table by which it works.

``.. keys::`` is replaced by a section for each mode, as on the editor's own card.
"""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from vtk_segdeform.widgets.editor.bindings import help_sections

Row = tuple[str, str]


class Keys(SphinxDirective):
    """A table of keys for each mode."""

    def run(self) -> list[nodes.Node]:
        """Return the tables under their headings."""
        self.env.note_dependency("../widgets/editor/bindings.py")
        found = []
        for heading, rows in help_sections():
            section = nodes.section("", nodes.title("", heading), ids=[nodes.make_id(heading)])
            section += table(rows)
            found.append(section)
        return list(found)


def table(rows: list[Row]) -> nodes.table:
    """Return rows of keys and what they do."""
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
    """Tell Sphinx."""
    app.add_directive("keys", Keys)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
