"""The section with the saved poses: to save one, return to one, and blend two."""

from __future__ import annotations

from weakref import WeakKeyDictionary

from vtk_segdeform.pictures import BODY, rgb
from vtk_segdeform.session import blend_label

from ..editor import Action, Controller, DeformEditor, actions
from .fields import Field, Row, Section, Table, as_rgb
from .thumbnails import thumbnail

_REST = "rest"  # the choice of the rest pose; of others "pose:NAME"
_LIVE = 20_000  # vertices up to which the mesh follows the slider; of more, when it is released
_ends: WeakKeyDictionary[Controller, tuple[str | None, str | None, float]] = WeakKeyDictionary()


def poses_section(editor: DeformEditor) -> Section:
    """Return the list of saved poses, and the slider between two of them."""
    session, saved = editor.session, editor.session.saved_poses
    pose = session.state.pose
    first, second, share = _ends_of(editor)
    label = blend_label(first, second)
    is_blend = session.history.undo_label == label
    same_cages = all(saved.has_cages(name) for name in (first, second) if name is not None)
    choices = (("Rest", _REST), *((name, _choice(name)) for name in saved))
    shown = None if pose is None else pose.cage_vertices
    rows = tuple(
        Row(
            name,
            name,
            as_rgb(rgb(BODY)),
            selected=(None if each.pose is None else each.pose.cage_vertices) is shown,
            renamable=True,
            picture=thumbnail(editor, name),
        )
        for name, each in saved.items()
    )
    chosen = next((row.key for row in rows if row.selected), None)
    return Section(
        "poses",
        "Poses",
        (
            Table(
                "poses.list",
                "Saved pose",
                (),
                rows,
                "Select a pose to return to it. F2: rename",
                n_rows=3,
                visible=bool(saved),
                acts={
                    "select": lambda keys: actions.going_to(next(iter(keys), "")),
                    "rename": lambda key, name: lambda c: c.session.saved_poses.rename(key, name),
                },
            ),
            (
                Field(
                    "poses.save",
                    "button",
                    "Save pose",
                    "Keeps the current pose by a name, in the session file as well",
                    enabled=session.is_bound,
                    visible=bool(saved) or pose is not None,
                    act=lambda _: actions.once_settled(actions.save_pose),
                ),
                Field(
                    "poses.remove",
                    "button",
                    "Forget pose",
                    "Removes the selected pose from the list",
                    enabled=chosen is not None,
                    visible=bool(saved),
                    act=lambda _: lambda c: c.session.saved_poses.remove(str(chosen)),
                ),
                Field(
                    "poses.copy",
                    "file",
                    "Copy poses ...",
                    "Takes the poses of a session of a mesh with the same faces",
                    suffixes=(".segdeform",),
                    act=actions.copying_poses,
                ),
            ),
            Field(
                "poses.first",
                "choice",
                "From",
                "The pose at the left end of the slider",
                value=_choice(first),
                choices=choices,
                visible=bool(saved),
                act=lambda choice: _choosing((_name(choice), second, 0.0)),
            ),
            Field(
                "poses.second",
                "choice",
                "To",
                "The pose at the right end of the slider",
                value=_choice(second),
                choices=choices,
                visible=bool(saved),
                act=lambda choice: _choosing((first, _name(choice), 0.0)),
            ),
            Field(
                "poses.share",
                "slider",
                "Blend",
                "A pose between the two: handles are interpolated, and the mesh is solved for",
                value=share if is_blend else 0.0,
                maximum=100.0,
                unit="%",
                enabled=first != second and same_cages and bool(session.handles),
                visible=bool(saved),
                on_release=session.mesh.n_vertices > _LIVE,
                act=lambda share: _blending(first, second, share),
            ),
        ),
    )


def _ends_of(editor: DeformEditor) -> tuple[str | None, str | None, float]:
    """Return the names of the poses to blend, and the share of the second one in per cent."""
    names = (None, *editor.session.saved_poses)
    first, second, share = _ends.get(editor.controller, (None, names[-1], 0.0))
    return first if first in names else None, second if second in names else names[-1], share


def _choosing(ends: tuple[str | None, str | None, float]) -> Action:
    def choose(controller: Controller) -> None:
        _ends[controller] = ends

    return choose


def _blending(first: str | None, second: str | None, share: float) -> Action:
    def blend(controller: Controller) -> None:
        _ends[controller] = first, second, share
        actions.blending(first, second, 0.01 * share)(controller)

    return blend


def _choice(name: str | None) -> str:
    return _REST if name is None else f"pose:{name}"


def _name(choice: str) -> str | None:
    return None if choice == _REST else choice.removeprefix("pose:")
