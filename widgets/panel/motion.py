"""The section that moves, rotates and scales the active handle by numbers."""

from __future__ import annotations

from ..editor import DeformEditor
from .fields import Field, Section

_AXES = "xyz"
_FARTHEST, _LARGEST = 10.0, 3600.0  # in sizes of the mesh, and degrees
_LEAST_FACTOR = 0.01


def motion_section(editor: DeformEditor) -> Section:
    """Return the numbers of the active handle; a drag shows its own in them."""
    dragger, session = editor.widgets.dragger, editor.session
    name = dragger.handle
    is_there = name in session.handles and session.state.is_ready
    is_free = is_there and name not in dragger.hidden | dragger.locked
    can_turn = is_free and len(session.handles[str(name)]) > 1
    shift, angles = (dragger.shift, dragger.angles) if is_there else ((0.0,) * 3,) * 2
    decimals = 0
    while session.mesh.diagonal * 10.0**decimals < 200.0 and decimals < 12:
        decimals += 1
    moves = tuple(
        Field(
            f"motion.move_{axis}",
            "number",
            f"Move {axis}",
            f"Distance of the handle from rest along {axis}, in the unit of the mesh",
            value=float(shift[k]),
            enabled=is_free,
            minimum=-_FARTHEST * session.mesh.diagonal,
            maximum=_FARTHEST * session.mesh.diagonal,
            step=10.0 ** (1 - decimals),
            decimals=decimals,
            prefix=axis,
            act=lambda amount, k=k: lambda c: c.widgets.dragger.shift_to(k, amount),  # type: ignore[misc]
        )
        for k, axis in enumerate(_AXES)
    )
    turns = tuple(
        Field(
            f"motion.rotate_{axis}",
            "number",
            f"Rotate {axis}",
            f"Rotates the handle about {axis} through its pivot, by so many degrees from now",
            value=float(angles[k]),
            enabled=can_turn,
            minimum=-_LARGEST,
            maximum=_LARGEST,
            step=5.0,
            decimals=1,
            prefix=axis,
            unit="°",
            act=lambda degrees, k=k: lambda c: c.widgets.dragger.rotate(k, degrees),  # type: ignore[misc]
        )
        for k, axis in enumerate(_AXES)
    )
    return Section(
        "motion",
        "Move and rotate by numbers",
        (
            moves,
            turns,
            Field(
                "motion.scale",
                "number",
                "Scale by",
                "Scales the handle about its pivot, by a factor from now",
                value=1.0,
                enabled=can_turn,
                minimum=_LEAST_FACTOR,
                maximum=1.0 / _LEAST_FACTOR,
                step=0.1,
                decimals=2,
                act=lambda factor: lambda c: c.widgets.dragger.scale(factor),
            ),
        ),
        visible=is_there,
    )
