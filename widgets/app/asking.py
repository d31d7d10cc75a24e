"""What the window asks and tells in boxes of its own."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from .autosave import Autosaves, Slot

Qt = QtCore.Qt
MESHES = "*.ply *.obj *.off *.stl *.vtk *.vtp *.vtkhdf"
_READ = f"Meshes and sessions (*.segdeform {MESHES} *.vtu *.glb *.gltf);;All files (*)"


class Answer(enum.Enum):
    """What to do with work that is not saved."""

    SAVE = enum.auto()
    DISCARD = enum.auto()
    CANCEL = enum.auto()
    RECOVER = enum.auto()
    LATER = enum.auto()


def ask_file(parent: Any, folder: Path) -> Path | None:
    """Ask for a mesh or a session that is there; begin to look in *folder*."""
    name, _ = QtWidgets.QFileDialog.getOpenFileName(parent, "Open", str(folder), _READ)
    return Path(name) if name else None


def ask_save(parent: Any, name: str, *, mesh_is_saved: bool) -> Answer:
    """Ask what to do with changes of what is called *name*."""
    what = "Its regions, cages and handles are" if mesh_is_saved else "What was done is"
    return _ask(
        parent,
        f"Save the changes to {name}?",
        f"{what} lost otherwise. A session keeps everything; open it to go on.",
        {Answer.SAVE: "Save", Answer.DISCARD: "Discard", Answer.CANCEL: "Cancel"},
    )


def choose_work(parent: Any, autosaves: Autosaves) -> Slot | None:
    """Return the unsaved work that somebody wants to go on with, of all that crashes have left.

    What nobody wants is deleted; what is wanted later stays, and so does what is after the first.
    """
    chosen, left = None, autosaves.left()
    for number, slot in enumerate(left, 1):
        answer = Answer.LATER
        if chosen is None:
            answer = ask_recover(parent, slot, datetime.now(), others=len(left) - number)
        if answer is Answer.RECOVER:
            chosen = slot
        elif answer is Answer.DISCARD:
            slot.remove()
        else:
            slot.release()
    return chosen


def ask_recover(parent: Any, slot: Slot, now: datetime, *, others: int = 0) -> Answer:
    """Ask what to do with work that a crash has left; *others* are asked about afterwards."""
    more = f" There is more after this: {others}." if others else ""
    return _ask(
        parent,
        f"Recover unsaved work on {slot.about.name} from {moment(slot.when, now)}?",
        f"The program ended before it was saved.{more}",
        {Answer.RECOVER: "Recover", Answer.DISCARD: "Discard", Answer.LATER: "Later"},
    )


def ask_replace(parent: Any, name: str) -> bool:
    """Ask whether a file may be replaced."""
    answers = {Answer.SAVE: "Replace", Answer.CANCEL: "Cancel"}
    text = f"Replace {name}?"
    return _ask(parent, text, "There is such a file already.", answers) is Answer.SAVE


def tell_failure(parent: Any, title: str, text: str) -> None:
    """Tell what went wrong, until it is read."""
    box = _box(parent, QtWidgets.QMessageBox.Icon.Warning, title, text)
    box.addButton(QtWidgets.QMessageBox.StandardButton.Ok)
    _run(box)


def tell_about(parent: Any, version: str) -> None:
    """Tell what this program is."""
    box = _box(
        parent,
        QtWidgets.QMessageBox.Icon.NoIcon,
        f"vtk_segdeform {version}",
        "Bends a dense closed mesh by a few of its vertices; its detail turns along, and its "
        "volume stays exactly what it was.\n\nAfter K. Doba and H. Masuda, Rapid Mesh Deformation "
        "with Non-linear Constraints Using Segmentation.\n\nBSD-3-Clause.",
    )
    box.addButton(QtWidgets.QMessageBox.StandardButton.Ok)
    _run(box)


def moment(when: datetime, now: datetime) -> str:
    """Return *when* as people say it: the time, and the day if it is another.

    >>> moment(datetime(2026, 3, 1, 11, 42), datetime(2026, 3, 1, 18, 0))
    '11:42'
    >>> moment(datetime(2026, 2, 28, 9, 5), datetime(2026, 3, 1, 18, 0))
    '28 February 2026, 09:05'
    """
    time = when.strftime("%H:%M")
    if when.date() == now.date():
        return time
    return f"{when.day} {when.strftime('%B %Y')}, {time}"


_ROLES = {
    Answer.SAVE: "AcceptRole",
    Answer.RECOVER: "AcceptRole",
    Answer.DISCARD: "DestructiveRole",
    Answer.CANCEL: "RejectRole",
    Answer.LATER: "RejectRole",
}


def _ask(parent: Any, text: str, more: str, answers: Mapping[Answer, str]) -> Answer:
    """Return the answer; the first is Enter's, the last is Escape's, and that of closing."""
    box = _box(parent, QtWidgets.QMessageBox.Icon.Question, text, more)
    roles = QtWidgets.QMessageBox.ButtonRole
    buttons = {
        box.addButton(label, getattr(roles, _ROLES[answer])): answer
        for answer, label in answers.items()
    }
    box.setDefaultButton(next(iter(buttons)))
    box.setEscapeButton(list(buttons)[-1])
    clicked = _run(box)
    return next((a for b, a in buttons.items() if b is clicked), list(answers)[-1])


def _box(parent: Any, icon: Any, text: str, more: str) -> Any:
    box = QtWidgets.QMessageBox(parent)
    box.setIcon(icon)
    box.setWindowTitle("segdeform")
    box.setTextFormat(Qt.TextFormat.PlainText)  # names of files are no mark-up
    box.setText(text)
    box.setInformativeText(more)
    return box


def _run(box: Any) -> Any:
    box.exec()
    clicked = box.clickedButton()
    box.deleteLater()
    return clicked
