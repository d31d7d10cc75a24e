"""A renderer in front of another one: it looks the same way, and nothing hides what is in it."""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.vtkRenderingCore import vtkRenderer

_SMALLEST = 8  # pixels, below which text would be a texture of nothing, of which VTK complains


class Front:
    """A layer over *renderer*, in its window, until `remove`.

    Parameters
    ----------
    renderer : vtkRenderer
        What it lies over and whose camera it follows; in a window.

    Attributes
    ----------
    renderer : vtkRenderer
        The one in front.
    """

    def __init__(self, renderer: Any) -> None:
        self._behind = renderer
        self.renderer = vtkRenderer()
        self.renderer.InteractiveOff()
        self.renderer.SetViewport(*renderer.GetViewport())
        window = renderer.GetRenderWindow()
        layer = 1 + max(r.GetLayer() for r in _renderers(window) if _overlap(r, renderer))
        window.SetNumberOfLayers(max(window.GetNumberOfLayers(), layer + 1))
        self.renderer.SetLayer(layer)
        window.AddRenderer(self.renderer)

    def follow(self) -> None:
        """Look where the renderer behind does, both so that they see all of both."""
        front, behind = self.renderer, self._behind
        front.SetViewport(*behind.GetViewport())
        front.SetDraw(min(behind.GetSize()) >= _SMALLEST)
        both = [r.ComputeVisiblePropBounds() for r in (behind, front)]
        bounds = np.array([b for b in both if b[0] <= b[1]])
        if len(bounds):
            low, high = bounds[:, ::2].min(axis=0), bounds[:, 1::2].max(axis=0)
            behind.ResetCameraClippingRange(*np.stack([low, high], axis=1).ravel())
        # A copy: whoever takes a screenshot swaps the cameras while it draws.
        front.GetActiveCamera().DeepCopy(behind.GetActiveCamera())

    def remove(self) -> None:
        """Go out of the window, with all that is in it; other layers stay where they are."""
        self.renderer.RemoveAllViewProps()
        window = self.renderer.GetRenderWindow()
        if window is not None:
            window.RemoveRenderer(self.renderer)
            window.SetNumberOfLayers(1 + max((r.GetLayer() for r in _renderers(window)), default=0))


def _renderers(window: Any) -> list[Any]:
    renderers = window.GetRenderers()
    return [renderers.GetItemAsObject(k) for k in range(renderers.GetNumberOfItems())]


def _overlap(one: Any, other: Any) -> bool:
    """Tell whether two renderers draw on the same part of the window."""
    a, b = np.array([one.GetViewport(), other.GetViewport()])
    return bool((np.maximum(a, b)[:2] < np.minimum(a, b)[2:]).all())
