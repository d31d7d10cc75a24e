"""The dialogs of the window."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from ..editor import Autosaves, Slot, file_types

Qt = QtCore.Qt


class Answer(enum.Enum):
    """Answers of the user to a dialog."""

    SAVE = enum.auto()
    SAVE_MESH = enum.auto()
    DISCARD = enum.auto()
    CANCEL = enum.auto()
    RECOVER = enum.auto()
    LATER = enum.auto()
    REPAIR = enum.auto()


def ask_file(parent: Any, folder: Path) -> Path | None:
    """Ask for a mesh or a session to open, starting in *folder*."""
    types = file_types(sessions=True)
    name, _ = QtWidgets.QFileDialog.getOpenFileName(parent, "Open", str(folder), types)
    return Path(name) if name else None


def ask_save(parent: Any, name: str, *, mesh_is_saved: bool) -> Answer:
    """Ask whether to save the changes to the document *name*."""
    answers = {Answer.SAVE: "Save session", Answer.SAVE_MESH: "Save mesh ..."}
    warning = "Unsaved changes will be lost."
    if mesh_is_saved:
        warning = "The mesh is saved, but its regions, cages and handles are not."
        del answers[Answer.SAVE_MESH]
    return _ask(
        parent,
        f"Save changes to {name}?",
        warning,
        {**answers, Answer.DISCARD: "Discard", Answer.CANCEL: "Cancel"},
    )


def choose_work(parent: Any, autosaves: Autosaves) -> Slot | None:
    """Ask about each abandoned autosave; return the one to recover, or None.

    Discarded autosaves are deleted.  The others are kept, and so are all after the chosen one.
    """
    chosen, slots = None, autosaves.abandoned()
    for number, slot in enumerate(slots, 1):
        answer = Answer.LATER
        if chosen is None:
            answer = ask_recover(parent, slot, datetime.now(), others=len(slots) - number)
        if answer is Answer.RECOVER:
            chosen = slot
        elif answer is Answer.DISCARD:
            slot.remove()
        else:
            slot.release()
    return chosen


def ask_recover(parent: Any, slot: Slot, now: datetime, *, others: int = 0) -> Answer:
    """Ask whether to recover an autosave; *others* are asked about afterwards."""
    more = f" {others} more to review." if others else ""
    return _ask(
        parent,
        f"Recover unsaved work on {slot.about.name} from {moment(slot.when, now)}?",
        f"segdeform closed unexpectedly.{more}",
        {Answer.RECOVER: "Recover", Answer.DISCARD: "Discard", Answer.LATER: "Later"},
    )


def ask_replace(parent: Any, name: str) -> bool:
    """Ask whether to replace a file."""
    answers = {Answer.SAVE: "Replace", Answer.CANCEL: "Cancel"}
    text = f"Replace {name}?"
    return _ask(parent, text, "A file with this name already exists.", answers) is Answer.SAVE


def show_error(parent: Any, title: str, text: str) -> None:
    """Show an error until it is dismissed."""
    box = _box(parent, QtWidgets.QMessageBox.Icon.Warning, title, text)
    box.addButton(QtWidgets.QMessageBox.StandardButton.Ok)
    _run(box)


def ask_repair_instead(parent: Any, title: str, text: str) -> bool:
    """Show why a file cannot be opened; return whether to repair it."""
    answers = {Answer.REPAIR: "Repair and open ...", Answer.CANCEL: "Cancel"}
    return _ask(parent, title, text, answers, is_warning=True) is Answer.REPAIR


def show_about(parent: Any, version: str) -> None:
    """Show the About dialog."""
    box = _box(
        parent,
        QtWidgets.QMessageBox.Icon.NoIcon,
        f"vtk_segdeform {version}",
        "Deforms a dense mesh by moving a few of its vertices. Fine detail rotates with the "
        "surface, and an enclosed volume is preserved exactly.\n\n"
        "After K. Doba and H. Masuda, Rapid Mesh Deformation with Non-linear Constraints "
        "Using Segmentation.\n\nBSD-3-Clause.",
    )
    box.addButton(QtWidgets.QMessageBox.StandardButton.Ok)
    _run(box)


def moment(when: datetime, now: datetime) -> str:
    """Return *when* for users: the time, and the date if it is another day.

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
    Answer.SAVE_MESH: "AcceptRole",
    Answer.RECOVER: "AcceptRole",
    Answer.REPAIR: "AcceptRole",
    Answer.DISCARD: "DestructiveRole",
    Answer.CANCEL: "RejectRole",
    Answer.LATER: "RejectRole",
}


def _ask(
    parent: Any, text: str, more: str, answers: Mapping[Answer, str], *, is_warning: bool = False
) -> Answer:
    """Return the answer; Enter gives the first one, Escape and closing give the last one."""
    icons = QtWidgets.QMessageBox.Icon
    box = _box(parent, icons.Warning if is_warning else icons.Question, text, more)
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
    box.setTextFormat(Qt.TextFormat.PlainText)  # a file name may look like HTML
    box.setText(text)
    box.setInformativeText(more)
    return box


def _run(box: Any) -> Any:
    box.exec()
    clicked = box.clickedButton()
    box.deleteLater()
    return clicked
