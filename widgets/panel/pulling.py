"""The section with the settings of a pull, and the volume change."""

from __future__ import annotations

from ..editor import Action, Controller, DeformEditor, actions
from ..volume_overlay import percent
from .fields import Field, Section, key_button

_MOST_LIMBS = 9.0  # nested in each other, and more than any body has


def pull_section(editor: DeformEditor) -> Section:
    """Return the settings of a pull, and the volume change."""
    session, puller, keys = editor.session, editor.widgets.puller, editor.keys
    return Section(
        "pull",
        "Pull",
        (
            Field(
                "pull.radius",
                "number",
                "Radius",
                "Radius of the pulled surface, in % of the model's size (Shift+wheel)",
                value=100.0 * puller.radius / session.mesh.diagonal,
                minimum=0.5,
                maximum=100.0,
                decimals=1,
                unit="%",
                act=_with_radius,
            ),
            Field(
                "pull.limb",
                "integer",
                "Limb",
                "The limb under the pointer that moves: 1 is the smallest, such as a finger, "
                "larger ones end with the whole body",
                "larger_limb",
                value=None if puller.limb is None else puller.limb + 1,
                maximum=_MOST_LIMBS,
                special="Auto",
                act=lambda number: actions.assigning(
                    _puller, "limb", number - 1 if number else None
                ),
            ),
            Field(
                "pull.local",
                "slider",
                "Local",
                "How much of the surface stays in place: all of it follows at the left, "
                "only the surface near the pointer at the right",
                "more_local",
                value=round(100.0 * puller.effective_locality),
                maximum=100.0,
                unit="%",
                act=lambda share: _with_locality(0.01 * share),
            ),
            Field(
                "pull.hinge",
                "slider",
                "Hinge",
                "Where the pulled limb bends: along its length at the left, at its joint only at "
                "the right",
                "hinge",
                value=round(100.0 * puller.hinge),
                maximum=100.0,
                unit="%",
                act=lambda share: actions.assigning(_puller, "hinge", 0.01 * share),
            ),
            volume_label(editor, "pull.volume"),
            (
                Field(
                    "pull.auto",
                    "toggle",
                    "Auto local",
                    "0 between three pins or fixed vertices, otherwise mostly free",
                    "auto_locality",
                    value=puller.locality is None,
                    act=lambda on: _with_locality(None) if on else _not_auto,
                ),
                preserve_toggle(editor, "pull.preserve"),
            ),
            (
                key_button(keys, "pull.unpin", "remove_pins", visible=bool(puller.marked)),
                reset_button(editor, "pull.reset"),
            ),
        ),
    )


def volume_label(editor: DeformEditor, name: str) -> Field:
    """Return the field that shows the volume change of the mesh."""
    session = editor.session
    text = percent(session.volume_change) if session.has_volume else "No volume to preserve"
    tip = "Relative volume change of the whole mesh"
    return Field(name, "label", "Volume change", tip, value=text)


def preserve_toggle(editor: DeformEditor, name: str) -> Field:
    """Return the field that turns volume preservation on and off."""
    has_volume = editor.session.has_volume
    return Field(
        name,
        "toggle",
        "Preserve volume",
        "Preserve the enclosed volume exactly",
        "preserve_volume",
        value=editor.session.options.preserve_volume and has_volume,
        visible=has_volume,
        act=lambda _: actions.toggle_volume,
    )


def reset_button(editor: DeformEditor, name: str) -> Field:
    """Return the button that resets the pose."""
    is_posed = editor.session.state.pose is not None
    return key_button(editor.keys, name, "reset_pose", enabled=is_posed)


def _with_radius(percentage: float) -> Action:
    def resize(controller: Controller) -> None:
        controller.widgets.puller.radius = 0.01 * percentage * controller.session.mesh.diagonal

    return resize


def _with_locality(locality: float | None) -> Action:
    return actions.assigning(_puller, "locality", locality)


def _puller(controller: Controller) -> object:
    return controller.widgets.puller


def _not_auto(controller: Controller) -> None:
    puller = controller.widgets.puller
    puller.locality = puller.effective_locality
