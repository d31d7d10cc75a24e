"""Menu entries for what is shown and for the camera: views, up axis, projection, cube."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..editor import (
    Action,
    DeformEditor,
    Mode,
    binding_of,
    frame_all,
    frame_selection,
    key_cap,
    looking_from,
    toggle_cube,
    toggle_projection,
    with_up,
)

_Test = Callable[[DeformEditor], bool]
# What is shown: the key of the entry, whether there is something to show, and whether it is shown.
_SHOWN: tuple[tuple[str, _Test, _Test | None], ...] = (
    ("w", lambda _: True, None),
    ("shift+g", lambda e: e.session.regions is not None, lambda e: e.widgets.regions_wanted),
    ("c", lambda e: bool(e.session.cages), lambda e: e.widgets.cages.is_shown),
    ("o", lambda _: True, lambda e: e.widgets.overlay_wanted),
    ("i", lambda _: True, None),
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

    def add(where: Any, text: str, action: Action, *, while_busy: bool = True) -> Any:
        def act() -> None:
            editor = editor_of()
            if editor is not None:
                editor.do(action, while_busy=while_busy)

        entry = where.addAction(text)
        entry.triggered.connect(act)
        return entry

    shown = []
    for key, exists, is_shown in _SHOWN:
        binding = binding_of(key, Mode.DEFORM)
        if binding is None or binding.action is None:
            raise ValueError(f"{key!r} has no action in mode 4")
        text = f"{binding.label}\t{key_cap(key)}"
        entry = add(menu, text, binding.action, while_busy=binding.while_busy)
        entry.setCheckable(is_shown is not None)
        shown.append((entry, exists, is_shown))
    menu.addSeparator()
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
        for entry, exists, is_shown in shown:
            entry.setEnabled(editor is not None and exists(editor))
            entry.setChecked(editor is not None and is_shown is not None and is_shown(editor))
        if editor is not None:
            up = editor.controller.camera.viewpoint.up
            for axis, entry in enumerate(axes):
                entry.setChecked(bool(up[axis] > 0.5))
            orthographic.setChecked(bool(editor.view.camera.GetParallelProjection()))
            cube.setChecked(editor.show_cube)

    menu.aboutToShow.connect(update)
