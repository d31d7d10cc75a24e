"""Repair and open: a closed copy of the document's surface, as a new document.

Also for a file that cannot be opened as it is.  Nothing on disk changes; undo returns to the
original document, redo to the copy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vtk_segdeform.io import Surface, to_polydata
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session

from .documents import Document, Opened, Unopenable
from .opening import Request
from .repair_dialog import RepairDialog


def ask_repair(window: Any) -> Request | None:
    """Show what a repair of the open document would do; return how to open the result, or None."""
    session = window.session
    surface = session.surface
    given = to_polydata(session.mesh) if surface is None else surface.given
    camera = window.editor.view.camera
    return _ask(window, window.document, given, session.mesh, camera, window.current)


def ask_repair_of(window: Any, path: Path, error: Unopenable) -> Request | None:
    """Do `ask_repair` for a file that could not be opened."""
    return _ask(window, Document(path.name, source=path), error.given, error.valid, None)


def _ask(
    window: Any,
    document: Document,
    given: Any,
    mesh: Mesh,
    camera: Any,
    original: Request | None = None,
) -> Request | None:
    has_pose = original is not None and window.session.state.pose is not None
    dialog = RepairDialog(given, mesh, camera, window, has_pose=has_pose)
    try:
        is_accepted = dialog.exec() == dialog.DialogCode.Accepted
        repaired = dialog.repaired if is_accepted else None
    finally:
        dialog.release()
    return None if repaired is None else _request(document, repaired, original)


def _request(document: Document, repaired: Surface, original: Request | None) -> Request:
    stem = Path(document.name).stem.removesuffix(" (repaired)")
    name = f"{stem} (repaired)"
    source = document.source

    def read(progress: Progress) -> Opened:
        progress(0.0, "Opening the repaired surface")
        # Files are proposed beside the original, under the new name.
        place = None if source is None else source.with_stem(name)
        return Document(name, source=place), Session(repaired)

    return Request(name, read, is_new=True, original=original)
