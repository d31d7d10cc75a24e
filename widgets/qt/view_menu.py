"""Menu entries for what is shown and for the camera: views, up axis, projection, cube."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from ..editor import (
    Action,
    DeformEditor,
    Keys,
    key_cap,
    keys_of,
    looking_from,
    toggle_cube,
    with_up,
)

_DEFAULT = keys_of("pyvista")
_Test = Callable[[DeformEditor], bool]
# The action of the entry, whether there is something to show, and whether it is shown.
_SHOWN: tuple[tuple[str, _Test, _Test | None], ...] = (
    ("style", lambda _: True, None),
    ("show_regions", lambda e: e.session.regions is not None, lambda e: e.widgets.regions_wanted),
    ("show_cages", lambda e: bool(e.session.cages), lambda e: e.widgets.cages.is_shown),
    ("show_volume_change", lambda _: True, lambda e: e.widgets.overlay_wanted),
    ("show_holes", lambda e: bool(e.controller.notices.text), None),
)
_VIEWS = (
    ("&Front", "view_front"),
    ("&Back", "view_back"),
    ("&Right", "view_right"),
    ("&Left", "view_left"),
    ("&Top", "view_top"),
    ("B&ottom", "view_bottom"),
    ("T&hree-quarter", "view_home"),
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
    with_keys: list[tuple[Any, str, str]] = []  # entry, text, name of the action

    def add(where: Any, text: str, action: Action | str) -> Any:
        """Add an entry for an action, or for one with keys, by its name."""

        def act() -> None:
            editor = editor_of()
            if editor is not None and isinstance(action, str):
                editor.run(action)
            elif editor is not None and not isinstance(action, str):
                editor.do(action, while_busy=True)

        entry = where.addAction(text)
        entry.triggered.connect(act)
        if isinstance(action, str):
            with_keys.append((entry, text, action))
        return entry

    shown = []
    for name, exists, is_shown in _SHOWN:
        entry = add(menu, _DEFAULT[name].label, name)
        entry.setCheckable(is_shown is not None)
        shown.append((entry, name, exists, is_shown))
    menu.addSeparator()
    entries = [
        add(menu, "&Fit to view", "frame_all"),
        add(menu, "Fit &selection", "frame_selection"),
    ]
    views, ups = menu.addMenu("Vie&wpoint"), menu.addMenu("&Up axis")
    for text, name in _VIEWS:
        add(views, text, name)
    add(views, "&Isometric", looking_from("iso"))
    axes = [add(ups, f"&{'XYZ'[axis]}", with_up(axis)) for axis in range(3)]
    orthographic = add(menu, "&Orthographic", "projection")
    cube = add(menu, "Orientation cu&be", toggle_cube)
    entries += [views, ups, orthographic, cube]
    for entry in (*axes, orthographic, cube):
        entry.setCheckable(True)

    def update() -> None:
        editor = editor_of()
        name_keys(with_keys, _DEFAULT if editor is None else editor.keys)
        for entry in entries:
            entry.setEnabled(editor is not None)
        for entry, name, exists, is_shown in shown:
            works = editor is not None and editor.mode in editor.keys[name].modes
            entry.setEnabled(works and editor is not None and exists(editor))
            entry.setChecked(editor is not None and is_shown is not None and is_shown(editor))
        if editor is not None:
            up = editor.controller.camera.viewpoint.up
            for axis, entry in enumerate(axes):
                entry.setChecked(bool(up[axis] > 0.5))
            orthographic.setChecked(bool(editor.view.camera.GetParallelProjection()))
            cube.setChecked(editor.show_cube)

    name_keys(with_keys, _DEFAULT)
    menu.aboutToShow.connect(update)


def name_keys(entries: Iterable[tuple[Any, str, str]], keys: Keys) -> None:
    """Show beside each entry the first key of its action; *entries* are (entry, text, action)."""
    for entry, text, action in entries:
        key = keys[action].keys[:1]
        entry.setText(f"{text}\t{key_cap(key[0])}" if key else text)
