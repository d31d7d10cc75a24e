"""Everything that shows and changes one session in one view, and which of it is on in which mode.

The mesh is one actor that all widgets share.  What is shown besides, cages and volumes, is as the
user wants it: `cages_wanted`, `overlay_wanted`.
"""

from __future__ import annotations

import enum
from contextlib import ExitStack

import numpy as np

from vtk_segdeform.progress import Progress, part
from vtk_segdeform.session import Session

from ..cage_display import CageDisplay
from ..handle_dragger import HandleDragger
from ..region_selector import Paint, RegionColours, RegionSelector
from ..scene import SurfaceDisplay, View, Widget
from ..volume_overlay import VolumeOverlay


class Mode(enum.Enum):
    """What the mouse does on the mesh."""

    REGIONS = 1
    """Paint regions."""
    CAGES = 2
    """Drag vertices of cages."""
    HANDLES = 3
    """Paint what stays fixed and what is dragged."""
    DEFORM = 4
    """Drag and turn handles."""


class Stage:
    """The widgets over one session; all of them off and hidden until `enter`.

    Parameters
    ----------
    view : View
        Where they live.
    session : Session
        What they show and change.
    """

    def __init__(self, view: View, session: Session) -> None:
        self.session = session
        self.surface = SurfaceDisplay(view, session)
        self.colours = RegionColours(self.surface)
        self.selector = RegionSelector(view, session, self.surface, self.colours)
        self.cages = CageDisplay(view, session)
        self.dragger = HandleDragger(view, session, self.surface)
        self.overlay = VolumeOverlay(view, session, self.surface)
        self.cages_wanted = self.overlay_wanted = False
        self.cages.hide()
        self.choose_region(0)

    @property
    def widgets(self) -> tuple[Widget, ...]:
        """Those that take events: in each mode one of them."""
        return self.selector, self.cages, self.dragger

    @property
    def n_regions(self) -> int:
        """How many regions there are."""
        regions = self.session.regions
        return 0 if regions is None else regions.n_regions

    def choose_region(self, region: int) -> None:
        """Paint *region* from now on; one beyond the last is a new one.

        Where there are none yet, region 0 is to hold everything, and the first to paint is 1.
        """
        self.selector.region = min(region, self.n_regions) if self.n_regions else 1

    def enter(self, mode: Mode) -> None:
        """Switch on what belongs to *mode*, and show what goes with it."""
        if mode is Mode.REGIONS:
            self.selector.paints = Paint.REGION
        elif mode is Mode.HANDLES and self.selector.paints is Paint.REGION:
            self.selector.paints = Paint.HANDLE if len(self.session.fixed) else Paint.FIXED
        self.show(mode)
        self.cages.SetEnabled(mode is Mode.CAGES)
        self.selector.SetEnabled(mode in (Mode.REGIONS, Mode.HANDLES))
        self.dragger.SetEnabled(mode is Mode.DEFORM)

    def show(self, mode: Mode) -> None:
        """Show what goes with *mode* and is wanted: painting needs to see what it paints."""
        if mode is Mode.CAGES or self.cages_wanted:
            self.cages.show()
        else:
            self.cages.hide()
        if self.wants_overlay(mode) and self.overlay.is_prepared:
            self.overlay.show()
        else:
            self.overlay.hide()

    def wants_overlay(self, mode: Mode) -> bool:
        """Tell whether volumes are to be seen in *mode*: where something is deformed."""
        return self.overlay_wanted and mode in (Mode.CAGES, Mode.DEFORM)

    def follow(self, before: Stage) -> None:
        """Go on with the tools of the stage *before*, and show what it did."""
        mine, its = self.selector, before.selector
        mine.tool, mine.through = its.tool, its.through
        share = its.radius / before.session.mesh.diagonal
        mine.radius = share * self.session.mesh.diagonal
        self.dragger.local = before.dragger.local
        self.overlay.wanted_range = before.overlay.wanted_range
        self.cages_wanted, self.overlay_wanted = before.cages_wanted, before.overlay_wanted

    def succeeded_by(self, session: Session) -> Stage:
        """Take everything out of the view, and return a stage for another session in its place."""
        after = Stage(self.selector.view, session)
        after.follow(self)
        self.remove()
        if not np.array_equal(session.mesh.vertices, self.session.mesh.vertices):
            after.selector.view.renderer.ResetCamera()
        return after

    def bind(self, progress: Progress) -> None:
        """Do what the first drag would have to wait for; in any thread, while nothing is on."""
        self.session.bind(part(progress, 0.0, 0.9))
        self.overlay.prepare()

    def measure(self, progress: Progress) -> None:
        """Do what a look at volumes would have to wait for; as `bind`."""
        progress(0.0, "")
        self.overlay.prepare()

    def finish(self) -> None:
        """Finish the ongoing drag or stroke as if the button had been released."""
        for widget in self.widgets:
            widget.finish()

    def cancel(self) -> bool:
        """Cancel the ongoing drag or stroke; False if there was none."""
        return any(widget.cancel() for widget in self.widgets)

    def rest(self) -> None:
        """Switch all widgets off; an ongoing drag is finished, and the display is unchanged."""
        with ExitStack() as all_of_them:  # continues if one of them raises
            for widget in self.widgets:
                all_of_them.callback(widget.Off)

    def remove(self) -> None:
        """Take everything out of the view, for good."""
        for each in (self.overlay, self.dragger, self.cages, self.selector, self.colours):
            each.remove()
        self.surface.remove()
