"""What the window's document is saved to: a session, a mesh, a picture; and who is asked before.

Every function takes the `Window` and returns whether the file is there.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from qtpy import QtCore, QtWidgets

from vtk_segdeform.errors import SessionError
from vtk_segdeform.files import replacing

from ..editor import Action, Desk, exporting, saving
from .asking import MESHES, Answer, ask_replace, ask_save, tell_failure
from .documents import SUFFIX

_SESSIONS = f"Sessions (*{SUFFIX})"
_PICTURE = (".png", ".jpg", ".jpeg")
_PICTURES = "Pictures (*.png *.jpg *.jpeg)"


def save_session(window: Any) -> bool:
    """Save the session to its file; ask for one if it has none."""
    path = window.document.session_path
    if path is None:
        return save_session_as(window)
    if not _done(window, saving(path)):
        return False
    window.keep_in_mind(window.document)
    return True


def save_session_as(window: Any) -> bool:
    """Ask for a file, which is the session's from then on."""
    path = _path(window, "Save session", _SESSIONS, SUFFIX)
    if path is None or not _done(window, saving(path)):
        return False
    window.keep_in_mind(replace(window.document, session_path=path, name=path.name))
    window.recent.add(path)
    return True


def save_mesh(window: Any) -> bool:
    """Save the mesh as it is in this pose to where it was saved before; else ask."""
    path = window.document.mesh_path
    if path is None:
        return save_mesh_as(window)
    done = _done(window, exporting(path))
    if done:
        window.mesh_state = window.session.state
    return done


def save_mesh_as(window: Any) -> bool:
    """Ask for a file for the mesh; its suffix is its format."""
    source = window.document.source
    suffix = ".ply" if source is None else source.suffix
    path = _path(window, "Save mesh", f"Meshes ({MESHES})", suffix)
    if path is None or not _done(window, exporting(path)):
        return False
    window.keep_in_mind(replace(window.document, mesh_path=path))
    window.mesh_state = window.session.state
    return True


def export_picture(window: Any) -> bool:
    """Ask for a file, and draw there what the view shows, but for its words and what is grabbed."""
    path = _path(window, "Export picture", _PICTURES, ".png")
    return path is not None and _done(window, lambda desk: _draw(window, desk, path))


def may_be_given_up(window: Any) -> bool:
    """Tell whether what is open can go: it is saved, or somebody said so."""
    if not window.is_behind:
        return True
    mesh_is_saved = window.mesh_state is window.session.state
    answer = ask_save(window, window.document.name, mesh_is_saved=mesh_is_saved)
    return save_session(window) if answer is Answer.SAVE else answer is Answer.DISCARD


def _done(window: Any, action: Action) -> bool:
    """Do it, also beside a job; what goes wrong is told in a box, and in the editor's line."""
    editor = window.editor
    editor.do(action, while_busy=True)
    fault = editor.desk.voice.fault
    if fault:
        tell_failure(window, "This could not be saved", fault)
    return not fault


def _path(window: Any, title: str, kinds: str, suffix: str) -> Path | None:
    """Return the path somebody chooses, with a suffix, or None."""
    proposal = window.document.proposal
    if proposal.suffix != suffix or not title.endswith("session"):
        proposal = proposal.with_suffix(suffix)
    if proposal == window.document.source:  # which is not to be written over by mere Enter
        proposal = proposal.with_stem(f"{proposal.stem}-bent")
    name, _ = QtWidgets.QFileDialog.getSaveFileName(window, title, str(proposal), kinds)
    if not name:
        return None
    path = Path(name)
    if path.suffix:
        return path
    path = path.with_suffix(suffix)
    return path if not os.path.exists(path) or ask_replace(window, path.name) else None


def _draw(window: Any, desk: Desk, path: Path) -> None:
    mode = desk.mode
    desk.stage.rest()  # no gizmo
    desk.voice.be_silent()
    desk.view.render()
    picture = window.editor_widget.plotter.grabFramebuffer()
    desk.mode = mode
    desk.stage.dragger.resume_refining()
    content = QtCore.QBuffer()
    content.open(QtCore.QIODevice.OpenModeFlag.WriteOnly)
    if path.suffix.lower() not in _PICTURE or not picture.save(content, path.suffix[1:].upper()):
        raise SessionError(f"{path}: this picture format is not supported; use .png or .jpg")
    try:
        with replacing(path) as draft:
            draft.write_bytes(bytes(content.data()))
    except OSError as fault:
        raise SessionError(f"{path}: cannot be written ({fault.strerror or fault})") from fault
    desk.say(f"picture written to {path}")
