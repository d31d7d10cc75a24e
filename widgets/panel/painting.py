"""The section with the painting tools and their settings."""

from __future__ import annotations

import math

from ..editor import TOOLS, Action, DeformEditor, Mode, actions
from ..region_selector import Paint, Tool
from .fields import Field, Section, key_button
from .regions import STIFFNESS

_REGIONS = "regions"


def painting_section(editor: DeformEditor) -> Section:
    """Return the painting tools and their settings."""
    selector, keys = editor.widgets.selector, editor.keys
    diagonal = editor.session.mesh.diagonal
    decimals = max(0, 4 - math.floor(math.log10(diagonal)))
    what = f"{selector.stiffness:g}" if selector.paints is Paint.STIFFNESS else _REGIONS
    choices = [("Regions", _REGIONS), *((f"Stiffness: {each.lower()}", s) for each, s in STIFFNESS)]
    if what not in {value for _, value in choices}:  # set by a script
        choices.append((f"Stiffness: {what}", what))
    tools = tuple(
        key_button(keys, f"paint.{action}", action, value=selector.tool is tool, group="tools")
        for tool, action in TOOLS.items()
    )
    return Section(
        "paint",
        "Paint with",
        (
            Field(
                "paint.what",
                "choice",
                "Paint",
                "Regions, or how stiff the surface is: orange is stiff, blue soft, black rigid",
                "paint_stiffness",
                value=what,
                choices=tuple(choices),
                visible=editor.mode is Mode.REGIONS,
                act=_painting,
            ),
            tools[:3],
            tools[3:],
            Field(
                "paint.radius",
                "number",
                "Brush radius",
                "Brush radius along the surface, in mesh units ([ ] or Shift+wheel)",
                value=selector.radius,
                enabled=selector.tool is Tool.BRUSH,
                minimum=round(1e-4 * diagonal, decimals),
                maximum=round(2.0 * diagonal, decimals),
                step=0.01 * diagonal,
                decimals=decimals,
                act=lambda radius: actions.assigning(actions.selector_of, "radius", radius),
            ),
            Field(
                "paint.through",
                "toggle",
                "Select through (X-ray)",
                "Paint hidden vertices as well",
                "select_through",
                value=selector.through,
                act=lambda on: actions.assigning(actions.selector_of, "through", on),
            ),
            (
                key_button(keys, "paint.grow", "grow", "Grow"),
                key_button(keys, "paint.shrink", "shrink", "Shrink"),
                key_button(keys, "paint.all", "select_all", "All"),
                key_button(
                    keys, "paint.invert", "invert", "Invert", visible=editor.mode is Mode.HANDLES
                ),
            ),
        ),
    )


def _painting(what: str) -> Action:
    if what == _REGIONS:
        return actions.painting(Paint.REGION)
    return actions.painting_stiffness(float(what))
