"""Texts and rectangles that a VTK renderer draws in two dimensions, as numbers for a page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkRenderingCore import vtkPolyDataMapper2D, vtkTextActor

_DOTS_PER_INCH = 72.0  # the resolution at which font size 12 is 12 pixels


def label_actors(view: Any) -> list[Any]:
    """Return the visible texts and rectangles of *view* and its foreground, the lowest first."""
    actors = [
        actor
        for renderer in (view.renderer, view.foreground)
        for actor in renderer.GetActors2D()
        if actor.GetVisibility()
    ]
    return sorted(actors, key=lambda actor: actor.GetLayerNumber())


def labels_of(actors: list[Any], view: Any) -> list[dict[str, Any]]:
    """Return *actors* of *view* as plain data, in pixels from its upper left corner.

    A rectangle has a left, a top, a width and a height; a text has a left, a middle and a size.
    """
    return [label for actor in actors for label in _label(actor, view)]


def _label(actor: Any, view: Any) -> Iterator[dict[str, Any]]:
    height = view.window.GetSize()[1]
    if isinstance(actor, vtkTextActor):
        style = actor.GetTextProperty()
        x, y = actor.GetPosition()
        dots = view.window.GetDPI() or _DOTS_PER_INCH
        yield {
            "text": str(actor.GetInput() or "").replace(r"\$", "$"),
            "place": [x, height - y],
            "size": style.GetFontSize() * dots / _DOTS_PER_INCH,
            "colour": _css(style.GetColor(), style.GetOpacity()),
        }
        return
    mapper = actor.GetMapper()
    if isinstance(mapper, vtkPolyDataMapper2D) and mapper.GetInput().GetNumberOfPolys():
        corners = vtk_to_numpy(mapper.GetInput().GetPoints().GetData())[:, :2]
        (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
        style = actor.GetProperty()
        yield {
            "box": [float(each) for each in (left, height - top, right - left, top - bottom)],
            "colour": _css(style.GetColor(), style.GetOpacity()),
        }


def _css(colour: tuple[float, float, float], opacity: float) -> str:
    red, green, blue = np.rint(255.0 * np.array(colour)).astype(int).tolist()
    return f"rgb({red} {green} {blue} / {opacity:g})"
