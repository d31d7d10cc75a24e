r"""Formulas as MathML, which browsers render themselves, with the paper's equation numbers.

    .. equation:: 13

       h = -H^{-1} (d + G^T \lambda)

is displayed with "(13)" beside it. An empty line starts another formula of the same number, and the
argument may be omitted.  ``:ref:`eq-13``` links to it from any page.  The pages need no script and
no network.
"""

from __future__ import annotations

import html
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective


class Equation(SphinxDirective):
    """A displayed formula. The optional argument is its number."""

    has_content = True
    optional_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Return a container with the formula and its number."""
        formulas = "\n".join(self.content).split("\n\n")
        blocks = [nodes.math_block(f, f, number=None, label=None) for f in formulas]
        frame = nodes.container("", nodes.container("", *blocks), classes=["equation"])
        if self.arguments:
            number = self.arguments[0]
            frame["ids"].append(f"eq-{number}")
            frame += nodes.inline("", f"({number})", classes=["number"])
            labels = self.env.domains.standard_domain.labels
            labels[f"eq-{number}"] = self.env.docname, f"eq-{number}", f"({number})"
        return [frame]


def as_mathml(latex: str, display: str) -> str:
    """Return a formula as MathML, with the LaTeX source as its alternative text."""
    made = convert(latex, display=display)
    if "\\" in made:
        raise ExtensionError(
            f"the formula {latex} has a command that latex2mathml does not support"
        )
    return made.replace("<math ", f'<math alttext="{html.escape(latex)}" ', 1)


def visit_inline(writer: Any, node: nodes.math) -> None:
    """Write an inline formula."""
    writer.body.append(as_mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def visit_block(writer: Any, node: nodes.math_block) -> None:
    """Write a displayed formula."""
    writer.body.append(as_mathml(node.astext(), "block"))
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.add_directive("equation", Equation)
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
