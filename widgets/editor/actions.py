"""What the keys of the editor do, each in a few lines.

Every action is a function of the desk; which key means which is told in `bindings`.  What takes
long is started as a job.  An action says what it has done, unless that is plain to see.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vtk_segdeform.errors import CageError, ConstraintError, RegionError
from vtk_segdeform.regions import segment as segmented

from ..region_selector import Paint, Tool
from .desk import Desk
from .stage import Mode

Action = Callable[[Desk], None]


def to_mode(mode: Mode) -> Action:
    """Return the action that enters *mode*."""

    def enter(desk: Desk) -> None:
        desk.mode = mode

    return enter


def with_tool(tool: Tool) -> Action:
    """Return the action that paints with *tool*."""

    def take(desk: Desk) -> None:
        desk.stage.selector.tool = tool

    return take


def painting(what: Paint) -> Action:
    """Return the action that paints *what*."""

    def paint(desk: Desk) -> None:
        desk.stage.selector.paints = what

    return paint


# Everywhere.


def undo(desk: Desk) -> None:
    """Take back the last step."""
    label = desk.session.undo()
    desk.say(f"undone: {label}" if label else "nothing to undo")


def redo(desk: Desk) -> None:
    """Do it again."""
    label = desk.session.redo()
    desk.say(f"done again: {label}" if label else "nothing to redo")


def reset(desk: Desk) -> None:
    """Go back to rest."""
    desk.session.reset_pose()
    desk.say("at rest")


def save(desk: Desk) -> None:
    """Save to the editor's file; one that is somebody else's only when asked twice."""
    place = desk.place
    question = f"{place} already exists; save again to replace it"
    if desk.file.may_replace(place) or desk.voice.confirms(question):
        desk.save()


def open_file(desk: Desk) -> None:
    """Open the editor's file; what is not saved is given up only when asked twice."""
    path = desk.place
    question = f"what was done is not saved: again to open {path} all the same"
    if not desk.file.is_behind(desk.session) or desk.voice.confirms(question):
        desk.open(path)


def segment(desk: Desk) -> None:
    """Find regions."""
    session = desk.session

    def keep(regions: Any) -> None:
        session.set_regions(regions, label="find regions")
        desk.stage.choose_region(min(desk.stage.selector.region, regions.n_regions - 1))
        desk.say(f"{_count(regions.n_regions, 'region')} found")

    desk.start("finding regions", lambda p: segmented(session.mesh, progress=p), keep)


def fit_cages(desk: Desk) -> None:
    """Fit cages to the regions."""
    session, regions = desk.session, desk.session.regions
    if regions is None:
        raise RegionError("there are no regions to fit cages to: G finds some, or paint them")

    def keep(cages: Any) -> None:
        if session.regions is not regions:  # by another window of the same session
            raise RegionError("regions changed while cages were fitted to them: F fits them anew")
        session.set_cages(cages, label="fit cages")
        total = sum(cage.n_vertices for cage in cages)
        desk.say(f"{_count(len(cages), 'cage')} fitted, {total} vertices in all")

    desk.start("fitting cages", session.fitted_cages, keep)


def toggle_cages(desk: Desk) -> None:
    """Show cages in every mode, or in their own only."""
    if not desk.session.cages:
        raise CageError("there are no cages to show yet: F fits them to the regions")
    desk.stage.cages_wanted = not desk.stage.cages_wanted
    desk.stage.show(desk.mode)
    desk.say("cages shown" if desk.stage.cages.is_shown else "cages hidden")


def toggle_overlay(desk: Desk) -> None:
    """Show the local volume change, or not."""
    desk.stage.overlay_wanted = not desk.stage.overlay_wanted
    desk.stage.show(desk.mode)
    desk.bind_if_ready()  # which shows it, once it is prepared


def toggle_volume(desk: Desk) -> None:
    """Hold the volume, or let it go."""
    session = desk.session
    session.change_options(preserve_volume=not session.options.preserve_volume)
    held = session.options.preserve_volume
    desk.say("volume held from the next move on" if held else "volume let go: not held any more")


def toggle_help(desk: Desk) -> None:
    """Show the card of keys, or hide it."""
    desk.help.toggle()


def cancel(desk: Desk) -> None:
    """Stop the job, or put away the card."""
    desk.cancel()


# Painting.


def toggle_through(desk: Desk) -> None:
    """Reach the far side too, or what is seen only."""
    selector = desk.stage.selector
    selector.through = not selector.through
    if not selector.through:  # else the hint says so
        desk.say("reaches only what is seen")


def grow(desk: Desk) -> None:
    """Paint one ring of edges more."""
    desk.stage.selector.grow()


def shrink(desk: Desk) -> None:
    """Paint one ring of edges less."""
    desk.stage.selector.shrink()


def next_region(desk: Desk) -> None:
    """Paint another region."""
    stage = desk.stage
    stage.choose_region((stage.selector.region + 1) % max(1, stage.n_regions))


def new_region(desk: Desk) -> None:
    """Paint a region that is not there yet."""
    desk.stage.choose_region(desk.stage.n_regions)


def merge_region(desk: Desk) -> None:
    """Make one of the region that is painted and the one under the pointer."""
    selector = desk.stage.selector
    _require_regions(desk, "merge")
    other = selector.region_under_pointer()
    if other is None or other == selector.region:
        raise RegionError(
            "point at the region that is to become one with "
            f"{desk.session.region_name(selector.region)}"
        )
    names = " and ".join(map(desk.session.region_name, sorted([selector.region, other])))
    desk.session.merge_regions([selector.region, other])
    selector.region = min(selector.region, other)
    desk.say(f"{names} are one")


def split_region(desk: Desk) -> None:
    """Cut the region that is painted in two."""
    _require_regions(desk, "cut")
    region = desk.stage.selector.region
    desk.session.split_region(region)
    desk.say(f"{desk.session.region_name(region)} cut in two")


# Handles.


def next_handle(desk: Desk) -> None:
    """Paint or drag another handle."""
    names = _names(desk)
    tool: Any = desk.stage.dragger if desk.mode is Mode.DEFORM else desk.stage.selector
    here = names.index(tool.handle) if tool.handle in names else -1
    tool.handle = names[(here + 1) % len(names)]
    desk.stage.selector.paints = Paint.HANDLE


def new_handle(desk: Desk) -> None:
    """Paint a handle that is not there yet."""
    desk.stage.selector.paints = Paint.HANDLE
    desk.stage.selector.handle = None


def remove_handle(desk: Desk) -> None:
    """Let go of the handle that is painted or dragged."""
    _names(desk)
    stage = desk.stage
    name = stage.dragger.handle if desk.mode is Mode.DEFORM else stage.selector.handle
    if name is None:
        raise ConstraintError("no handle is chosen: N chooses one")
    desk.session.remove_handle(name)
    desk.say(f"{name} removed")


def _require_regions(desk: Desk, verb: str) -> None:
    region, count = desk.stage.selector.region, desk.stage.n_regions
    if not count:
        raise RegionError(f"there are no regions to {verb} yet: G finds some, or paint them")
    if region >= count:
        name = desk.session.region_name(region)
        raise RegionError(f"{name} is still to be painted; N chooses one to {verb}")


def _names(desk: Desk) -> list[str]:
    """Return the names of the handles; an error says how to get one, where there is none."""
    names = list(desk.session.handles)
    if not names:
        raise ConstraintError("there is no handle yet: in mode 3, D and then paint one")
    return names


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
