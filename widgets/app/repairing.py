"""Repair and open: a closed copy of the document's surface, as a new document.

Also for a file that cannot be opened as it is.  Nothing on disk changes; undo returns to the
original document, redo to the copy.
"""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

from vtk_segdeform.io import to_polydata
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.session import Session, State

from .documents import Document, Opened, Unopenable
from .repair_dialog import RepairDialog

_NEW = State()


def ask_repair(window: Any) -> Opened | None:
    """Show what a repair of the open document would do; return the repaired copy, or None."""
    session, camera = window.session, window.editor.view.camera
    given = to_polydata(session.mesh) if session.surface is None else session.surface.given
    return _ask(window, window.document, given, session.mesh, camera, state=session.state)


def ask_repair_of(window: Any, path: Path, error: Unopenable) -> Opened | None:
    """Do `ask_repair` for a file that could not be opened."""
    return _ask(window, Document(path.name, source=path), error.given, error.valid, None)


def _ask(
    window: Any, document: Document, given: Any, mesh: Mesh, camera: Any, *, state: State = _NEW
) -> Opened | None:
    dialog = RepairDialog(given, mesh, camera, window, has_pose=state.pose is not None)
    try:
        repaired = dialog.repaired if dialog.exec() == dialog.DialogCode.Accepted else None
    finally:
        dialog.release()
        del dialog
        gc.collect()  # as `Pages.delete_views`
    if repaired is None:
        return None
    name = f"{Path(document.name).stem.removesuffix(' (repaired)')} (repaired)"
    # Files are proposed beside the original, under the new name.
    place = None if document.source is None else document.source.with_stem(name)
    return Document(name, source=place), Session(repaired, state=State(carried=state.carried))
