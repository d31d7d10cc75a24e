"""The history of an editor: its states by name, jumps to them and previews of them.

The first state is the session as it was opened.  If it came from another one, as a repaired mesh
does, that one is before it; a session that came from the current state follows it.
"""

from __future__ import annotations

from .actions import Action
from .controller import Controller

_OPENED = "Opened"


def states_of(controller: Controller) -> tuple[str, ...]:
    """Return the names of all states, the oldest first: of each, the action that led to it."""
    labels = controller.session.history
    if controller.earlier is not None:
        first = controller.earlier[0] if labels[0] == _OPENED.lower() else labels[0]
        labels = _OPENED, first, *labels[1:]
    if controller.next_session is not None:
        labels = *labels[: position_of(controller) + 1], controller.next_session[0]
    return tuple(label[:1].upper() + label[1:] for label in labels)


def position_of(controller: Controller) -> int:
    """Return the index of the current state in `states_of`."""
    return controller.session.position + _offset(controller)


def jumping_to(position: int) -> Action:
    """Return the action that undoes or redoes as many steps as lead to the state at *position*."""

    def jump(controller: Controller) -> None:
        session, earlier, following = (
            controller.session,
            controller.earlier,
            controller.next_session,
        )
        name = states_of(controller)[position]
        if following is not None and position > position_of(controller):
            following[1]()
        else:
            session.jump(max(position - _offset(controller), 0))
            if earlier is not None and position == 0:
                earlier[1]()
        controller.say(f"History: {name}")

    return jump


def preview(controller: Controller, position: int | None) -> None:
    """Show the pose at *position*, without changing the session, or end the preview with None.

    The current pose remains during a job, a gesture or refinement, and if the state is that before
    the session, or its cages are no longer bound.
    """
    with controller.view.guarded(), controller.view.drawing_once():
        vertices = None
        if position is not None and not _is_active(controller):
            place = position - _offset(controller)
            is_here = 0 <= place < len(controller.session.history)
            if is_here and place != controller.session.position:
                vertices = controller.session.vertices_at(place)
        if vertices is not None:
            assert position is not None
            controller.show_instead(vertices, f"History: {states_of(controller)[position]}")
        else:
            controller.show_instead(None)


def _offset(controller: Controller) -> int:
    return 0 if controller.earlier is None else 1


def _is_active(controller: Controller) -> bool:
    """Return whether anything runs that a preview would interrupt."""
    widgets = controller.widgets
    live = widgets.puller, widgets.dragger
    return (
        not controller.is_on
        or controller.is_busy
        or controller.session.is_dragging
        or widgets.puller.waiting.is_active
        or any(widget.is_grabbing for widget in widgets.interactive)
        or any(widget.is_refining for widget in live)
    )
