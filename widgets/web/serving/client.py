"""One client: its process, its folder, and when it was last seen.

    folder/files/   uploads and autosave.segdeform, which the next process opens after a crash
           tmp/     temporary files of the process

The process is started by `Client.start` and gets its secret (`secret`) through its standard input,
which stays open while the server lives.  It answers with one line, its port.  It leads its own
process group, which is killed at the end: work is in the autosave, and nothing else is kept.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import secrets
import shutil
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from vtk_segdeform.errors import SessionError
from vtk_segdeform.interpreter import python_command, python_environment

from .limits import Limits

_log = logging.getLogger(__name__)
_NO_START = "The editor could not be started."
_MOMENT = 1.0  # seconds
_RELOAD = 5.0  # seconds
_LAST_WORDS = 4000  # bytes of the error output that are kept
_RUN = (
    "import runpy; "
    "runpy.run_module('vtk_segdeform.widgets.web.client', run_name='__main__', alter_sys=True)"
)


def client_command(file: Path | None) -> list[str]:
    """Return the command that runs a client process with *file* open, in a folder with uploads."""
    given = [] if file is None else [str(file.absolute())]
    return python_command(_RUN, *given)


class Client:
    """A page and its process, which does not run before `start`.

    Parameters
    ----------
    command : sequence of str
        Program and first arguments of the process.
    parent : Path
        Where its private folder is created.
    limits : Limits
        Limits of the server.
    """

    def __init__(self, command: Sequence[str], parent: Path, limits: Limits) -> None:
        self.id = secrets.token_urlsafe(16)
        self.key = secrets.token_urlsafe(32)
        self.secret = secrets.token_hex(32)
        self.folder = parent / secrets.token_hex(8)  # its id is as secret as its key
        self.folder.mkdir(mode=0o700)
        self.port: int | None = None
        """Port of the process; None unless it accepts connections."""
        self.failure = ""
        """Why the process has ended, a sentence."""
        self.could_not_start = False
        """Whether the process has ended before it accepted connections."""
        self.uploads = asyncio.Lock()
        self._command, self._limits = command, limits
        self._task: asyncio.Task[None] | None = None
        self._started, self._is_ending, self._is_closed = asyncio.Event(), False, False
        self._pid: int | None = None
        self._had_page, self._visits, self._seen = False, 0, asyncio.get_running_loop().time()

    @property
    def is_running(self) -> bool:
        """Whether the process runs, or is being started."""
        return self._task is not None and not self._task.done()

    @property
    def is_closed(self) -> bool:
        """Whether it has ended for good."""
        return self._is_closed

    @property
    def visits(self) -> int:
        """Requests and WebSockets in progress."""
        return self._visits

    @property
    def absent(self) -> float:
        """Seconds since the last request was answered or the last WebSocket closed."""
        return 0.0 if self._visits else asyncio.get_running_loop().time() - self._seen

    @property
    def is_abandoned(self) -> bool:
        """Whether it had a page, which is gone for longer than a reload takes."""
        return self._had_page and self.absent > _RELOAD

    @contextmanager
    def page(self) -> Iterator[None]:
        """Count the WebSocket of a page while it lasts."""
        self._had_page = True
        with self.visit():
            yield

    @contextmanager
    def visit(self) -> Iterator[None]:
        """Count a request or a WebSocket while it lasts."""
        self._visits += 1
        try:
            yield
        finally:
            self._visits -= 1
            self._seen = asyncio.get_running_loop().time()

    @property
    def memory(self) -> int:
        """Resident memory of the process in bytes; 0 where the system has no ``/proc``."""
        with suppress(OSError, ValueError, IndexError):
            pages = Path(f"/proc/{self._pid}/statm").read_text(encoding="ascii").split()[1]
            return int(pages) * os.sysconf("SC_PAGE_SIZE")
        return 0

    def start(self) -> None:
        """Start the process, unless it runs or this client is closed."""
        if not (self.is_running or self._is_closed):
            self.failure, self.could_not_start, self._is_ending = "", False, False
            self._started.clear()
            self._task = asyncio.create_task(self._run())

    async def started(self) -> int | None:
        """Wait until a started process accepts connections; return its port, or None."""
        if self.is_running:
            await self._started.wait()
        return self.port

    async def reason(self) -> str:
        """Return why the process has ended, which is known a moment after its connections close."""
        if self._task is not None:
            await asyncio.wait([self._task], timeout=_MOMENT)
        return self.failure or "The editor has closed the connection; reload the page."

    async def end(self, reason: str) -> None:
        """Kill the process, and wait until it is gone; the page shows the *reason*."""
        if self._task is None or self._task.done():
            return
        if not self._is_ending:
            self._is_ending, self.failure = True, reason
            self._task.cancel()
        await asyncio.wait([self._task])

    async def close(self) -> None:
        """End for good, and delete the folder."""
        self._is_closed = True
        await self.end("The server has ended.")
        shutil.rmtree(self.folder, ignore_errors=True)

    async def _run(self) -> None:
        errors = bytearray()
        try:
            await self._live(errors)
        except SessionError as fault:
            words = errors.decode("utf-8", "backslashreplace").strip().splitlines()
            self._fail(str(fault), *words[-1:])
        except asyncio.TimeoutError:  # before OSError, of which it is one in later versions
            self._fail("The editor did not start in time.")
        except (OSError, ValueError) as fault:
            self._fail(_NO_START, str(fault))
        finally:
            self.port = self._pid = None
            self._started.set()

    def _fail(self, sentence: str, *details: str) -> None:
        """Keep why the process has ended; the details are not for the page."""
        self.failure, self.could_not_start = sentence, self.port is None
        # Files may put anything into a message: no escape sequence may reach a terminal.
        text = "".join(
            letter if letter.isprintable() else ascii(letter)[1:-1] for letter in sentence
        )
        _log.warning(" ".join([text, *map(ascii, details)]))

    async def _live(self, errors: bytearray) -> None:
        """Run the process until it ends, which is an error, or this task is cancelled.

        The end of its error output is appended to *errors*.
        """
        process = await self._new_process()
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        reading = asyncio.create_task(_read(process.stderr, errors))
        try:
            self._pid = process.pid
            process.stdin.write(self.secret.encode() + b"\n")
            line = await asyncio.wait_for(process.stdout.readline(), self._limits.start)
            self.port = _port_in(line)
            self._started.set()
            await _read(process.stdout)
            await process.wait()
            raise SessionError("The editor has ended unexpectedly.")
        finally:
            _kill(process)
            process.stdin.close()
            await _read(process.stdout)
            await reading
            await process.wait()

    async def _new_process(self) -> asyncio.subprocess.Process:
        files, temporary = self.folder / "files", self.folder / "tmp"
        for each in (files, temporary):
            each.mkdir(mode=0o700, exist_ok=True)
        pipe = asyncio.subprocess.PIPE
        return await asyncio.create_subprocess_exec(
            *self._command, "--port", "0", "--folder", str(files),
            "--upload-limit", str(self._limits.upload),
            stdin=pipe, stdout=pipe, stderr=pipe, cwd=files, start_new_session=True,
            env=python_environment(
                **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(temporary)),
                WSLINK_READY_MSG="",
                WSLINK_HEART_BEAT="0",  # the server watches the page
                WSLINK_WS_COMPRESS="0",
                WSLINK_MAX_MSG_SIZE=str(self._limits.message // 2),
            ),
        )  # fmt: skip


def _port_in(line: bytes) -> int:
    """Return the port that a process has announced; SessionError if it has not."""
    said: dict[str, object] = {}
    with suppress(ValueError, TypeError):
        said = dict(json.loads(line))
    port = said.get("port")
    if isinstance(port, int):
        return port
    raise SessionError(str(said.get("error", _NO_START)))


async def _read(stream: asyncio.StreamReader, last: bytearray | None = None) -> None:
    """Read until the end, so that the writer never waits; keep the end in *last*."""
    while part := await stream.read(1 << 16):
        if last is not None:
            last += part
            del last[:-_LAST_WORDS]


def _kill(process: asyncio.subprocess.Process) -> None:
    if process.returncode is None:
        with suppress(ProcessLookupError):
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
