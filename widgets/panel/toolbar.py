"""The toolbar: files, undo and redo, the modes, the volume of a part, what is shown, and help."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..editor import Controller, DeformEditor, Mode, actions, keys_of
from .fields import Act, Field, key_button

_Test = Callable[[DeformEditor], bool]
_DEFAULT = keys_of("pyvista")
# The action of an entry, whether there is something to show, and whether it is shown.
_SHOWN: tuple[tuple[str, _Test, _Test | None], ...] = (
    ("style", lambda _: True, None),
    ("show_regions", lambda e: e.session.regions is not None, lambda e: e.widgets.regions_wanted),
    ("show_cages", lambda e: bool(e.session.cages), lambda e: e.widgets.cages.is_shown),
    ("show_volume_change", lambda _: True, lambda e: e.widgets.overlay_wanted),
    (
        "isolate",
        lambda e: e.widgets.surface.only is not None,
        lambda e: e.widgets.surface.only is not None,
    ),
    ("show_holes", lambda e: bool(e.controller.notices.text), None),
)
_VIEWS = ("front", "back", "right", "left", "top", "bottom")


def toolbar(editor: DeformEditor) -> tuple[Field, ...]:
    """Return the buttons of the toolbar of *editor*, group by group."""
    keys, controller, is_free = editor.keys, editor.controller, not editor.is_busy
    files = [
        Field("open", "file", "Open", "Open a mesh or a session", "open", enabled=is_free),
        Field(
            "save",
            "menu",
            "Save",
            "Save the session or the deformed mesh",
            "save",
            enabled=is_free,
            items=(
                Field("save.session", "file", "Save session"),
                Field("save.session_as", "file", "Save session as ..."),
                Field("save.mesh_as", "file", "Save mesh as ..."),
                Field(
                    "save.displacement",
                    "toggle",
                    "Meshes with displacement",
                    "Saved meshes get a point array, displacement: how far each point has moved",
                    value=controller.displacement is not None,
                    act=lambda on: actions.saving_displacement("displacement" if on else None),
                ),
            ),
        ),
        _step("undo", controller.history.undo_label, is_free=is_free),
        _step("redo", controller.history.redo_label, is_free=is_free),
    ]
    modes = [
        key_button(
            keys,
            f"mode.{mode.name.lower()}",
            mode.name.lower(),
            mode.name.title(),
            value=editor.mode is mode,
            enabled=is_free,
            icon=mode.name.lower(),
            group="modes",
        )
        for mode in Mode
    ]
    has_part = is_free and editor.mode in (Mode.PULL, Mode.DEFORM) and editor.session.is_bound
    part = editor.widgets.part if has_part else None
    others = [
        key_button(
            keys,
            "keep_part",
            "keep_part",
            "Keep part",
            enabled=part is not None,
            act=lambda _: actions.keeping(part),
        ),
        Field(
            "compare",
            "hold",
            "Before/After",
            "Show the mesh at rest: a click until the next one, a longer press while it is held",
            "before_after",
            value=controller.shows_rest,
            enabled=is_free and editor.session.state.pose is not None,
            while_busy=True,
            act=lambda held: lambda controller: controller.hold_rest(held),
        ),
        Field("view", "menu", "View", "What is shown", enabled=is_free, items=view_entries(editor)),
        Field("help", "button", "Keys", "Show keys", "help", while_busy=True),
    ]
    return tuple(
        replace(each, icon=each.icon or each.name, group=group)
        for group, fields in (("files", files), ("modes", modes), ("others", others))
        for each in fields
    )


def view_entries(editor: DeformEditor | None) -> tuple[Field | None, ...]:
    """Return the entries of the menu about the view; without an editor, all are disabled."""
    views = [_camera(editor, each, each.capitalize(), f"view_{each}") for each in _VIEWS]
    views.append(_camera(editor, "home", "Three-quarter", "view_home"))
    views.append(_camera(editor, "iso", "Isometric", act=lambda _: actions.looking_from("iso")))
    ups = [
        _camera(editor, f"up_{name}", f"Up: {name.upper()}", act=_upright(axis), shows=_is_up(axis))
        for axis, name in enumerate("xyz")
    ]
    return (
        *(_shown(editor, *each) for each in _SHOWN),
        None,
        _camera(editor, "frame_all", "Fit to view", "frame_all"),
        _camera(editor, "frame_selection", "Fit selection", "frame_selection"),
        replace(_camera(editor, "viewpoint", "Viewpoint"), kind="menu", items=tuple(views)),
        None,
        *ups,
        None,
        _camera(
            editor,
            "orthographic",
            "Orthographic",
            "projection",
            shows=lambda e: bool(e.view.camera.GetParallelProjection()),
        ),
        _camera(
            editor,
            "cube",
            "Orientation cube",
            act=lambda _: _toggle_cube,
            shows=lambda e: e.show_cube,
        ),
    )


def _shown(
    editor: DeformEditor | None, action: str, exists: _Test, is_shown: _Test | None
) -> Field:
    """Return the entry of an *action* that shows or hides something."""
    binding = (_DEFAULT if editor is None else editor.keys)[action]
    return Field(
        f"view.{action}",
        "button" if is_shown is None else "toggle",
        binding.label,
        action=action,
        value=None if is_shown is None else editor is not None and is_shown(editor),
        enabled=editor is not None and editor.mode in binding.modes and exists(editor),
    )


def _camera(
    editor: DeformEditor | None,
    name: str,
    label: str,
    action: str = "",
    *,
    act: Act | None = None,
    shows: _Test | None = None,
) -> Field:
    """Return an entry that moves the camera, during a job and a drag, too."""
    return Field(
        f"view.{name}",
        "button" if shows is None else "toggle",
        label,
        action=action,
        value=None if shows is None else editor is not None and shows(editor),
        enabled=editor is not None,
        while_busy=True,
        act=act,
    )


def _upright(axis: int) -> Act:
    return lambda _: actions.turning_up(axis)


def _toggle_cube(controller: Controller) -> None:
    cube = controller.camera.cube
    if cube.is_shown:
        cube.hide()
    else:
        cube.show()


def _is_up(axis: int) -> _Test:
    return lambda editor: bool(editor.controller.camera.viewpoint.up[axis] > 0.5)


def _step(verb: str, label: str | None, *, is_free: bool) -> Field:
    """Return the button that undoes or redoes the step with a *label*, if there is one."""
    name = verb.capitalize()
    if not label:
        return Field(verb, "button", name, f"Nothing to {verb}", enabled=False)
    return Field(verb, "button", name, f"{name}: {label}", verb, enabled=is_free)
