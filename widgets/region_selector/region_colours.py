"""Regions, fixed vertices and handles as vertex colours of a body that is otherwise clay.

Regions have the colours of the palette.  Where regions overlap their colours are mixed in equal
parts, not by blend weight: weights fade towards the border of a region, which would hide how far a
stroke went.  Fixed vertices are dark grey, each handle has its own colour, and the preview of a
stroke covers everything.  Instead of regions, the stiffness can be shown: blue is softer than
usual, orange stiffer, black rigid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtk_segdeform.arrays import BoolArray, FloatArray
from vtk_segdeform.pictures import BODY, COLOURS, FIXED, INK, of_region, rgb
from vtk_segdeform.session import Change

from ..scene import SurfaceDisplay, handle_colour

LAYER = "regions"
_PREVIEW_OPACITY = 0.9
_SOFT, _STIFF = COLOURS[5], COLOURS[6]  # blue and vermilion: a tenth, and 10 times as stiff


class RegionColours:
    """A colour layer of a surface, visible at once."""

    def __init__(self, surface: SurfaceDisplay) -> None:
        self._surface = surface
        self._session = surface.session
        self._shown = True
        self._filled = True, True, frozenset[str](), True, False  # see `fill`
        self._preview: tuple[BoolArray, NDArray[np.uint8]] | None = None
        self._base = self._base_colours()
        self._stop = self._session.on_change(self._changed)
        self._draw()

    @property
    def is_shown(self) -> bool:
        """Whether the layer is shown; a newer layer may cover it."""
        return self._shown

    def show(self) -> None:
        """Show the layer."""
        self._shown = True
        self._draw()

    def hide(self) -> None:
        """Hide the layer."""
        self._shown = False
        self._draw()

    def fill(
        self,
        *,
        regions: bool,
        handles: bool,
        hidden: frozenset[str] = frozenset(),
        pulled: bool = True,
        stiffness: bool = False,
    ) -> None:
        """Choose whether regions, and handles except *hidden* ones, are coloured.

        Handles that pulls have made, such as a turned limb, only if *pulled*.  Fixed vertices
        always are, unless *stiffness* is shown instead of all.
        """
        filled = regions, handles, hidden, pulled, stiffness
        if filled != self._filled:
            self._filled = filled
            self._base = self._base_colours()
            self._draw()

    def preview(self, vertices: BoolArray | None, colour: NDArray[np.uint8] | None = None) -> None:
        """Show *vertices*, a mask (n,), in a *colour* (3,) of 0 to 255; None ends the preview.

        Or in one for each of them, (k, 3).
        """
        if vertices is None and self._preview is None:
            return
        if vertices is None or colour is None:
            self._preview = None
        else:
            self._preview = vertices, colour
        self._draw()

    def remove(self) -> None:
        """Remove the layer from the surface permanently."""
        self._stop()
        self._surface.set_colours(LAYER, None)

    def _changed(self, change: Change) -> None:
        if change & (Change.REGIONS | Change.CONSTRAINTS):
            base = self._base_colours()
            if not np.array_equal(base, self._base):
                self._base = base
                self._draw()

    def _base_colours(self) -> NDArray[np.uint8]:
        """Return the (n, 3) colours without the preview."""
        session, regions = self._session, self._session.regions
        fills_regions, marks_handles, hidden, marks_pulled, shows_stiffness = self._filled
        if shows_stiffness:
            stiffness = session.state.stiffness
            given = np.ones(session.mesh.n_vertices) if stiffness is None else stiffness
            return stiffness_colours(given)
        if regions is None or not fills_regions:
            colours = np.tile(rgb(BODY).astype(np.uint8), (session.mesh.n_vertices, 1))
        else:
            palette = [of_region(r) for r in range(regions.n_regions)]
            belongs = regions.membership
            mixed = (belongs / belongs.sum(axis=0)).T @ np.array(palette, dtype=float)
            colours = np.rint(mixed).astype(np.uint8)
        colours[session.fixed] = rgb(FIXED)
        if marks_handles:
            unmarked = hidden if marks_pulled else hidden.union(session.state.pulls)
            for name, vertices in session.handles.items():
                if name not in unmarked:
                    colours[vertices] = handle_colour(session, name)
        return colours

    def _draw(self) -> None:
        if not self._shown:
            self._surface.set_colours(LAYER, None)
            return
        colours = self._base
        if self._preview is not None:
            vertices, colour = self._preview
            own = colours[vertices].astype(float)
            colours = colours.copy()
            colours[vertices] = np.rint(own + _PREVIEW_OPACITY * (colour - own))
        self._surface.set_colours(LAYER, colours)


def stiffness_colours(stiffness: FloatArray) -> NDArray[np.uint8]:
    """Return the colours (n, 3) of a *stiffness* (n,); that of the body is usual."""
    with np.errstate(divide="ignore"):
        size = np.clip(np.log10(stiffness), -1.0, 1.0)[:, None]
    usual, ends = rgb(BODY).astype(float), np.where(size < 0.0, rgb(_SOFT), rgb(_STIFF))
    colours = usual + np.abs(size) * (ends - usual)
    colours[np.isinf(stiffness)] = rgb(INK)
    return np.asarray(np.rint(colours), dtype=np.uint8)
