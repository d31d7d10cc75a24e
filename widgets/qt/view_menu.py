"""Menu entries for the camera: framing, named views, up axis, projection, orientation cube."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..editor import (
    Action,
    DeformEditor,
    frame_all,
    frame_selection,
    looking_from,
    toggle_cube,
    toggle_projection,
    with_up,
)

_VIEWS = (
    ("&Front\tNum 1", "front"),
    ("&Back\tCtrl+Num 1", "back"),
    ("&Right\tNum 3", "right"),
    ("&Left\tCtrl+Num 3", "left"),
    ("&Top\tNum 7", "top"),
    ("B&ottom\tCtrl+Num 7", "bottom"),
    ("T&hree-quarter\tNum 0", "home"),
    ("&Isometric", "iso"),
)


def add_view_entries(menu: Any, editor_of: Callable[[], DeformEditor | None]) -> None:
    """Add the entries to a QMenu.

    Parameters
    ----------
    menu : QMenu
        Where to add them.
    editor_of : callable
        Returns the editor to control; without one, the entries are disabled.
    """

    def add(where: Any, text: str, action: Action) -> Any:
        def act() -> None:
            editor = editor_of()
            if editor is not None:
                editor.do(action, while_busy=True)

        entry = where.addAction(text)
        entry.triggered.connect(act)
        return entry

    entries = [
        add(menu, "&Fit to view\t,", frame_all),
        add(menu, "Fit &selection\t.", frame_selection),
    ]
    views, ups = menu.addMenu("Vie&wpoint"), menu.addMenu("&Up axis")
    for text, name in _VIEWS:
        add(views, text, looking_from(name))
    axes = [add(ups, f"&{'XYZ'[axis]}", with_up(axis)) for axis in range(3)]
    orthographic = add(menu, "&Orthographic\tNum 5", toggle_projection)
    cube = add(menu, "Orientation cu&be", toggle_cube)
    entries += [views, ups, orthographic, cube]
    for entry in (*axes, orthographic, cube):
        entry.setCheckable(True)

    def update() -> None:
        editor = editor_of()
        for entry in entries:
            entry.setEnabled(editor is not None)
        if editor is not None:
            up = editor.controller.camera.viewpoint.up
            for axis, entry in enumerate(axes):
                entry.setChecked(bool(up[axis] > 0.5))
            orthographic.setChecked(bool(editor.view.camera.GetParallelProjection()))
            cube.setChecked(editor.show_cube)

    menu.aboutToShow.connect(update)
