"""What a panel does besides what keys do: it can name a region, a handle, a file or a number.

As in `actions`, everything here is a function of the desk, or returns one.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vtk_segdeform.errors import RegionError, SessionError

from ..region_selector import Paint
from .actions import Action
from .desk import Desk
from .stage import Mode


def choosing_region(region: int) -> Action:
    """Return the action that goes on with *region*."""
    return lambda desk: desk.stage.choose_region(region)


def merging(regions: Sequence[int]) -> Action:
    """Return the action that makes one of some *regions*."""

    def merge(desk: Desk) -> None:
        if len(regions) < 2:
            raise RegionError("choose two regions or more that are to become one")
        *names, last = map(desk.session.region_name, sorted(regions))
        desk.session.merge_regions(sorted(regions))
        desk.stage.choose_region(min(regions))
        desk.say(f"{', '.join(names)} and {last} are one")

    return merge


def naming_region(region: int, name: str) -> Action:
    """Return the action that calls *region* something else, or by its place where it is ""."""

    def call(desk: Desk) -> None:
        before = desk.session.region_name(region)
        desk.session.rename_region(region, name)
        desk.say(f"{before} is now {desk.session.region_name(region)}")

    return call


def showing_cage(region: int, visible: bool) -> Action:
    """Return the action that shows or hides the cage of *region* among those that are shown."""
    return lambda desk: desk.stage.cages.set_visible(region, visible)


def choosing_handle(name: str) -> Action:
    """Return the action that goes on with a handle."""

    def choose(desk: Desk) -> None:
        desk.stage.selector.handle = desk.stage.dragger.handle = name
        if desk.mode is Mode.HANDLES:
            desk.stage.selector.paints = Paint.HANDLE

    return choose


def renaming(name: str, new_name: str) -> Action:
    """Return the action that calls a handle something else."""

    def rename(desk: Desk) -> None:
        desk.session.rename_handle(name, new_name)
        if desk.stage.selector.handle == name:
            desk.stage.selector.handle = new_name
        desk.say(f"{name} is now {new_name}")

    return rename


def reaching(through: bool) -> Action:
    """Return the action that lets strokes reach what is hidden, or not."""

    def reach(desk: Desk) -> None:
        desk.stage.selector.through = through

    return reach


def with_radius(radius: float) -> Action:
    """Return the action that makes the brush as large."""

    def take(desk: Desk) -> None:
        desk.stage.selector.radius = radius

    return take


def ranging(share: float | None) -> Action:
    """Return the action that has the colours of volumes end at plus and minus a *share*.

    None has the overlay choose.
    """

    def take(desk: Desk) -> None:
        desk.stage.overlay.wanted_range = share

    return take


def setting(**changes: float | bool | None) -> Action:
    """Return the action that changes some of the session's options."""
    return lambda desk: desk.session.change_options(**changes)


def opening(path: Path) -> Action:
    """Return the action that goes on with the session, or the mesh, in a file."""
    return lambda desk: desk.open(path)


def saving(path: Path) -> Action:
    """Return the action that saves the session to *path*, from now on its file."""

    def save(desk: Desk) -> None:
        desk.file.path = path
        desk.save()

    return save


def exporting(path: Path) -> Action:
    """Return the action that writes the mesh in its pose, with all it came with.

    In the format of the suffix, which may not hold all of it: see `convert.write_mesh`.
    """

    def export(desk: Desk) -> None:
        from vtk_segdeform.io import write_mesh  # which imports pyvista

        session = desk.session
        if session.is_dragging:
            raise SessionError("let go of what is dragged before the mesh is written")
        write_mesh(path, desk.file.deformed(session))
        desk.say(f"mesh written to {path}")

    return export
