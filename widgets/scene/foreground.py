"""A renderer in a layer above another one, with the same camera: its actors are never hidden."""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.vtkRenderingCore import vtkRenderer

_SMALLEST_WINDOW = 8  # pixels; in a smaller window VTK warns about empty text textures


class Foreground:
    """A layer above a renderer, until `remove`.

    Attributes
    ----------
    renderer : vtkRenderer
        The renderer of the layer.
    """

    def __init__(self, renderer: Any) -> None:
        self._behind = renderer
        self.renderer = vtkRenderer()
        self.renderer.InteractiveOff()
        self.renderer.SetViewport(*renderer.GetViewport())
        layer_above(renderer, self.renderer)

    def follow(self) -> None:
        """Copy camera and viewport, with a clipping range that covers the actors of both."""
        front, behind = self.renderer, self._behind
        front.SetViewport(*behind.GetViewport())
        front.SetDraw(min(behind.GetSize()) >= _SMALLEST_WINDOW)
        visible = [r.ComputeVisiblePropBounds() for r in (behind, front)]
        bounds = np.array([b for b in visible if b[0] <= b[1]])
        if len(bounds):
            low, high = bounds[:, ::2].min(axis=0), bounds[:, 1::2].max(axis=0)
            behind.ResetCameraClippingRange(*np.stack([low, high], axis=1).ravel())
        # A copy: pyvista swaps the cameras during a screenshot.
        front.GetActiveCamera().DeepCopy(behind.GetActiveCamera())

    def remove(self) -> None:
        """Remove the layer and its actors from the window; other layers keep their numbers."""
        self.renderer.RemoveAllViewProps()
        window = self.renderer.GetRenderWindow()
        if window is not None:
            window.RemoveRenderer(self.renderer)
            window.SetNumberOfLayers(1 + max((r.GetLayer() for r in _renderers(window)), default=0))


def layer_above(renderer: Any, added: Any) -> None:
    """Add the renderer *added* to the window of *renderer*, in a layer above all at its place."""
    window = renderer.GetRenderWindow()
    layer = 1 + max(r.GetLayer() for r in _renderers(window) if _overlap(r, renderer))
    window.SetNumberOfLayers(max(window.GetNumberOfLayers(), layer + 1))
    added.SetLayer(layer)
    window.AddRenderer(added)


def _renderers(window: Any) -> list[Any]:
    renderers = window.GetRenderers()
    return [renderers.GetItemAsObject(k) for k in range(renderers.GetNumberOfItems())]


def _overlap(one: Any, other: Any) -> bool:
    """Return whether the viewports of two renderers overlap."""
    a, b = np.array([one.GetViewport(), other.GetViewport()])
    return bool((np.maximum(a, b)[:2] < np.minimum(a, b)[2:]).all())
