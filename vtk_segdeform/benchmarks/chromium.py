"""Headless Chromium with a real mouse, through the DevTools protocol over a pipe.

It uses no graphics processor: a page with WebGL draws in software (SwiftShader), one without it
is put together by the processor, as Chromium does by itself where there is none.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from ..errors import MissingDependencyError

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run",
    "--disable-extensions", "--disable-background-networking", "--disable-dev-shm-usage",
    "--mute-audio",
)  # fmt: skip
# WebGL by software; the page itself is put together as on any machine without graphics processor.
_WEBGL = ("--enable-unsafe-swiftshader",)
_NO_WEBGL = "--disable-gpu", "--disable-software-rasterizer"
_PATIENCE = 60.0  # seconds


class Chromium:
    """A browser with one page, as a context manager.

    Parameters
    ----------
    size : (width, height)
        Of the page, in pixels.
    webgl : bool
        Whether the page can use WebGL.

    Raises
    ------
    MissingDependencyError
        If Chromium is not installed.
    """

    def __init__(self, size: tuple[int, int], *, webgl: bool) -> None:
        path = next(filter(None, map(shutil.which, _NAMES)), None)
        if path is None or os.name != "posix":
            raise MissingDependencyError(
                "the browser is measured in Chromium (Debian: apt-get install chromium)"
            )
        self._profile = tempfile.mkdtemp(prefix="segdeform-chromium-")
        commands, self._out = os.pipe()
        self._in, answers = os.pipe()
        # Chromium reads commands from descriptor 3 and writes answers to 4.
        pipes = f'exec 3<&{commands} 4>&{answers}; exec "$0" "$@"'
        flags = *_FLAGS, *(_WEBGL if webgl else _NO_WEBGL)
        self._process = subprocess.Popen(
            ["bash", "-c", pipes, path, *flags, f"--user-data-dir={self._profile}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            pass_fds=(commands, answers), start_new_session=True,
        )  # fmt: skip
        os.close(commands)
        os.close(answers)
        self._last, self._buffer, self._session = 0, b"", ""
        self._answers: dict[int, Any] = {}
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        self.call("Page.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1],
                  deviceScaleFactor=1, mobile=False)  # fmt: skip

    def __enter__(self) -> Chromium:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        os.close(self._in)
        os.close(self._out)
        shutil.rmtree(self._profile, ignore_errors=True)

    def call(self, method: str, **parameters: Any) -> Any:
        """Send a command to the page, and return its answer."""
        number, deadline = self.send(method, **parameters), time.monotonic() + _PATIENCE
        while number not in self._answers:
            if not self._read(deadline - time.monotonic()):
                raise RuntimeError(f"{method}: no answer from Chromium")
        result = self._answers[number]
        self._answers.clear()  # others are of commands that nobody waits for
        return result

    def send(self, method: str, **parameters: Any) -> int:
        """Send a command to the page without waiting for its answer; return its number."""
        self._last += 1
        message = {"id": self._last, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._out, data) :]
        return self._last

    def evaluate(self, expression: str) -> Any:
        """Return the value of an expression in the page."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{expression}: {result['exceptionDetails']['text']}")
        return result["result"].get("value")

    def wait(self, condition: str) -> None:
        """Wait until an expression in the page is true."""
        deadline = time.monotonic() + _PATIENCE
        while not self.evaluate(condition):
            if time.monotonic() > deadline:
                raise RuntimeError(f"not in {_PATIENCE:g} s: {condition}")
            time.sleep(0.05)

    def mouse(self, kind: str, place: tuple[float, float], *, held: bool) -> None:
        """Send an event of the mouse, without waiting; *held* is whether the left button is."""
        button, buttons = ("left", 1) if held else ("none", 0)
        self.send(
            "Input.dispatchMouseEvent", type=kind, x=place[0], y=place[1],
            button="left" if kind == "mouseReleased" else button, buttons=buttons,
            clickCount=int(kind != "mouseMoved"),
        )  # fmt: skip
        while self._read(0.0):
            pass

    def processors(self) -> dict[str, float]:
        """Return the processor time of its processes so far, in seconds, by type."""
        found: dict[str, float] = {}
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "stat").read_text().rpartition(")")[2].split()
                line = (folder / "cmdline").read_text()
            except OSError:  # it has just ended
                continue
            if int(words[3]) == self._process.pid:  # its session
                kind = line.partition("--type=")[2].partition("\0")[0].split(" ")[0] or "browser"
                found[kind] = found.get(kind, 0.0) + ticks(words)
        return found

    def _read(self, seconds: float) -> bool:
        """Read what Chromium says within *seconds*; return whether it said anything."""
        if not select.select([self._in], [], [], max(seconds, 0.0))[0]:
            return False
        data = os.read(self._in, 1 << 20)
        if not data:
            raise RuntimeError("Chromium has ended")
        *whole, self._buffer = (self._buffer + data).split(b"\0")
        for each in map(json.loads, whole):
            if "error" in each:
                raise RuntimeError(f"Chromium: {each['error']['message']}")
            if "id" in each:
                self._answers[each["id"]] = each["result"]
        return True


def ticks(words: list[str]) -> float:
    """Return the processor time in seconds from the words of /proc/PID/stat after the name."""
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
