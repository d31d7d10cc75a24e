"""The section with the fixed vertices and the handles."""

from __future__ import annotations

from collections.abc import Sequence

from vtk_segdeform.pictures import FIXED, rgb

from ..editor import Action, Controller, DeformEditor, Mode, actions
from ..region_selector import Paint
from ..scene import handle_colour
from .fields import Cell, Column, Field, Row, Section, Table, as_rgb, key_button

_FIXED, _NEW, _HANDLE = "fixed", "new", "handle:"  # keys of rows; of a handle, before its name
_COLUMNS = Column("vertices", "Vertices"), Column("show", "Show"), Column("lock", "Lock")


def handles_section(editor: DeformEditor) -> Section:
    """Return the list of fixed vertices, handles, pins and pulled points."""
    session, widgets, mode = editor.session, editor.widgets, editor.mode
    rows, handle = _rows(editor), _selected(editor)
    exists = handle in session.handles
    return Section(
        "handles",
        "Handles",
        (
            Table(
                "handles.list",
                "Name",
                _COLUMNS,
                rows,
                "The selected row is painted in mode 3, a handle is dragged in mode 4. F2: rename. "
                "A locked handle cannot be grabbed, nor can a hidden one in mode 4",
                acts={
                    "select": _choosing,
                    "rename": _renaming,
                    "show": _showing,
                    "lock": lambda key, on: lambda c: c.widgets.dragger.set_locked(_name(key), on),
                },
            ),
            (
                key_button(
                    editor.keys,
                    "handles.new",
                    "new_handle",
                    "New",
                    visible=mode is Mode.HANDLES,
                ),
                key_button(
                    editor.keys, "handles.remove", "remove_handle", "Remove", enabled=exists
                ),
                Field(
                    "handles.convert",
                    "button",
                    "Make handle" if handle in widgets.puller.marked else "Make pin",
                    "A handle can be rotated; a pin or pulled point is a single vertex",
                    "convert_handle",
                    enabled=exists,
                    act=lambda _: _convert,
                ),
            ),
            Field(
                "handles.volume",
                "toggle",
                "Volume under a lid",
                "Lists the volume of this part of the surface, under a lid, in the section Volumes",
                value=handle in dict(session.state.parts),
                visible=exists and session.is_bound and mode is Mode.HANDLES,
                act=lambda on: _with_volume(str(handle), on),
            ),
            Field(
                "handles.slide",
                "toggle",
                "Fixed part slides in its plane",
                "Fixed vertices may move along the plane nearest to them, as a base on a plate",
                value=bool(session.state.slides),
                visible=(bool(session.state.slides) or len(session.fixed) > 0)
                and mode is Mode.HANDLES,
                act=lambda on: lambda controller: controller.session.slide_fixed(on),
            ),
            (
                Field(
                    "handles.local_axes",
                    "toggle",
                    "Local axes",
                    "The axes rotate with the handle",
                    "local_axes",
                    value=widgets.dragger.local,
                    visible=mode is Mode.DEFORM,
                    act=lambda _: actions.toggle_local_axes,
                ),
                Field(
                    "handles.pivot",
                    "button",
                    "Reset pivot",
                    "Rotate about the centre of the handle again. "
                    "Shift+drag on the ball moves the pivot",
                    "pivot",
                    visible=mode is Mode.DEFORM and handle in session.state.pivots,
                    act=lambda _: actions.reset_pivot,
                ),
            ),
        ),
        visible=bool(rows) or mode is not Mode.PULL,
    )


def _rows(editor: DeformEditor) -> tuple[Row, ...]:
    session, widgets, mode = editor.session, editor.widgets, editor.mode
    handle, rows = _selected(editor), []
    selector = widgets.selector
    is_painted = mode is Mode.HANDLES
    paints_fixed = is_painted and selector.paints is Paint.FIXED
    if is_painted or (len(session.fixed) and mode is not Mode.PULL):
        count = Cell(str(len(session.fixed)))
        rows.append(Row(_FIXED, "Fixed", as_rgb(rgb(FIXED)), (count, Cell(), Cell()), paints_fixed))
    for name, ids in session.handles.items():
        cells = (
            Cell(str(len(ids))),
            Cell(checked=name not in widgets.dragger.hidden),
            Cell(checked=name in widgets.dragger.locked),
        )
        colour = as_rgb(handle_colour(session, name))
        rows.append(Row(_HANDLE + name, name, colour, cells, name == handle, renamable=True))
    if is_painted and not paints_fixed and handle is None:
        colour = as_rgb(handle_colour(session, None))
        cells = Cell("0"), Cell(), Cell()
        rows.append(Row(_NEW, "New handle", colour, cells, selected=True))
    return tuple(rows)


def _selected(editor: DeformEditor | Controller) -> str | None:
    """Return the selected handle: the painted one, or the one with the gizmo."""
    if editor.mode is not Mode.HANDLES:
        return editor.widgets.dragger.handle
    selector = editor.widgets.selector
    is_one = selector.paints is Paint.HANDLE and selector.handle in editor.session.handles
    return selector.handle if is_one else None


def _choosing(keys: Sequence[str]) -> Action:
    def choose(controller: Controller) -> None:
        widgets, is_painted = controller.widgets, controller.mode is Mode.HANDLES
        for key in keys:
            if key.startswith(_HANDLE):
                widgets.selector.handle = widgets.dragger.handle = _name(key)
                if is_painted:
                    widgets.selector.paints = Paint.HANDLE
            elif key == _FIXED and is_painted:
                widgets.selector.paints = Paint.FIXED

    return choose


def _renaming(key: str, new_name: str) -> Action:
    name, new_name = _name(key), new_name.strip()

    def rename(controller: Controller) -> None:
        session, selector = controller.session, controller.widgets.selector
        was_pull = name in session.state.pulls
        session.handles.rename(name, new_name)
        if selector.handle == name:
            selector.handle = new_name
        is_handle = was_pull and new_name not in session.state.pulls
        remark = ", which is now a handle" if is_handle else ""
        controller.say(f"Renamed {name} to {new_name}{remark}")

    return rename


def _showing(key: str, on: bool) -> Action:
    def show(controller: Controller) -> None:
        controller.widgets.dragger.set_hidden(_name(key), not on)
        controller.widgets.show(controller.mode)

    return show


def _with_volume(name: str, on: bool) -> Action:
    """Return the action that makes the vertices of a handle a part with a volume, or no longer."""
    return lambda c: c.session.set_part(name, c.session.handles[name] if on else None)


def _convert(controller: Controller) -> None:
    name = _selected(controller)
    if name is not None:
        actions.converting(name)(controller)


def _name(key: str) -> str:
    return key.removeprefix(_HANDLE)
