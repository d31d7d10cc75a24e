"""Hints: the next step in each mode, in one line.

A hint names the key for that step, so that the user can reach every mode from every other one.
"""

from __future__ import annotations

import math

from vtk_segdeform.session import Session, region_name, volume_label
from vtk_segdeform.solver import Solution, Status

from ..puller import LOCKED
from ..region_selector import Paint, Tool
from ..volume_overlay import brief, signed
from .keys import Keys
from .widget_set import Mode, WidgetSet

_TURNING = {
    "": "R: turn",
    "limb": "Turning the limb about its axis. R: about the view",
    "view": "Turning about the line of sight. R: move",
    **dict.fromkeys("xyz", "Turning about the axis. R: move"),
}
TOOLS = {
    Tool.BRUSH: "brush",
    Tool.LASSO: "lasso",
    Tool.RECTANGLE: "rectangle",
    Tool.COMPONENT: "connected_part",
    Tool.REGION: "whole_region",
}
"""The actions that select them, by name."""


def missing(session: Session, mode: Mode, keys: Keys) -> str:
    """Return what *mode* lacks and the key that adds it, or "" if nothing is missing."""
    if session.regions is None and mode is Mode.REGIONS:
        return f"No regions yet. Press {keys.cap('segment')} to detect them, or paint one"
    if session.regions is None and mode is not Mode.HANDLES:
        paint = f"{keys.cap('regions')} to paint one"
        return f"No regions yet. Press {keys.cap('segment')} to detect them, or {paint}"
    if not session.cages and mode in (Mode.CAGES, Mode.DEFORM):
        return f"No cages yet. Press {keys.cap('fit_cages')} to fit them to the regions"
    if not session.handles and mode is Mode.DEFORM:
        return f"No handle yet. Press {keys.cap('handles')} to paint one"
    return ""


def hint(widgets: WidgetSet, mode: Mode, keys: Keys) -> str:
    """Return the hint for *mode*: the current action, and the next step."""
    if mode in (Mode.PULL, Mode.DEFORM) and widgets.landmarks.adds:
        stop = f"{keys.cap('add_landmarks')}: stop"
        return f"Click the surface to add a landmark, or drag from there to its target · {stop}"
    if mode is Mode.PULL:
        return _pull_hint(widgets, keys)
    lacking = missing(widgets.session, mode, keys)
    if lacking:
        return lacking
    if mode is Mode.DEFORM:
        return _deform_hint(widgets, keys)
    now = "Drag a cage vertex" if mode is Mode.CAGES else _painting_hint(widgets, keys)
    resets = mode is Mode.REGIONS and widgets.selector.paints is Paint.REGION
    if resets and widgets.session.state.pose is not None:
        now += ". Painting resets the pose"
    next_step = _next_step(widgets, mode, keys)
    return f"{now} · {next_step}" if next_step else now


def _painting_hint(widgets: WidgetSet, keys: Keys) -> str:
    selector = widgets.selector
    if selector.paints is Paint.REGION:
        new = selector.region >= widgets.n_regions
        name = widgets.session.painting.name(selector.region)
        target = brief(name, region_name((), selector.region)) + (" (new)" if new else "")
    elif selector.paints is Paint.FIXED:
        target = "fixed vertices"
    elif selector.paints is Paint.STIFFNESS:
        is_rigid = selector.stiffness == math.inf
        target = "rigid parts" if is_rigid else f"{selector.stiffness:g} times the usual stiffness"
    else:
        target = "new handle" if selector.handle is None else selector.handle
    if widgets.session.options.symmetry and selector.paints in (Paint.FIXED, Paint.STIFFNESS):
        target += " on both sides"
    through = " (X-ray)" if selector.through else ""
    return f"{keys[TOOLS[selector.tool]].label}: paint {target}{through}. Ctrl: erase"


def _pull_hint(widgets: WidgetSet, keys: Keys) -> str:
    session = widgets.session
    if widgets.puller.waiting.is_shown:
        return "Preview until the mesh is ready · Esc to cancel"
    if widgets.puller.waiting.is_active:
        return "Preparing: the pull starts in a moment · Esc to cancel"
    if session.is_dragging or widgets.puller.turning:
        return _drag_hint(widgets, f"X Y Z: axis. {_TURNING[widgets.puller.turning]}. ")
    if _is_volume_off(session):
        return f"Drag the surface · {_volume_off(keys)}"
    part = _part(widgets, keys)
    if part or session.history.undo_label == "pull":
        return f"Drag the surface. Shift-click pins. {part or keys.cap('undo') + ': undo'}"
    radius = 100.0 * widgets.puller.radius / session.mesh.diagonal
    share = f"{radius:.1f}".removesuffix(".0")  # as in the panel
    limb = f"{keys.cap('smaller_limb')} or {keys.cap('larger_limb')}: limb"
    return f"Drag the surface. Shift-click pins. {limb}. Shift+wheel: radius ({share} %)"


