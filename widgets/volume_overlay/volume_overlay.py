"""The local volume change in colours on the mesh, with a colour bar and lines of text.

The local volume change s_i of vertex i is relative to the rest pose: positive (orange) where volume
grows, negative (blue) where it shrinks.  The volume at i is that of the tetrahedra from the
triangles around i to the opposite vertex o(i), where the largest inner ball that touches the
surface at i touches it again:

    L_i(x) = sum_{T = (a, b, c) at i} det(x_a - x_o, x_b - x_o, x_c - x_o) / 18
    s_i(x) = sum_j k_ij L_j(x) / sum_j k_ij L_j(rest) - 1

with a smoothing kernel k on the surface.  Under a rigid motion s is 0 and the mesh has exactly one
colour.  `vtk_segdeform.geometry.local_volume` computes s, only while the overlay is shown.

Where nothing encloses a volume, as on a sheet, there are no colours and no colour bar, and the
first line says so.

The lines of text are, from the top: for an open mesh, what encloses a volume; (V - V0) / V0 of the
whole mesh; the smallest and the largest s; (V - V0) / V0 of each region, closed at its border as in
`vtk_segdeform.solver.volume_constraints`.

Source
------
The vertices o(i): J. Ma, S. W. Bae, S. Choi, "3D medial axis point approximation using nearest
neighbors and the normal field", The Visual Computer 28, 2012.
"""

from __future__ import annotations

from typing import Any

from vtk_segdeform.arrays import FloatArray, is_number
from vtk_segdeform.checks import require, shown
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.freezing import read_only
from vtk_segdeform.geometry import LocalVolume
from vtk_segdeform.session import Change, Session, region_name

from ..scene import Stop, SurfaceDisplay, View
from .diverging import colours_of, half_range_for
from .legend import Legend, brief, in_tenths, percent, signed
from .region_volumes import RegionVolumes

_LAYER = "volume"
_IN_LINES = Change.REGIONS | Change.NAMES | Change.OPTIONS
_RANGE = 0.5  # at the ends of the scale, unless another one is wanted
_MOST_REGIONS = 8  # more lines would cover the mesh
# Ambient, diffuse and specular light: strong shading would be confused with the colour scale.
_SOFT_LIGHT = 0.55, 0.45, 0.0


class VolumeOverlay:
    """Colours of the mesh, a colour bar and lines of text; hidden until `show`.

    Parameters
    ----------
    view : View, pyvista.Plotter or (vtkRenderer, vtkRenderWindowInteractor)
        The view to draw in.
    session : Session
        The session whose pose is shown.
    surface : SurfaceDisplay, optional
        The displayed mesh of the session; by default the overlay adds its own.

    Attributes
    ----------
    region_volumes : RegionVolumes
        The volume change of each region.
    """

    def __init__(self, view: Any, session: Session, surface: SurfaceDisplay | None = None) -> None:
        self.view = View.of(view)
        self.session = require(session, Session, "session")
        if surface is not None:
            require(surface, SurfaceDisplay, "surface")
        self._own_surface = surface is None
        self._surface = SurfaceDisplay(self.view, session) if surface is None else surface
        self._legend = Legend(self.view, "Local volume\nchange")
        self._local: LocalVolume | None = None
        self.region_volumes = RegionVolumes(session)
        self._change: FloatArray | None = None
        self._half_range: float | None = None
        self._wanted_range: float | None = _RANGE
        self._light = _SOFT_LIGHT
        self._stop: Stop | None = None

    @property
    def is_shown(self) -> bool:
        """Whether the overlay is shown."""
        return self._stop is not None

    @property
    def change(self) -> FloatArray | None:
        """(n,) float: s of the current pose; None while hidden."""
        return self._change

    @property
    def half_range(self) -> float | None:
        """The local volume change at the ends of the scale; None without a scale."""
        return self._half_range

    @property
    def wanted_range(self) -> float | None:
        """The local volume change wanted at the ends of the scale; 0.5 by default.

        Can be set to None, which is automatic, or to a number above 0; anything else raises an
        ArgumentError.
        """
        return self._wanted_range

    @wanted_range.setter
    def wanted_range(self, share: float | None) -> None:
        if share is not None and not (is_number(share) and share > 0.0):
            raise ArgumentError(
                f"wanted_range must be a number above 0, or None; got {shown(share)}"
            )
        if share != self._wanted_range:
            self._wanted_range, self._half_range = share, None
            if self._change is not None:
                self._show(self._change)

    @property
    def is_prepared(self) -> bool:
        """Whether `prepare` is done, so that `show` is immediate."""
        return self._local is not None

    def prepare(self) -> None:
        """Compute in advance everything the first `show` needs.

        The result depends on the mesh and its regions only, and nothing is drawn, so this may be
        called in another thread.
        """
        self._prepared()
        self.region_volumes.prepare()

    def show(self) -> None:
        """Show the overlay and update it whenever the pose changes."""
        if not self.is_shown:
            self._stop = self.session.on_change(self._changed)
            self._swap_light()
            self._update()

    def hide(self) -> None:
        """Hide the overlay and stop computing."""
        if self._stop is None:
            return
        self._stop()
        self._stop = self._change = self._half_range = None
        self._legend.hide()
        self._swap_light()
        self._surface.set_colours(_LAYER, None)

    def remove(self) -> None:
        """Remove the overlay from the view permanently."""
        self.hide()
        if self._own_surface:
            self._surface.remove()

    def _prepared(self) -> LocalVolume:
        self._local = self._local or LocalVolume(self.session.mesh)
        return self._local

    def _changed(self, change: Change) -> None:
        if change & Change.POSE:
            self._update()
        elif change & _IN_LINES and self._change is not None:
            self._legend.show(self._half_range, self._lines(self._change))
            self.view.request_render()

    def _update(self) -> None:
        self._change = read_only(self._prepared().change(self.session.vertices))
        self._show(self._change)

    def _show(self, change: FloatArray) -> None:
        colours = None
        if self._prepared().is_defined:
            self._half_range = self._wanted_range or half_range_for(change, self._half_range)
            colours = colours_of(change, self._half_range)
        self._legend.show(self._half_range, self._lines(change))
        self._surface.set_colours(_LAYER, colours)

    def _swap_light(self) -> None:
        """Exchange the light of the surface with the stored one: the soft light or its own."""
        material, light = self._surface.actor.GetProperty(), self._light
        self._light = material.GetAmbient(), material.GetDiffuse(), material.GetSpecular()
        material.SetAmbient(light[0])
        material.SetDiffuse(light[1])
        material.SetSpecular(light[2])

    def _lines(self, change: FloatArray) -> list[tuple[str, int | None]]:
        low, high = (signed(100.0 * float(share), 0) for share in (change.min(), change.max()))
        lines: list[tuple[str, int | None]] = []
        if not (self.session.mesh.is_closed and self.session.has_volume):
            lines.append((self.session.volume_summary, None))
        if self.session.has_volume:
            lines.append((f"Volume: {percent(self.session.volume_change)}", None))
        if self._prepared().is_defined:
            lines.append((f"Local: {low} to {high} %", None))
        regions = self.region_volumes.changes()
        lines += [
            (f"{self._name(region)}: {in_tenths(share)}", region)
            for region, share in regions[:_MOST_REGIONS]
        ]
        if len(regions) > _MOST_REGIONS:
            more = len(regions) - _MOST_REGIONS
            lines.append((f"{more} more region{'s' * (more != 1)}", None))
        return lines

    def _name(self, region: int) -> str:
        return brief(self.session.painting.name(region), region_name((), region))
