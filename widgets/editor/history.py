"""The history of an editor: its states by name, jumps to them and previews of them.

The first state is the session as it was opened.  If it came from another one, as a repaired mesh
does, the states of that one are before it; those of a session that came from it follow.
"""

from __future__ import annotations

from .actions import Action
from .controller import Controller


def states_of(controller: Controller) -> tuple[str, ...]:
    """Return the names of all states, the oldest first: of each, the action that led to it."""
    session, neighbours = controller.session, controller.neighbours
    labels, before, after = session.history.labels, neighbours.before, neighbours.after(session)
    earlier: tuple[str, ...] = ()
    if before is not None:
        is_whole = labels[0] == "opened"  # otherwise its first steps were discarded
        earlier, labels = before.names, (before.step if is_whole else labels[0], *labels[1:])
    names = tuple(label[:1].upper() + label[1:] for label in labels)
    if after is not None:
        position, following = after
        names = *names[: position + 1], following.step.capitalize(), *following.names
    return *earlier, *names


def position_of(controller: Controller) -> int:
    """Return the index of the current state in `states_of`."""
    return controller.neighbours.count_before + controller.session.history.position


def jumping_to(position: int, message: str = "") -> Action:
    """Return the action that undoes or redoes as many steps as lead to the state at *position*.

    It says the *message*, by default the name of the state.
    """

    def jump(controller: Controller) -> None:
        session, neighbours = controller.session, controller.neighbours
        before, after = neighbours.before, neighbours.after(session)
        said = message or f"History: {states_of(controller)[position]}"
        place = position - neighbours.count_before
        if after is not None and place > after[0]:
            session.history.jump(after[0])
            after[1].enter(position, said)
        else:
            session.history.jump(max(place, 0))
            if before is not None and place < 0:
                before.enter(position, said)
        controller.say(said)

    return jump


def preview(controller: Controller, position: int | None) -> None:
    """Show the pose at *position*, without changing the session, or end the preview with None.

    The current pose remains during a job, a gesture or refinement, and if the state is that before
    the session, or its cages are no longer bound.
    """
    with controller.view.guarded(), controller.view.drawing_once():
        vertices = None
        if position is not None and not _is_active(controller):
            place = position - controller.neighbours.count_before
            session = controller.session
            after = controller.neighbours.after(session)
            last = len(session.history.labels) - 1 if after is None else after[0]
            if 0 <= place <= last and place != session.history.position:
                vertices = session.poses.peek(session.history.state_at(place))
        if vertices is not None:
            assert position is not None
            controller.show_instead(vertices, f"History: {states_of(controller)[position]}")
        else:
            controller.show_instead(None)


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
