"""Regions, fixed vertices and handles as colours of the mesh.

Regions have the colours of the palette, in equal shares where they overlap, so that a stroke is
seen as far as it went; blend weights fade towards its border.  On top lie fixed vertices, grey,
and handles, red; and on top of all the preview of a stroke.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import BoolArray
from vtk_segdeform.pictures import BODY, FIXED, HANDLE, of_region, rgb
from vtk_segdeform.session import Change

from ..scene import SurfaceDisplay

LAYER = "regions"
_STRONG = 0.9  # of a preview's colour; the rest is what lies under it


class RegionColours:
    """A layer of colours over a surface; shown from the start.

    Parameters
    ----------
    surface : SurfaceDisplay
        The mesh, n vertices.
    """

    def __init__(self, surface: SurfaceDisplay) -> None:
        self._surface = surface
        self._session = surface.session
        self._shown = True
        self._preview: tuple[BoolArray, NDArray[np.uint8]] | None = None
        self._base = self._mixed()
        self._stop = self._session.on_change(self._changed)
        self._draw()

    @property
    def is_shown(self) -> bool:
        """Whether the mesh has these colours, unless a newer layer covers them."""
        return self._shown

    def show(self) -> None:
        """Colour the mesh."""
        self._shown = True
        self._draw()

    def hide(self) -> None:
        """Leave the mesh as it is."""
        self._shown = False
        self._draw()

    def preview(self, vertices: BoolArray | None, colour: NDArray[np.uint8] | None = None) -> None:
        """Show some *vertices*, a mask (n,), in a *colour* (3,) of 0 to 255; None ends it."""
        if vertices is None and self._preview is None:
            return
        if vertices is None or colour is None:
            self._preview = None
        else:
            self._preview = vertices, colour
        self._draw()

    def remove(self) -> None:
        """Take the colours off the surface, for good."""
        self._stop()
        self._surface.set_colours(LAYER, None)

    def _changed(self, change: Change) -> None:
        if change & (Change.REGIONS | Change.CONSTRAINTS):
            self._base = self._mixed()
            self._draw()

    def _mixed(self) -> NDArray[np.float64]:
        session = self._session
        if session.regions is None:
            colours = np.tile(rgb(BODY).astype(float), (session.mesh.n_vertices, 1))
        else:
            palette = [of_region(r) for r in range(session.regions.n_regions)]
            belongs = session.regions.membership
            colours = (belongs / belongs.sum(axis=0)).T @ np.array(palette, dtype=float)
        colours[session.fixed] = rgb(FIXED)
        for vertices in session.handles.values():
            colours[vertices] = rgb(HANDLE)
        return colours

    def _draw(self) -> None:
        if not self._shown:
            self._surface.set_colours(LAYER, None)
            return
        colours = self._base
        if self._preview is not None:
            vertices, colour = self._preview
            colours = colours.copy()
            colours[vertices] += _STRONG * (colour - colours[vertices])
        self._surface.set_colours(LAYER, np.rint(colours).astype(np.uint8))
