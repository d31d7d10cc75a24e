"""The history of an editor: its states by name, jumps to them and previews of them."""

from __future__ import annotations

from .actions import Action
from .controller import Controller


def states_of(controller: Controller) -> tuple[str, ...]:
    """Return the names of all states, the oldest first: of each, the action that led to it."""
    return tuple(label[:1].upper() + label[1:] for label in controller.history.labels)


def jumping_to(position: int) -> Action:
    """Return the action that undoes or redoes as many steps as lead to the state at *position*."""

    def jump(controller: Controller) -> None:
        said = f"History: {states_of(controller)[position]}"
        controller.history.jump(position)
        controller.say(said)

    return jump


def preview(controller: Controller, position: int | None) -> None:
    """Show the pose at *position*, without changing the session, or end the preview with None.

    The current pose remains during a job, a gesture or refinement, and if the state is of another
    mesh, or its cages are no longer bound.
    """
    history, session, vertices, text = controller.history, controller.session, None, ""
    with controller.view.guarded(), controller.view.drawing_once():
        if position is not None and controller.is_free() and position != history.position:
            own = history.own(position)
            vertices = None if own is None else session.poses.peek(session.history.state_at(own))
            text = f"History: {states_of(controller)[position]}"
        controller.show_instead(vertices, text)
