"""Files of a page: uploads that the editor opens, and downloads of what it edits.

    POST upload?name=NAME&field=FIELD    the body is for a control of the panel that asks for a
                                         file; without FIELD a mesh or a session to open
    GET  download/SUFFIX?field=FIELD     what such a control saves; without FIELD the session, or
                                         the surface in its pose
    POST paraview/             null: trame's page asks for a launcher first, and there is none

The first two need the header ``X-Segdeform``, which a page of another origin cannot send.  A page
never names a file of the server: one file is uploaded at a time, each to a folder of its own.  Of
NAME only letters, digits and " .()+-" are used.
"""

from __future__ import annotations

import asyncio
import re
import shutil
import tempfile
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from aiohttp import web
from aiohttp.http import HttpProcessingError

from vtk_segdeform.errors import ArgumentError, SegDeformError, SessionError
from vtk_segdeform.files import replacing
from vtk_segdeform.io import is_mesh_file, writable_suffixes
from vtk_segdeform.kernels import quick_turns
from vtk_segdeform.session import save_session

from ..editor import DeformEditor, WrittenMesh, opening, write_posed
from ..panel import file_field, use_file

_SESSION = ".segdeform"
_HEADER = "X-Segdeform"
_LONGEST_NAME = 80  # letters of a name
_POLL = 0.05  # seconds between two looks at whether the pose has settled
_UPLOAD_TIMEOUT = 30.0  # seconds to wait for the next part of an upload
UPLOAD_LIMIT = 1 << 30  # bytes
_COMMON = (".ply", ".obj", ".stl", ".glb", ".off")  # first in the list
Read = Callable[[], Awaitable[bytes]]
_LABELS = {".glb": "glTF binary", ".gltf": "glTF"}


def formats() -> list[dict[str, str]]:
    """Return suffix and label of each format of a download, the session first."""
    known = [{"suffix": _SESSION[1:], "label": f"Session ({_SESSION})"}]
    others = [suffix for suffix in writable_suffixes() if suffix not in _COMMON]
    for suffix in (*_COMMON, *others):
        label = f"{_LABELS.get(suffix, suffix[1:].upper())} ({suffix})"
        known.append({"suffix": suffix[1:], "label": label})
    return known


async def _no_launcher(_: web.Request) -> web.Response:
    return web.json_response(None)


