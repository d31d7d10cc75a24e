"""What to do next, in each mode, in one line.

A hint names the key that leads on, so that no mode is a dead end: whatever a mode needs can be
made from where one stands.
"""

from __future__ import annotations

from vtk_segdeform.session import Session, region_name
from vtk_segdeform.solver import Status

from ..region_selector import Paint, Tool
from ..volume_overlay import brief, signed
from .stage import Mode, Stage

_TOOLS = {
    Tool.BRUSH: "brush",
    Tool.LASSO: "lasso",
    Tool.RECTANGLE: "rectangle",
    Tool.COMPONENT: "click",
}


def missing(session: Session, mode: Mode) -> str:
    """Return what *mode* needs first and the key that makes it, or "" if nothing is missing."""
    if session.regions is None and mode is Mode.REGIONS:
        return "no regions yet: G finds some, or paint one on the mesh"
    if session.regions is None and mode is not Mode.HANDLES:
        return "no regions yet: G finds some, 1 to paint them"
    if not session.cages and mode in (Mode.CAGES, Mode.DEFORM):
        return "no cages yet: F fits them to the regions"
    if not session.handles and mode is Mode.DEFORM:
        return "nothing to drag yet: 3 to mark a handle"
    return ""


def hint(stage: Stage, mode: Mode) -> str:
    """Return what to do next in *mode*, and then."""
    lacking = missing(stage.session, mode)
    if lacking:
        return lacking
    if mode is Mode.DEFORM:
        return _of_drag(stage)
    now = "drag a vertex of a cage" if mode is Mode.CAGES else _of_painting(stage)
    then = _lead_on(stage, mode)
    return f"{now} · {then}" if then else now


def _of_painting(stage: Stage) -> str:
    selector = stage.selector
    if selector.paints is Paint.REGION:
        new = selector.region >= stage.n_regions
        name = stage.session.region_name(selector.region)
        what = brief(name, region_name((), selector.region)) + (" (new)" if new else "")
    elif selector.paints is Paint.FIXED:
        what = "what stays fixed"
    else:
        what = "a new handle" if selector.handle is None else selector.handle
    far = ", through the body" if selector.through else ""
    return f"{_TOOLS[selector.tool]} for {what}{far}, Ctrl takes away"


def _of_drag(stage: Stage) -> str:
    session = stage.session
    if session.is_dragging:
        return f"volume {signed(100.0 * session.volume_change, 2)} % · Esc takes it back"
    if not (session.options.preserve_volume or session.options.preserve_region_volumes):
        return "drag or turn a handle, the volume is free · P holds it"
    solution = session.solution
    if solution is not None and solution.status not in (Status.CONVERGED, Status.STEP_LIMIT):
        return str(solution.status)
    return "drag or turn a handle" + ("" if len(session.fixed) else " · 3, S for what stays")


def _lead_on(stage: Stage, mode: Mode) -> str:
    """Return the key that leads on from *mode*, once its own work is done."""
    session = stage.session
    if mode is Mode.HANDLES and stage.selector.paints is Paint.FIXED and not session.handles:
        return "then D for what is dragged"
    if mode is Mode.HANDLES and not session.handles:
        return "S for what stays"
    if session.regions is None:
        return "then G finds regions"
    if not session.cages:
        return "then F fits cages"
    return "then 4 to deform" if session.handles else "then 3 to mark handles"
