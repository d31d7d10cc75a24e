"""A colour bar at the right of a view and lines of text at its upper left.

Sizes follow the window.  Text is dark or white, whichever contrasts more with its background, and a
line may have the colour of a region as its background.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import vtkmodules.vtkRenderingFreeType  # noqa: F401 - required to draw text
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import vtkTextActor

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import ink_on, of_region, rgb

from ..scene import Stop, View, set_font
from .diverging import lookup_table

_TICKS = 5
_LONGEST_NAME = 25  # characters
_LATIN, _SIGNS = 0x17F, "–—‘’‚“”„†‡•…‰‹›€™"  # the characters of VTK's built-in font
_BACKGROUND_OPACITY = 0.7  # of text that may lie over the mesh


class Legend:
    """A colour bar and lines of text; hidden until `show`."""

    def __init__(self, view: View, title: str) -> None:
        self.view = view
        self._bar = _scalar_bar(title)
        self._lines: list[Any] = []
        self._stop: Stop | None = None

    def show(self, half_range: float | None, lines: Sequence[tuple[str, int | None]]) -> None:
        """Show or replace the colour bar and the lines.

        Parameters
        ----------
        half_range : float or None
            The value at the ends of the scale, see `diverging`; None for no colour bar.
        lines : sequence of (text, region)
            From the top; *region* is the number of the region whose colour is the background, or
            None.
        """
        renderer = self.view.renderer
        if self._stop is None:
            self._stop = self.view.before_render(self._lay_out)
            renderer.AddViewProp(self._bar)
        self._bar.SetVisibility(half_range is not None)
        table = self._bar.GetLookupTable()
        if half_range is not None and (table is None or table.GetTableRange()[1] != half_range):
            self._bar.SetLookupTable(_annotated_table(half_range))
        while len(self._lines) > len(lines):
            renderer.RemoveViewProp(self._lines.pop())
        while len(self._lines) < len(lines):
            self._lines.append(vtkTextActor())
            renderer.AddViewProp(self._lines[-1])
        for actor, (text, region) in zip(self._lines, lines, strict=True):
            actor.SetInput(f" {text} ".replace("$", r"\$"))  # VTK reads text between two $ as TeX
            style = actor.GetTextProperty()
            set_font(style)
            style.SetBackgroundOpacity(_BACKGROUND_OPACITY if region is None else 1.0)
            style.SetFrame(region is not None)
            if region is not None:
                style.SetBackgroundColor(*(of_region(region) / 255.0))
                style.SetFrameColor(*style.GetBackgroundColor())

    def hide(self) -> None:
        """Hide the colour bar and the lines."""
        if self._stop is not None:
            self._stop()
            self._stop = None
        for prop in (self._bar, *self._lines):
            self.view.renderer.RemoveViewProp(prop)
        self._lines = []

    def _lay_out(self) -> None:
        renderer = self.view.renderer
        width, height = renderer.GetSize()
        background = renderer.GetBackground()
        size = int(np.clip(height / 42, 11, 30))  # pixels; font sizes are pixels at 72 dpi
        points = max(6, round(size * 72 / (renderer.GetRenderWindow().GetDPI() or 72)))
        for k, actor in enumerate(self._lines):
            style = actor.GetTextProperty()
            style.SetFontSize(points)
            style.SetFrameWidth(size // 6)
            if not style.GetFrame():
                style.SetBackgroundColor(*background)
            style.SetColor(*_ink_on(style.GetBackgroundColor()))
            actor.SetPosition(0.6 * size, height - 1.7 * size * (k + 1.2))
        wide = min(max(0.12, 7.0 * size / width), 0.5)
        self._bar.SetPosition(0.99 - wide, 0.25)
        self._bar.SetWidth(wide)
        for style in (self._bar.GetTitleTextProperty(), self._bar.GetAnnotationTextProperty()):
            style.SetFontSize(points)
            style.SetBackgroundColor(*background)
            style.SetBackgroundOpacity(_BACKGROUND_OPACITY)
            style.SetColor(*_ink_on(background))


def signed(number: float, digits: int) -> str:
    """Format a number with its sign; zero has no sign.

    >>> signed(2.5, 1), signed(-10.0, 1), signed(-0.01, 1)
    ('+2.5', '-10', '0')
    """
    rounded = round(number, digits)
    return f"{rounded:+.{digits}f}".removesuffix(".0") if rounded else "0"


def brief(name: str, default: str) -> str:
    """Shorten a name for display; return *default* if VTK's font lacks a character of it.

    >>> brief("the lower half of the left arm", "region 1"), brief("左腕", "region 2")
    ('the lower half of the ...', 'region 2')
    """
    if any(ord(letter) > _LATIN and letter not in _SIGNS for letter in name):
        return default
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 3].rstrip()} ..."


def percent(share: float) -> str:
    """Format a share in per cent, with more digits if it is small; below 0.0001 % it is zero.

    >>> percent(0.025), percent(-0.0004), percent(2e-16)
    ('+2.5 %', '-0.04 %', '0 %')
    """
    if abs(share) >= 1e-3:
        return f"{signed(100.0 * share, 1)} %"
    return f"{signed(100.0 * share, 4).rstrip('0') or '0'} %"


def in_tenths(share: float) -> str:
    """Format a share in per cent for a column: always with one decimal, unless it is zero.

    >>> in_tenths(0.04), in_tenths(-0.0258), in_tenths(2e-4)
    ('+4.0 %', '-2.6 %', '0 %')
    """
    rounded = round(100.0 * share, 1)
    return f"{rounded:+.1f} %" if rounded else "0 %"


def _scalar_bar(title: str) -> Any:
    bar = vtkScalarBarActor()
    bar.SetTitle(title)
    bar.SetPosition(0.86, 0.25)
    bar.SetWidth(0.12)
    bar.SetHeight(0.5)
    bar.UnconstrainedFontSizeOn()
    bar.SetMaximumNumberOfColors(255)
    bar.SetVerticalTitleSeparation(8)
    # Ticks are annotations: no number format of VTK writes "+20 %", "0" and "-20 %".
    bar.DrawTickLabelsOff()
    bar.DrawAnnotationsOn()
    for style in (bar.GetTitleTextProperty(), bar.GetAnnotationTextProperty()):
        style.ItalicOff()
        set_font(style)
        style.ShadowOff()
    return bar


def _annotated_table(half_range: float) -> Any:
    table = lookup_table(half_range)
    for share in np.linspace(-half_range, half_range, _TICKS):
        tick = signed(100.0 * float(share), 1 if half_range >= 0.01 else 3)
        table.SetAnnotation(float(share), tick if tick == "0" else f"{tick} %")
    return table


def _ink_on(colour: Any) -> FloatArray:
    """Return dark or white, whichever contrasts more with *colour* (3,), 0 to 1."""
    return np.asarray(rgb(ink_on(255.0 * np.array(colour))) / 255.0)
