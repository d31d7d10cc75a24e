"""CHANGELOG.md as part of a page, so that it is written once.

``.. changelog::`` understands what is in it: headings, lists, paragraphs, `code`, *stress* and
[links](address).
"""

from __future__ import annotations

import re
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

CHANGELOG = Path(__file__).resolve().parents[2] / "CHANGELOG.md"
_INLINE = re.compile(
    r"`(?P<code>[^`]+)`|\[(?P<text>[^]]+)\]\((?P<link>[^)]+)\)|\*(?P<stress>[^*]+)\*"
)


class Changelog(SphinxDirective):
    """The whole of it, below its title."""

    def run(self) -> list[nodes.Node]:
        """Return its sections."""
        self.env.note_dependency(str(CHANGELOG))
        top = nodes.section()
        open_sections: list[nodes.Element] = [top]
        for block in re.split(r"\n\s*\n", CHANGELOG.read_text(encoding="utf-8").strip())[1:]:
            if heading := re.fullmatch(r"(##+) (.+)", block):
                depth = len(heading[1]) - 1
                title = heading[2].strip("[]")
                section = nodes.section("", nodes.title("", title), ids=[nodes.make_id(block)])
                del open_sections[depth:]
                open_sections[-1] += section
                open_sections.append(section)
            elif block.startswith("- "):
                items = re.split(r"(?m)^- ", block)[1:]
                open_sections[-1] += nodes.bullet_list(
                    "", *(nodes.list_item("", paragraph(item)) for item in items)
                )
            else:
                open_sections[-1] += paragraph(block)
        return list(top.children)


def paragraph(text: str) -> nodes.paragraph:
    """Return some lines of Markdown as a paragraph."""
    text, made, end = " ".join(text.split()), nodes.paragraph(), 0
    for found in _INLINE.finditer(text):
        made += nodes.Text(text[end : found.start()])
        end = found.end()
        if found["code"]:
            made += nodes.literal("", found["code"])
        elif found["stress"]:
            made += nodes.emphasis("", found["stress"])
        else:
            made += nodes.reference("", found["text"], refuri=found["link"])
    made += nodes.Text(text[end:])
    return made


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_directive("changelog", Changelog)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
