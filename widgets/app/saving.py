"""Saving the window's document: as a session, a mesh or a picture, with the dialogs before.

Every function takes the `Window` and returns whether the file was written, or will be once the pose
has settled.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from vtk_segdeform.errors import SessionError
from vtk_segdeform.files import replacing

from ..editor import Action, Controller, Kind, error_text, exporting, file_types, saving
from .dialogs import Answer, ask_replace, ask_save, show_error
from .documents import SUFFIX

_SESSIONS = f"Sessions (*{SUFFIX})"
_PICTURE = (".png", ".jpg", ".jpeg")
_PICTURES = "Pictures (*.png *.jpg *.jpeg)"


def save_session(window: Any) -> bool:
    """Save the session to its file, or ask for one."""
    path = window.document.session_path
    if path is None:
        return save_session_as(window)
    return _done(window, saving(path, lambda: window.set_document(window.document)))


def save_session_as(window: Any) -> bool:
    """Ask for a file and save the session there; it becomes the session's file."""
    path = _path(window, "Save session", _SESSIONS, SUFFIX)
    return path is not None and _done(window, saving(path, lambda: _session_saved(window, path)))


def save_mesh(window: Any) -> bool:
    """Save the posed mesh to its file, or ask for one."""
    path = window.document.mesh_path
    if path is None:
        return save_mesh_as(window)
    return _done(window, exporting(path, lambda: _mesh_saved(window, path)))


def save_mesh_as(window: Any) -> bool:
    """Ask for a file and save the posed mesh there, in the format of its suffix."""
    source = window.document.source
    suffix = ".ply" if source is None else source.suffix
    path = _path(window, "Save mesh", file_types(sessions=False), suffix)
    return path is not None and _done(window, exporting(path, lambda: _mesh_saved(window, path)))


def export_picture(window: Any) -> bool:
    """Ask for a file and save a picture of the view, without status line and gizmos."""
    path = _path(window, "Export picture", _PICTURES, ".png")
    return path is not None and _done(window, lambda controller: _draw(window, controller, path))


def may_discard(window: Any) -> bool:
    """Return whether the document may be closed: it is saved, or the user discards it."""
    if window.has_mesh and window.editor.controller.queue.task(Kind.SAVE):
        _settle(window)
    if not window.is_modified:
        return True
    mesh_is_saved = _mesh_is_saved(window)
    answer = ask_save(window, window.document.name, mesh_is_saved=mesh_is_saved)
    if answer is Answer.SAVE_MESH:
        return _mesh_saved_now(window)
    return _saved_now(window) if answer is Answer.SAVE else answer is Answer.DISCARD


def _saved_now(window: Any) -> bool:
    """Save the session, and wait until that is done."""
    if not save_session(window):
        return False
    _settle(window)
    return not window.is_modified


def _mesh_saved_now(window: Any) -> bool:
    """Save the mesh, and wait until that is done."""
    if not save_mesh(window):
        return False
    _settle(window)
    return _mesh_is_saved(window)


def _mesh_is_saved(window: Any) -> bool:
    """Return whether a file contains the mesh as it is, without a loss that would be unseen."""
    is_written = window.mesh_state is window.session.state
    return is_written and window.editor.controller.saved_intact()


def _settle(window: Any) -> None:
    """Wait until the pose has settled and has been saved; the window is drawn meanwhile."""
    events, controller = QtCore.QEventLoop.ProcessEventsFlag, window.editor.controller
    while controller.widgets.is_pose_to_come:
        QtWidgets.QApplication.processEvents(
            events.ExcludeUserInputEvents | events.WaitForMoreEvents
        )
    controller.queue.hurry(Kind.SAVE)


def _session_saved(window: Any, path: Path) -> None:
    window.set_document(replace(window.document, session_path=path, name=path.name))
    window.recent.add(path)


def _mesh_saved(window: Any, path: Path) -> None:
    window.editor.controller.file.is_new = False
    window.mesh_state = window.session.state
    window.set_document(replace(window.document, mesh_path=path))


def _done(window: Any, action: Action) -> bool:
    """Run the action, even during a job; show an error in a dialog and in the status line."""
    error = window.editor.do(action, while_busy=True)
    if error is not None:
        show_error(window, "Could not save", error_text(error))
    return error is None


def _path(window: Any, title: str, kinds: str, suffix: str) -> Path | None:
    """Return the path that the user chooses, with a suffix, or None."""
    proposal = window.document.proposal
    if proposal.suffix != suffix or not title.endswith("session"):
        proposal = proposal.with_suffix(suffix)
    if proposal == window.document.source:  # never propose to overwrite the original
        proposal = proposal.with_stem(f"{proposal.stem}-deformed")
    name, _ = QtWidgets.QFileDialog.getSaveFileName(window, title, str(proposal), kinds)
    if not name:
        return None
    path = Path(name)
    if path.suffix:
        return path
    path = path.with_suffix(suffix)
    return path if not os.path.exists(path) or ask_replace(window, path.name) else None


def _draw(window: Any, controller: Controller, path: Path) -> None:
    with controller.clean_view():
        picture = window.editor_widget.plotter.grabFramebuffer()
    content = QtCore.QBuffer()
    content.open(QtCore.QIODevice.OpenModeFlag.WriteOnly)
    if path.suffix.lower() not in _PICTURE or not picture.save(content, path.suffix[1:].upper()):
        raise SessionError(f"{path}: this picture format is not supported; use .png or .jpg")
    try:
        with replacing(path) as draft:
            draft.write_bytes(bytes(content.data()))
    except OSError as fault:
        raise SessionError(f"{path}: cannot be written ({fault.strerror or fault})") from fault
    controller.say(f"Picture saved to {path}")