def _drag_hint(widgets: WidgetSet, own: str = "") -> str:
    session = widgets.session
    volume = f"Volume {signed(100.0 * session.volume_change, 2)} %"
    if not session.has_volume:
        volume = "No volume to preserve"
    return " · ".join(filter(None, (volume, _part(widgets), f"{own}Esc to cancel")))


def _part(widgets: WidgetSet, keys: Keys | None = None) -> str:
    """Return the volume change of the part under the hand, "Arm +14 %"; "" if it is 0 %.

    With *keys*, also the key that keeps this volume, unless it has a goal.
    """
    session, part = widgets.session, widgets.part
    if part is None or not session.is_bound:
        return ""
    change = signed(100.0 * widgets.overlay.region_volumes.change(part), 0)
    if change == "0":
        return ""
    label = volume_label(session.state.region_names, part)
    text = f"{brief(label, volume_label((), part))} {change} %"
    text = text[:1].upper() + text[1:]
    if keys is None or widgets.keeps(widgets.part):
        return text
    return f"{text} · {keys.cap('keep_part')}: keep its volume"


def _is_volume_off(session: Session) -> bool:
    options = session.options
    return session.has_volume and not (options.preserve_volume or options.preserve_region_volumes)


def _volume_off(keys: Keys) -> str:
    return f"Volume preservation off ({keys.cap('preserve_volume')} to turn on)"


def _deform_hint(widgets: WidgetSet, keys: Keys) -> str:
    session = widgets.session
    if session.is_dragging or widgets.dragger.turning:
        return _drag_hint(widgets, f"{_TURNING[widgets.dragger.turning]}. ")
    stuck = _out_of_reach(widgets)
    if stuck:
        return stuck
    if _is_volume_off(session):
        return f"Move or rotate a handle · {_volume_off(keys)}"
    solution = session.solution
    if solution is not None and solution.status not in (Status.CONVERGED, Status.STEP_LIMIT):
        text = str(solution.status)
        return text[:1].upper() + text[1:]
    if fault := _fault(solution):
        return fault
    further = f" · {keys.cap('finish')}: finish further" if session.can_finish_further else ""
    fixing = f" · {keys.cap('handles')}, {keys.cap('paint_fixed')}: paint fixed vertices"
    next_step = "" if len(session.fixed) else fixing
    axes = f" · Local axes ({keys.cap('local_axes')})" if widgets.dragger.local else ""
    part = f" · {text}" if (text := _part(widgets, keys)) else ""
    return f"Move or rotate a handle{axes}{part}{next_step}{further}"


def _fault(solution: Solution | None) -> str:
    """Return what is wrong with the surface of a finished pose; "" if it is all right."""
    if solution is None or not solution.is_finished:
        return ""
    if count := len(solution.crossings()):
        return f"{count:,} faces cross others. Move less, or turn on Avoid contact"
    if count := len(solution.folds()):
        plural = "s" if count > 1 else ""
        return f"{count:,} turned-over face{plural}. Move less, or add cage vertices"
    return ""


def _out_of_reach(widgets: WidgetSet) -> str:
    """Return why the selected handle cannot be moved; "" if it can."""
    name, dragger = widgets.dragger.handle, widgets.dragger
    if name in dragger.locked:
        return LOCKED.format(name)
    if name in dragger.hidden:
        return f"{name} is hidden. Tick Show in the list of handles to move it"
    return ""


def _next_step(widgets: WidgetSet, mode: Mode, keys: Keys) -> str:
    """Return the key for the next step after the work of *mode*."""
    session = widgets.session
    if mode is Mode.HANDLES and widgets.selector.paints is Paint.FIXED and not session.handles:
        return f"Next: {keys.cap('paint_handle')}, paint a handle"
    if mode is Mode.HANDLES and not session.handles:
        return f"{keys.cap('paint_fixed')}: paint fixed vertices"
    if session.regions is None:
        return f"Next: {keys.cap('segment')}, detect regions"
    if not session.cages:
        return f"Next: {keys.cap('fit_cages')}, fit cages"
    if session.handles:
        return f"Next: {keys.cap('deform')}, deform"
    return f"Next: {keys.cap('handles')}, paint a handle"
