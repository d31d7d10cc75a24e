"""The section with the landmarks: their targets and residuals, files, and the fit to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from vtk_segdeform.arrays import FloatArray
from vtk_segdeform.pictures import COLOURS, rgb
from vtk_segdeform.session import SessionLandmarks

from ..editor import Action, Controller, DeformEditor, actions
from .fields import Cell, Column, Field, Row, Section, Table, as_rgb

_AXES = "xyz"
_MOST_LISTED = 100  # rows
_FARTHEST = 100.0  # mesh diagonals from the origin, of a number that is typed
_LEAST = 3  # pairs of a fit
_keeps: WeakKeyDictionary[Controller, bool] = WeakKeyDictionary()


def landmarks_section(editor: DeformEditor) -> Section:
    """Return the list of landmarks, the target of the selected one, and the fit to them."""
    session, marks, keys = editor.session, editor.session.landmarks, editor.widgets.landmarks
    chosen, is_kept = keys.chosen, _keeps.get(editor.controller, False)
    residuals = marks.residuals if len(marks) else np.empty(0)
    known, decimals = residuals[np.isfinite(residuals)], _decimals(session.mesh.diagonal)
    return Section(
        "landmarks",
        "Landmarks",
        (
            Table(
                "landmarks.list",
                "Landmark",
                (Column("residual", "Off by", "Distance from its target, in the mesh's unit"),),
                _rows(marks, [f"{each:.{decimals + 1}f}" for each in residuals], chosen),
                "Dots are landmarks, rings their targets, which can be dragged. F2: rename",
                n_rows=4,
                visible=len(marks) > 0,
                acts={
                    "select": lambda names: _choosing(next(iter(names), "")),
                    "rename": lambda key, name: lambda c: _rename(c, key, name.strip()),
                },
            ),
            Field(
                "landmarks.off",
                "label",
                "Off by",
                "Root mean square and largest distance of landmarks from their targets, in the "
                "mesh's unit",
                value=_summary(marks, residuals, decimals + 1),
                visible=len(marks) > 0,
            ),
            _target(editor, chosen),
            (
                Field(
                    "landmarks.adds",
                    "toggle",
                    "Add by clicks",
                    "A press on the surface adds a landmark, and a drag from there leads to its "
                    "target",
                    "add_landmarks",
                    value=keys.adds,
                    act=lambda _: actions.toggle_landmarks,
                ),
                Field(
                    "landmarks.shown",
                    "toggle",
                    "Show",
                    "Show landmarks and their targets",
                    value=not keys.is_hidden,
                    visible=len(marks) > 0,
                    act=lambda on: lambda c: setattr(c.widgets.landmarks, "is_hidden", not on),
                ),
            ),
            _files(
                Field(
                    "landmarks.{}",
                    "file",
                    "Load{} ...",
                    "Reads them from a file: {} by their names",
                    suffixes=tuple(sorted(SessionLandmarks.SUFFIXES)),
                ),
                actions.loading_landmarks,
            ),
            _files(
                Field(
                    "landmarks.save_{}",
                    "file",
                    "Save{} ...",
                    "Writes {} as .csv",
                    visible=len(marks) > 0,
                    suffixes=(".csv",),
                    saves=True,
                ),
                actions.saving_landmarks,
            ),
            Field(
                "landmarks.keep",
                "toggle",
                "Keep volume",
                "The fit keeps the volume; otherwise the body may grow",
                value=is_kept and session.has_volume,
                visible=session.has_volume and len(marks) > 0,
                act=lambda on: lambda c: _keeps.__setitem__(c, on),
            ),
            (
                Field(
                    "landmarks.fit",
                    "button",
                    "Fit",
                    "Lets the mesh grow and bend to where its landmarks are at their targets",
                    enabled=len(known) >= _LEAST,
                    visible=len(marks) > 0,
                    act=lambda _: actions.fitting_landmarks(keep_volume=is_kept),
                ),
                Field(
                    "landmarks.remove",
                    "button",
                    "Remove",
                    "Removes the selected landmark",
                    enabled=bool(chosen),
                    visible=len(marks) > 0,
                    act=lambda _: lambda c: c.session.landmarks.remove(chosen),
                ),
            ),
        ),
        advice="To fit the mesh to known points",
    )


def _rows(marks: SessionLandmarks, residuals: Sequence[str], chosen: str) -> tuple[Row, ...]:
    """Return a row for each of the first landmarks, and of the selected one."""
    colour, names = as_rgb(rgb(COLOURS[5])), list(marks)
    listed = [k for k, name in enumerate(names) if k < _MOST_LISTED or name == chosen]
    rows = []
    for k in listed:
        source, target = marks[names[k]]
        lacks = "no point" if np.isnan(source).any() else "no target"
        text = lacks if np.isnan(source + target).any() else residuals[k]
        is_chosen = names[k] == chosen
        rows.append(Row(names[k], names[k], colour, (Cell(text),), is_chosen, renamable=True))
    return tuple(rows)


def _summary(marks: SessionLandmarks, residuals: FloatArray, decimals: int) -> str:
    known = np.flatnonzero(np.isfinite(residuals))
    if not len(known):
        return "No targets yet"
    off = residuals[known]
    worst, more = list(marks)[known[off.argmax()]], ""
    if len(marks) > _MOST_LISTED:
        more = f" ({len(marks) - _MOST_LISTED:,} not listed)"
    mean, most = (f"{each:.{decimals}f}" for each in (np.sqrt(np.mean(off**2)), off.max()))
    return f"{mean}, at most {most}: {worst[:20]}{more}"


def _target(editor: DeformEditor, chosen: str) -> tuple[Field, ...]:
    """Return the coordinates of the target of the selected landmark."""
    session, decimals = editor.session, _decimals(editor.session.mesh.diagonal)
    target = session.landmarks[chosen][1] if chosen else np.zeros(3)
    return tuple(
        Field(
            f"landmarks.{axis}",
            "number",
            f"Target {axis}",
            f"Coordinate {axis} of the target of the selected landmark",
            value=float(np.nan_to_num(target[k])),
            enabled=bool(chosen),
            visible=len(session.landmarks) > 0,
            minimum=-_FARTHEST * session.mesh.diagonal,
            maximum=_FARTHEST * session.mesh.diagonal,
            step=10.0 ** (1 - decimals),
            decimals=decimals,
            prefix=axis,
            act=lambda value, k=k: lambda c: _move(c, chosen, k, value),  # type: ignore[misc]
        )
        for k, axis in enumerate(_AXES)
    )


def _decimals(size: float) -> int:
    """Return the decimals of coordinates, for steps of less than a thousandth of *size*."""
    return int(np.clip(np.ceil(3.0 - np.log10(size)), 0, 12))


def _files(field: Field, action: Callable[..., Action]) -> tuple[Field, Field]:
    """Return *field* for the landmarks, and for their targets, with *action* for the path."""
    kinds = ("source", "", "landmarks, at rest,"), ("target", " targets", "targets")
    own, targets = (
        replace(
            field,
            name=field.name.format(kind),
            label=field.label.format(label),
            tip=field.tip.format(what),
            act=partial(action, targets=kind == "target"),
        )
        for kind, label, what in kinds
    )
    return own, targets


def _choosing(name: str) -> Action:
    return lambda controller: setattr(controller.widgets.landmarks, "chosen", name)


def _rename(controller: Controller, name: str, new_name: str) -> None:
    controller.session.landmarks.rename(name, new_name)
    controller.widgets.landmarks.chosen = new_name


def _move(controller: Controller, name: str, axis: int, value: float) -> None:
    """Move the target of a landmark along an axis, from its point if it has none; as one step."""
    source, target = controller.session.landmarks[name]
    place = np.array(source if np.isnan(target).any() else target)
    place[axis] = value
    controller.session.landmarks.move(name, np.nan_to_num(place))
    controller.session.commit(f"move target of {name}", join=True)
