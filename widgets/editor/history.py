"""The history of an editor: its states by name, jumps to them and previews of them."""

from __future__ import annotations

from vtk_segdeform.session import Session

from .actions import Action
from .controller import Controller


def states_of(session: Session) -> tuple[str, ...]:
    """Return the names of all states, the oldest first: of each, the action that led to it."""
    return tuple(label[:1].upper() + label[1:] for label in session.history.labels)


def jumping_to(position: int) -> Action:
    """Return the action that undoes or redoes as many steps as lead to the state at *position*."""

    def jump(controller: Controller) -> None:
        said = f"History: {states_of(controller.session)[position]}"
        controller.session.history.jump(position)
        controller.say(said)

    return jump


def preview(controller: Controller, position: int | None) -> None:
    """Show the pose at *position*, without changing the session, or end the preview with None.

    The current pose remains during a job, a gesture or refinement, and if the cages of the state
    are no longer bound.
    """
    session, vertices, text = controller.session, None, ""
    with controller.view.guarded(), controller.view.drawing_once():
        may_show = controller.is_free() and position != session.history.position
        if position is not None and may_show:
            vertices = session.poses.peek(session.history.state_at(position))
            text = f"History: {states_of(session)[position]}"
        controller.show_instead(vertices, text)
