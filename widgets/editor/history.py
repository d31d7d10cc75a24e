"""The history of an editor: its states by name, jumps to them and previews of them."""

from __future__ import annotations

from .actions import Action
from .controller import Controller


def states_of(controller: Controller) -> tuple[str, ...]:
    """Return the names of all states, the oldest first: of each, the action that led to it."""
    return tuple(label[:1].upper() + label[1:] for label in controller.history.labels)


def jumping_to(position: int) -> Action:
    """Return the action that undoes or redoes as many steps as lead to the state at *position*.

    A list may still have rows for a moment of states that an edit has dropped: they do nothing.
    """

    def jump(controller: Controller) -> None:
        names = states_of(controller)
        if position < len(names):
            controller.history.jump(position)
            controller.say(f"History: {names[position]}")

    return jump


def preview(controller: Controller, position: int | None) -> None:
    """Show the pose at *position*, without changing the session, or end the preview with None.

    The current pose remains during a job, a gesture or refinement, and if the state is of another
    mesh or dropped, or its cages are no longer bound.
    """
    history, session, vertices, text = controller.history, controller.session, None, ""
    with controller.view.guarded(), controller.view.drawing_once():
        names, here = states_of(controller), history.position
        is_other = position is not None and position != here and position < len(names)
        if position is not None and is_other and controller.is_free():
            own = history.own(position)
            vertices = None if own is None else session.poses.peek(session.history.state_at(own))
            text = f"History: {names[position]}"
        controller.show_instead(vertices, text)
