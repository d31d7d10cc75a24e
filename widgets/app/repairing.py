"""Repair and open: a closed copy of the document's surface, as a new document.

Nothing on disk changes, and the original document stays in the list of recent files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyvista as pv

from vtk_segdeform.io import Surface, to_polydata
from vtk_segdeform.progress import Progress
from vtk_segdeform.session import Session

from .documents import Document, Opened
from .opening import Request
from .repair_dialog import RepairDialog


def ask_repair(window: Any) -> Request | None:
    """Show what a repair of the open document would do; return how to open the result, or None."""
    session = window.session
    surface = session.surface
    given = to_polydata(session.mesh) if surface is None else surface.given
    dialog = RepairDialog(given, session.mesh, window.editor.view.camera, window)
    try:
        is_accepted = dialog.exec() == dialog.DialogCode.Accepted
        repaired = dialog.repaired if is_accepted else None
    finally:
        dialog.release()
    return None if repaired is None else _request(window.document, repaired)


def _request(document: Document, repaired: pv.PolyData) -> Request:
    stem = Path(document.name).stem.removesuffix(" (repaired)")
    name = f"{stem} (repaired)"
    source = document.source

    def read(progress: Progress) -> Opened:
        progress(0.0, "Checking mesh")
        session = Session(Surface(repaired))
        # Files are proposed beside the original, under the new name.
        place = None if source is None else source.with_stem(name)
        return Document(name, source=place), session

    return Request(name, read, is_new=True)
