"""The widgets that show and change one session, and which of them are on in each mode.

All widgets share one actor for the mesh.  Regions are filled where they are painted.  The user
decides whether cages, volume changes and the outlines of regions are shown as well:
`cages_wanted`, `overlay_wanted`, `regions_wanted`.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from contextlib import ExitStack
from typing import NamedTuple

import numpy as np

from vtk_segdeform.arrays import BoolArray, FloatArray
from vtk_segdeform.cages import suggested_size
from vtk_segdeform.progress import Progress, part
from vtk_segdeform.session import Options, Session, pulls

from ..cage_display import CageDisplay
from ..handle_dragger import HandleDragger
from ..picking import Picker
from ..puller import LandmarkMarks, Puller
from ..region_selector import (
    Paint,
    RegionColours,
    RegionOutlines,
    RegionSelector,
)
from ..scene import CarriedDisplay, Pointer, SurfaceDisplay, View, Widget
from ..volume_overlay import VolumeOverlay


class Mode(enum.Enum):
    """The current action of the mouse on the mesh."""

    PULL = 0
    """Pull the surface at any point."""
    REGIONS = 1
    """Paint regions."""
    CAGES = 2
    """Drag cage vertices."""
    HANDLES = 3
    """Paint fixed vertices and handles."""
    DEFORM = 4
    """Move and rotate handles."""


class Spot(NamedTuple):
    """What is at a place of the surface."""

    vertex: int
    region: int | None
    """None if there are no regions."""
    handle: str | None
    """A handle, pin or pulled point."""


class WidgetSet:
    """The widgets over one session, all of them off and hidden until `enter`.

    Parameters
    ----------
    view : View
        Where they are drawn.
    session : Session
        The session that they show and change.
    """

    def __init__(self, view: View, session: Session) -> None:
        self.session = session
        self.surface = SurfaceDisplay(view, session)
        self._picker = Picker(self.surface)
        self.colours = RegionColours(self.surface)
        self.outlines = RegionOutlines(self.surface)
        self.selector = RegionSelector(view, session, self.surface, self.colours)
        self.cages = CageDisplay(view, session)
        self.dragger = HandleDragger(view, session, self.surface)
        self.puller = Puller(view, session, self.surface)
        self.puller.binds = False  # the editor does, in the background
        self.puller.is_locked = lambda name: name in self.dragger.locked
        self.puller.is_hidden = lambda name: name in self.dragger.hidden
        self.dragger.pulls_with = lambda: self.puller.options
        self.landmarks = LandmarkMarks(view, session, self.surface)
        self.overlay = VolumeOverlay(view, session, self.surface)
        self.carried = CarriedDisplay(view, session)
        self.cages_wanted = self.overlay_wanted = self.regions_wanted = False
        self.cages.hide()
        self._chosen: tuple[int, ...] = ()
        self.choose_region(0)

    @property
    def interactive(self) -> tuple[Widget, ...]:
        """The widgets that respond to events; one of them, and the landmarks, is on in a mode."""
        return self.landmarks, self.puller, self.selector, self.cages, self.dragger

    @property
    def n_regions(self) -> int:
        """Number of regions."""
        regions = self.session.regions
        return 0 if regions is None else regions.n_regions

    @property
    def n_cage_vertices(self) -> int:
        """Total number of cage vertices; before cages are fitted, the suggested number."""
        session = self.session
        if session.cages:
            return sum(cage.n_vertices for cage in session.cages)
        wanted = session.options.n_cage_vertices
        is_default = wanted == Options().n_cage_vertices
        return suggested_size(session.regions) if session.regions and is_default else wanted

    @property
    def part(self) -> str | None:
        """The volume under the hand: of the region of the dragged, or else the active handle."""
        session, drag = self.session, self.session.history.drag
        moved = [] if drag is None else [each for each in drag.moved if each in session.handles]
        name, regions = moved[-1] if moved else self.dragger.handle, session.regions
        if name is None or regions is None:
            return None
        ids = session.handles[name]
        return f"region {regions.label_at(pulls.middle_vertex(session.mesh, ids))}"

    def keeps(self, part: str | None) -> bool:
        """Return whether the volume called *part* is preserved or set."""
        options = self.session.options
        goal = dict(options.volumes).get(part or "")
        return options.preserve_region_volumes if goal is None else goal != "free"

    def choose_region(self, region: int) -> None:
        """Select *region* for painting; an index after the last one adds a region.

        Without regions, 1 is selected: region 0 will be the rest of the mesh.
        """
        self.selector.region = min(region, self.n_regions) if self.n_regions else 1

    def choose_regions(self, regions: Sequence[int]) -> None:
        """Select several regions, of which one is painted: the current one if it is there."""
        self._chosen = tuple(sorted(regions))
        if regions and self.selector.region not in regions:
            self.choose_region(regions[0])

    @property
    def chosen_regions(self) -> tuple[int, ...]:
        """The selected regions, with the one that is painted."""
        region = self.selector.region
        return self._chosen if region in self._chosen else (region,)

    def enter(self, mode: Mode) -> None:
        """Activate the widget of *mode* and show its actors."""
        in_regions = self.selector.paints in (Paint.REGION, Paint.STIFFNESS)
        if mode is Mode.REGIONS and not in_regions:
            self.selector.paints = Paint.REGION
        elif mode is Mode.HANDLES and (in_regions or not self.session.handles):
            self.selector.paints = Paint.HANDLE if len(self.session.fixed) else Paint.FIXED
        self.surface.instead = None
        self.show(mode)
        self.landmarks.SetEnabled(mode in (Mode.PULL, Mode.DEFORM))  # before those that it covers
        self.cages.SetEnabled(mode is Mode.CAGES)
        self.selector.SetEnabled(mode in (Mode.REGIONS, Mode.HANDLES))
        self.dragger.SetEnabled(mode is Mode.DEFORM)
        self.puller.SetEnabled(mode is Mode.PULL)

    def show(self, mode: Mode) -> None:
        """Show what *mode* shows, and cages, volume changes and regions that are wanted."""
        self.colours.fill(
            regions=mode is Mode.REGIONS,
            handles=mode in (Mode.PULL, Mode.HANDLES, Mode.DEFORM),
            hidden=self.dragger.hidden,
            pulled=mode is not Mode.PULL,
            stiffness=mode is Mode.REGIONS and self.selector.paints is Paint.STIFFNESS,
        )
        self.outlines.show(
            lines=self.regions_wanted and mode is not Mode.REGIONS,
            numbers=self.regions_wanted or mode is Mode.REGIONS,
        )
        self.carried.is_shown = True
        if mode is Mode.CAGES or self.cages_wanted:
            self.cages.show()
        else:
            self.cages.hide()
        if self.wants_overlay(mode) and self.overlay.is_prepared:
            self.overlay.show()
        else:
            self.overlay.hide()

    def show_instead(self, vertices: FloatArray) -> None:
        """Show *vertices* (n, 3) of the mesh, and none of the widgets, until `enter`."""
        self.switch_off()
        self.overlay.hide()
        self.cages.hide()
        self.carried.is_shown = False
        self.outlines.show(lines=False, numbers=False)
        self.surface.instead = vertices

    def show_only(self, vertices: BoolArray | None) -> None:
        """Show some *vertices*, a mask (n,), and what is on them; None shows all."""
        self.finish()
        self.surface.only = None if vertices is None or vertices.all() else vertices
        self.dragger.update()

    def wants_overlay(self, mode: Mode) -> bool:
        """Return whether volume changes are shown in *mode*; painting hides them."""
        return self.overlay_wanted and mode in (Mode.PULL, Mode.CAGES, Mode.DEFORM)

    def copy_settings(self, before: WidgetSet) -> None:
        """Use the same tools, sizes and display options as the widgets *before*."""
        mine, its = self.selector, before.selector
        mine.tool, mine.through, mine.stiffness = its.tool, its.through, its.stiffness
        size = self.session.mesh.diagonal / before.session.mesh.diagonal
        mine.radius = size * its.radius
        self.puller.radius = size * before.puller.radius
        self.puller.locality, self.puller.limb = before.puller.locality, before.puller.limb
        self.puller.hinge = before.puller.hinge
        self.dragger.local = before.dragger.local
        self.landmarks.is_hidden = before.landmarks.is_hidden
        self.carried.copy_settings(before.carried)
        self.overlay.wanted_range = before.overlay.wanted_range
        self.surface.style = before.surface.style
        self.cages_wanted, self.overlay_wanted = before.cages_wanted, before.overlay_wanted
        self.regions_wanted = before.regions_wanted

    def replaced_by(self, session: Session) -> WidgetSet:
        """Remove these widgets from the view, and return others over another session."""
        after = WidgetSet(self.selector.view, session)
        after.copy_settings(self)
        self.remove()
        return after

    def reach(self, rectangle: tuple[float, float, float, float]) -> bool:
        """Return whether the gizmo or a marker is in a *rectangle*: left, bottom, right, top."""
        return self.dragger.gizmo.reaches(rectangle) or self.puller.reaches(rectangle)

    def point_at(self, pointer: Pointer) -> FloatArray | None:
        """Return the point (3,) of the surface at *pointer*, or None beside it."""
        hit = self._picker.hit(pointer)
        return None if hit is None else hit.point

    def spot_at(self, pointer: Pointer) -> Spot | None:
        """Return the vertex at *pointer*, with its region and handle; None beside the surface."""
        hit, session = self._picker.hit(pointer), self.session
        if hit is None:
            return None
        handles = (name for name, ids in session.handles.items() if hit.vertex in ids)
        region = None if session.regions is None else session.regions.label_at(hit.vertex)
        return Spot(hit.vertex, region, next(handles, None))

    def part_at(self, pointer: Pointer) -> FloatArray | None:
        """Return the vertices (k, 3) of the region at *pointer*, or else of the connected part.

        None beside the surface.
        """
        spot = self.spot_at(pointer)
        return None if spot is None else self.part_of(spot)

    def part_of(self, spot: Spot) -> FloatArray:
        """Return the vertices (k, 3) of the region of *spot*, or else of the connected part."""
        return self.session.vertices[self.mask_of(spot)]

    def mask_of(self, spot: Spot) -> BoolArray:
        """Return the same vertices as a mask, (n,)."""
        regions = self.session.regions
        if regions is None or spot.region is None:
            return self._picker.component(spot.vertex)
        return np.asarray(regions.membership[spot.region])

    def bind(self, progress: Progress) -> None:
        """Precompute the data of the first drag; in any thread, while all widgets are off."""
        self.session.bind(part(progress, 0.0, 0.75))  # share of the time
        self.overlay.prepare()

    def measure(self, progress: Progress) -> None:
        """Precompute the data of the overlay; in any thread, as `bind`."""
        progress(0.0, "")
        self.overlay.prepare()

    @property
    def is_settling(self) -> bool:
        """Whether a released pose still converges, above all a far one that avoids contact."""
        is_refined = self.puller.is_refining or self.dragger.is_refining
        return is_refined and not self.session.is_dragging and self.session.is_unsettled

    @property
    def is_pose_to_come(self) -> bool:
        """Whether a released pose still converges, or a released pull waits for its session."""
        return self.is_settling or self.puller.waiting.has_pull

    def stop_refining(self) -> None:
        """Keep the present pose, although it has not settled."""
        self.puller.stop_refining()
        self.dragger.stop_refining()

    def leave(self) -> None:
        """Show nothing at the pointer until it moves again, as the view has moved under it."""
        self.puller.leave()
        self.selector.leave()

    def resume_refining(self) -> None:
        """Refine a pose that has not converged; its widget is on."""
        self.puller.resume_refining()
        self.dragger.resume_refining()

    def finish(self) -> None:
        """Finish the ongoing drag or stroke as if the button had been released."""
        for widget in self.interactive:
            widget.finish()

    def cancel(self) -> bool:
        """Cancel the ongoing drag or stroke; False if there was none."""
        return any(widget.cancel() for widget in self.interactive)

    def switch_off(self) -> None:
        """Switch all widgets off; an ongoing drag is finished, and the display is unchanged."""
        with ExitStack() as stack:  # continues if one of them raises
            for widget in self.interactive:
                stack.callback(widget.Off)

    def remove(self) -> None:
        """Remove everything from the view, permanently."""
        self.overlay.remove()
        self.carried.remove()
        for widget in reversed(self.interactive):
            widget.remove()
        self.outlines.remove()
        self.colours.remove()
        self.surface.remove()