class Transfer:
    """The routes of one editor.

    Parameters
    ----------
    editor : DeformEditor
        The editor.
    folder : Path
        Where uploads are stored, created if necessary; nobody else writes there.
    limit : int
        Largest upload, in bytes.
    names : dict of str to str
        Filled with the names that the page shows for paths.
    changed : callable
        Called after a download, which saves.
    """

    def __init__(
        self,
        editor: DeformEditor,
        folder: Path,
        limit: int,
        names: dict[str, str],
        changed: Callable[[], None],
    ) -> None:
        self._editor, self._folder, self.limit = editor, folder, limit
        self._names, self._changed = names, changed
        self._is_uploading = False
        self._downloads: set[Path] = set()  # folders of files being read again

    def add_routes(self, app: Any) -> None:
        """Add the routes to an aiohttp application."""
        app.router.add_post("/upload", self.upload)
        app.router.add_get("/download/{suffix}", self.download)
        app.router.add_post("/paraview/", _no_launcher)

    async def upload(self, request: web.Request) -> web.Response:
        """Store the body, and open it in the background."""
        if _HEADER not in request.headers:
            return _refusal(403, "Only the page of the editor may upload files.")
        return await self.take(request.query, request.content_length, request.content.readany)

    async def take(self, query: Mapping[str, str], size: int | None, read: Read) -> web.Response:
        """Store a file of this *size*, which *read* returns in parts, and open it."""
        name = re.sub(r"[^\w .()+-]", "_", query.get("name", ""))[-_LONGEST_NAME:].strip()
        suffix, field = Path(name).suffix.lower(), query.get("field", "")
        if not field and suffix != _SESSION and not is_mesh_file(f"mesh{suffix}"):
            return _refusal(415, f"{name or 'This file'} is no mesh or session that can be opened.")
        if (size or 0) > self.limit:
            return self._too_large(name)
        if self._is_uploading:
            return _refusal(409, "Another upload is in progress. Wait until it is complete.")
        if self._editor.is_busy:
            return _refusal(409, "The editor is busy. Wait, or cancel the work, and try again.")
        self._is_uploading, folder = True, self._new_folder()
        # A file for a control keeps its name, which the session may show.
        own = field and Path(name).stem.strip(". ")
        place, is_open = folder / (name if own else f"upload{suffix}"), False
        try:
            if not await self._store(read, place):
                return self._too_large(name)
            self._names.update(dict.fromkeys(map(str, (place, place.with_suffix(_SESSION))), name))
            if field:
                error = use_file(self._editor, field, place)
            else:
                error = self._editor.do(opening(place))
            is_open = error is None
        except ArgumentError as fault:
            return _refusal(404, str(fault))
        except asyncio.TimeoutError:
            return _refusal(408, "The upload stopped. Try it again.")
        except (web.RequestPayloadError, HttpProcessingError):
            return _refusal(400, "The upload is damaged. Try it again.")
        except OSError as fault:
            return _refusal(507, f"{name} could not be stored: {fault.strerror}.")
        finally:
            self._is_uploading = False
            self._remove_folders(all_but=folder if is_open else None)
        return (
            web.Response() if error is None else _refusal(409, str(error).replace(str(place), name))
        )

    async def _store(self, read: Read, place: Path) -> bool:
        """Write a file to *place*; return False if it is larger than the limit."""
        size = 0
        with replacing(place) as draft, draft.open("wb") as file:
            while data := await asyncio.wait_for(read(), _UPLOAD_TIMEOUT):
                size += len(data)
                if size > self.limit:
                    return False
                file.write(data)
        return True

    async def download(self, request: web.Request) -> web.Response:
        """Send the session, or the surface in its pose, once that has settled."""
        if _HEADER not in request.headers:
            return _refusal(403, "Only the page of the editor may download files.")
        return await self.give(request.match_info["suffix"], request.query)

    async def give(self, suffix: str, query: Mapping[str, str]) -> web.Response:
        """Return a download without an address; see `download`."""
        suffix, field = f".{suffix}", query.get("field", "")
        if suffix not in self._suffixes(field):
            return _refusal(404, f"There is no format {suffix}.")
        while self._editor.widgets.is_pose_to_come:
            await asyncio.sleep(_POLL)
        place = self._new_folder() / f"download{suffix}"
        self._downloads.add(place.parent)
        try:
            written = self._write(place, field)
            data = place.read_bytes()
            if written is not None:
                self._tell(await asyncio.to_thread(quick_turns()(written.loss)), *written.remarks)
        except SegDeformError as error:
            return _refusal(409, str(error).replace(f"{place}: ", ""))
        finally:
            self._downloads.remove(place.parent)
            shutil.rmtree(place.parent, ignore_errors=True)  # or `close` has
        self._changed()
        disposition = f'attachment; filename="{place.name}"'
        return web.Response(body=data, headers={"Content-Disposition": disposition})

    def _new_folder(self) -> Path:
        self._folder.mkdir(mode=0o700, exist_ok=True)
        return Path(tempfile.mkdtemp(dir=self._folder))

    def _tell(self, *remarks: str) -> None:
        """Say what the format of a download has lost."""
        if text := ". ".join(filter(None, remarks)):
            self._editor.controller.say(text)

    def _write(self, place: Path, field: str) -> WrittenMesh | None:
        """Write what *field* saves, the session, or the surface in its pose, which is returned."""
        editor, session = self._editor, self._editor.session
        if editor.is_busy or session.is_dragging:
            raise SessionError("Finish the drag or the work before downloading.")
        editor.controller.finishing.interrupt()
        if field:
            if not file_field(editor, field).saves:
                raise SessionError("This control saves nothing.")
            error = use_file(editor, field, place)
            if error or not place.exists():
                raise SessionError(str(error or "There is nothing to save."))
            editor.controller.say("Downloaded")  # instead of the place
            return None
        if place.suffix != _SESSION:
            return write_posed(session, place, displacement=editor.controller.displacement)
        save_session(place, session, view=editor.controller.camera.settings(editor.mode))
        editor.controller.file.mark_saved(session)
        return None

    def _suffixes(self, field: str) -> tuple[str, ...]:
        """Return the suffixes of what *field* saves, or of the session and the surface."""
        if not field:
            return (_SESSION, *writable_suffixes())
        if not self._editor.is_busy:
            with suppress(ArgumentError):
                return file_field(self._editor, field).suffixes
        return (".csv",)

    def _too_large(self, name: str) -> web.Response:
        most = f"{self.limit / 1e6:,.0f} MB"
        return _refusal(413, f"{name} is larger than {most}, the limit of this server.")

    def _remove_folders(self, *, all_but: Path | None) -> None:
        """Remove uploads, except the one that is edited, which may be saved to again."""
        kept = {all_but, self._editor.path.parent, *self._downloads}
        for path in self._folder.iterdir():
            if path.is_dir() and path not in kept:
                shutil.rmtree(path, ignore_errors=True)


def _refusal(status: int, text: str) -> web.Response:
    return web.Response(status=status, text=text)
