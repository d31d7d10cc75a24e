r"""Formulas as MathML, which browsers set themselves; displayed ones with the paper's numbers.

    .. equation:: 13
       :name: step

       h = -H^{-1} (d + G^T \lambda)

is shown with "(13)" beside it, and ``:ref:`eq-13``` leads there from any page.  A number may be
any short word; without one, none is shown.  Nothing is loaded from elsewhere and no script runs.
"""

from __future__ import annotations

import html
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Equation(SphinxDirective):
    """A displayed formula; its number, if any, is the argument."""

    has_content = True
    optional_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Return the formula, in a frame with its number."""
        latex = " ".join(self.content)
        number = self.arguments[0] if self.arguments else ""
        block = nodes.math_block(latex, latex, number=None, label=None)
        frame = nodes.container("", block, classes=["equation"])
        if number:
            first = number.partition("–")[0].split(",")[0]
            name = f"eq-{nodes.make_id(first) if not first.isdigit() else first}"
            frame["ids"].append(name)
            frame += nodes.inline("", f"({number})", classes=["number"])
            standard = self.env.get_domain("std")
            standard.labels[name] = self.env.docname, name, f"({number})"  # type: ignore[attr-defined]
        return [frame]


def as_mathml(latex: str, display: str) -> str:
    """Return a formula as MathML; whoever reads its source finds the LaTeX beside it."""
    made = convert(latex, display=display)
    return made.replace("<math ", f'<math alttext="{html.escape(latex)}" ', 1)


def visit_inline(writer: Any, node: nodes.math) -> None:
    """Write a formula in the line."""
    writer.body.append(as_mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def visit_block(writer: Any, node: nodes.math_block) -> None:
    """Write a formula on a line of its own."""
    writer.body.append(as_mathml(node.astext(), "block"))
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx."""
    app.add_directive("equation", Equation)
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
