"""The menu of the right button: what can be done with the place that was clicked."""

from __future__ import annotations

from ..editor import Action, DeformEditor, actions
from .fields import Field
from .regions import stiffening, stiffness_of
from .toolbar import view_entries


def menu(editor: DeformEditor) -> tuple[Field | None, ...]:
    """Return the entries for what the last right click was on; beside the mesh, about the view."""
    spot, session, widgets = editor.controller.spot, editor.session, editor.widgets
    if spot is None:
        return view_entries(editor)
    region, handle, is_posed = spot.region, spot.handle, session.state.pose is not None
    part = "" if region is None else f"region {region}"
    name = "this part" if region is None else session.painting.name(region)
    has_volume = part in session.volume_names
    is_rigid = region is not None and stiffness_of(session, [region]) == "inf"
    is_fixed = spot.vertex in session.fixed
    lock: tuple[Field, ...] = ()
    if handle is not None:
        lock = (
            Field(
                "menu.lock",
                "toggle",
                f"Lock {handle}",
                "A locked handle cannot be grabbed",
                value=handle in widgets.dragger.locked,
                act=lambda on: lambda c: c.widgets.dragger.set_locked(handle, on),
            ),
        )
    return (
        Field(
            "menu.reset",
            "button",
            f"Reset {name}",
            "Moves it back to rest, while the others follow",
            enabled=is_posed and region is not None,
            act=lambda _: actions.resetting(region or 0),
        ),
        Field("menu.reset_pose", "button", "Reset pose", action="reset_pose", enabled=is_posed),
        None,
        Field(
            "menu.pin",
            "button",
            "Pin this point" if handle is None else f"Remove {handle}",
            "A pin keeps the surface in its place",
            enabled=not is_fixed,
            act=lambda _: actions.pinning(spot.vertex),
        ),
        *lock,
        Field(
            "menu.rigid",
            "toggle",
            f"Make {name} rigid",
            "A rigid part keeps its shape from the next move",
            value=is_rigid,
            enabled=region is not None,
            act=lambda on: _stiffen(region or 0, rigid=on),
        ),
        Field(
            "menu.keep",
            "toggle",
            f"Keep volume of {name}",
            value=has_volume and widgets.keeps(part),
            enabled=has_volume,
            act=lambda _: actions.keeping(part),
        ),
        Field(
            "menu.grow",
            "button",
            f"Enlarge {name} by 20 %",
            enabled=has_volume,
            act=lambda _: actions.growing(part),
        ),
        None,
        Field(
            "menu.isolate",
            "toggle",
            f"Isolate {name}",
            "Hides everything else, until it is chosen again",
            "isolate",
            value=widgets.surface.only is not None,
            act=lambda _: actions.isolating(spot),
        ),
        Field(
            "menu.frame",
            "button",
            f"Frame {name}",
            while_busy=True,
            act=lambda _: actions.framing(spot),
        ),
    )


def _stiffen(region: int, *, rigid: bool) -> Action:
    return stiffening([region], "inf" if rigid else "1")
