"""Actions of panels and menus, with a region, a handle, a file, a view or a number as argument.

Most functions return an action: a function of the `Controller`, as in `actions`.  The actions that
move the camera work during a job and during a drag, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from vtk_segdeform.errors import RegionError, SessionError

from ..region_selector import Paint
from .actions import Action, fit_cages, once_settled, segment, toggle_volume
from .controller import Controller
from .session_file import write_posed
from .widget_set import Mode


def choosing_regions(regions: Sequence[int]) -> Action:
    """Return the action that selects *regions*, one of them for painting."""
    return lambda controller: controller.widgets.choose_regions(regions)


def merging(regions: Sequence[int]) -> Action:
    """Return the action that merges *regions*."""

    def merge(controller: Controller) -> None:
        if len(regions) < 2:
            raise RegionError("Select two or more regions to merge")
        *names, last = map(controller.session.region_name, sorted(regions))
        controller.session.painting.merge(sorted(regions))
        controller.widgets.choose_region(min(regions))
        controller.say(f"Merged {', '.join(names)} and {last}")

    return merge


def naming_region(region: int, name: str) -> Action:
    """Return the action that renames *region*; "" restores its default name."""

    def rename(controller: Controller) -> None:
        before = controller.session.region_name(region)
        controller.session.painting.rename(region, name)
        controller.say(f"Renamed {before} to {controller.session.region_name(region)}")

    return rename


def segmenting(n_regions: int) -> Action:
    """Return the action that segments the mesh into *n_regions* regions."""
    return lambda controller: segment(controller, n_regions)


def fitting_with(n_cage_vertices: int) -> Action:
    """Return the action that sets the total number of cage vertices, and fits cages with it."""

    def fit(controller: Controller) -> None:
        if controller.session.regions is None:
            controller.session.change_options(n_cage_vertices=n_cage_vertices)
        else:
            fit_cages(controller, n_cage_vertices)

    return fit


def showing_cage(region: int, visible: bool) -> Action:
    """Return the action that shows or hides the cage of *region*."""
    return lambda controller: controller.widgets.cages.set_visible(region, visible)


def choosing_handle(name: str) -> Action:
    """Return the action that selects a handle."""

    def select(controller: Controller) -> None:
        controller.widgets.selector.handle = controller.widgets.dragger.handle = name
        if controller.mode is Mode.HANDLES:
            controller.widgets.selector.paints = Paint.HANDLE

    return select


def hiding_handle(name: str, hidden: bool) -> Action:
    """Return the action that hides or shows a handle; the session is unchanged."""

    def hide(controller: Controller) -> None:
        controller.widgets.dragger.set_hidden(name, hidden)
        controller.widgets.show(controller.mode)

    return hide


def locking_handle(name: str, locked: bool) -> Action:
    """Return the action that locks a handle against dragging, or unlocks it."""
    return lambda controller: controller.widgets.dragger.set_locked(name, locked)


def renaming(name: str, new_name: str) -> Action:
    """Return the action that renames a handle."""

    def rename(controller: Controller) -> None:
        was_pull = name in controller.session.state.pulls
        controller.session.handles.rename(name, new_name)
        if controller.widgets.selector.handle == name:
            controller.widgets.selector.handle = new_name
        is_pull = new_name in controller.session.state.pulls
        remark = ", which is now a handle" if was_pull and not is_pull else ""
        controller.say(f"Renamed {name} to {new_name}{remark}")

    return rename


def selecting_through(through: bool) -> Action:
    """Return the action that includes hidden vertices in strokes, or excludes them."""

    def select(controller: Controller) -> None:
        controller.widgets.selector.through = through

    return select


def with_radius(radius: float) -> Action:
    """Return the action that sets the brush radius."""

    def resize(controller: Controller) -> None:
        controller.widgets.selector.radius = radius

    return resize


def pulling_with(*, radius: float | None = None, locality: float | None = None) -> Action:
    """Return the action that sets the radius of a pull, if given, and its locality, or None."""

    def change(controller: Controller) -> None:
        puller = controller.widgets.puller
        if radius is not None:
            puller.radius = radius
        else:
            puller.locality = locality

    return change


def setting_colour_range(share: float | None) -> Action:
    """Return the action that sets the colour range of the overlay to plus and minus *share*.

    None selects it automatically.
    """

    def set_range(controller: Controller) -> None:
        controller.widgets.overlay.wanted_range = share

    return set_range


def setting(**changes: float | bool | None) -> Action:
    """Return the action that changes options of the session."""
    return lambda controller: controller.session.change_options(**changes)


def preserving_volume(wanted: bool) -> Action:
    """Return the action that turns volume preservation on or off, and says so."""

    def change(controller: Controller) -> None:
        if controller.session.options.preserve_volume != wanted:
            toggle_volume(controller)

    return change


def finishing_after_drags(wanted: bool) -> Action:
    """Return the action that finishes poses on the mesh after each drag, or no longer."""

    def change(controller: Controller) -> None:
        controller.finishing.is_wanted = wanted
        if wanted:
            controller.finishing.rest()

    return change


def opening(path: Path) -> Action:
    """Return the action that opens a session or a mesh."""
    return lambda controller: controller.open(path)


def saving(path: Path, then: Callable[[], object] = lambda: None) -> Action:
    """Return the action that saves the session to *path*, which becomes its file.

    A pose that still converges is saved once it has settled, and *then* is called.
    """

    def save(controller: Controller) -> None:
        controller.file.path = path
        controller.save()
        then()

    return once_settled(save)


def exporting(path: Path, then: Callable[[], object] = lambda: None) -> Action:
    """Return the action that writes the surface in the pose, otherwise as it was given.

    The suffix selects the format, which may not support all arrays: see `io.write_mesh`; what is
    left out is said.  The file is then read again in another thread, see `Controller.read_again`.
    A pose that still converges is written once it has settled, and *then* is called.
    """

    def export(controller: Controller) -> None:
        session = controller.session
        if session.is_dragging:
            raise SessionError("Finish the drag before saving the mesh")
        controller.finishing.interrupt()
        written = write_posed(session, path)
        saved = f"Mesh saved to {path}{controller.pose_remark}"
        controller.say(". ".join([saved, *written.remarks]))
        controller.read_again(written)
        then()

    return once_settled(export)


# The camera.


def looking_from(name: str) -> Action:
    """Return the action that shows the model from a view: "front", "top" or another of `VIEWS`."""
    return lambda controller: controller.camera.viewpoint.look_from(name)


def with_up(axis: int) -> Action:
    """Return the action that makes an axis, 0 to 2, the up axis, and shows the model upright."""

    def turn_up(controller: Controller) -> None:
        controller.camera.viewpoint.up = np.eye(3)[axis]
        controller.camera.viewpoint.look_from("home")
        controller.say(f"Up: {'XYZ'[axis]}")

    return turn_up


def toggle_projection(controller: Controller) -> None:
    """Switch between perspective and orthographic projection."""
    is_orthographic = controller.camera.viewpoint.toggle_projection()
    controller.say("Orthographic" if is_orthographic else "Perspective")


def toggle_cube(controller: Controller) -> None:
    """Show or hide the orientation cube."""
    cube = controller.camera.cube
    if cube.is_shown:
        cube.hide()
    else:
        cube.show()


def frame_selection(controller: Controller) -> None:
    """Frame the selected region or handle, or else all."""
    controller.camera.frame_selection(controller.mode)


def frame_all(controller: Controller) -> None:
    """Frame the model."""
    controller.camera.viewpoint.frame()
