"""Headless Chromium with a real mouse and real keys, through the DevTools protocol over a pipe.

    with Chromium() as browser:
        page = browser.page("http://127.0.0.1:8765/")
        page.wait("document.title != ''")
        page.drag([(100, 100), (160, 120)])
        page.key("z")

Pages do not share cookies or storage: each has a browser context of its own.  A page opened with
``beside=page`` shares those of *page*, and its cache.
"""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless=new",
    "--no-sandbox",  # which root may not use
    "--remote-debugging-pipe",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # SwiftShader takes five times as long for it as the processor
    "--no-first-run",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-dev-shm-usage",
    "--mute-audio",
)
ALT, CTRL, META, SHIFT = 1, 2, 4, 8  # modifiers, to be added
_BUTTONS = {"none": 0, "left": 1, "right": 2, "middle": 4}
_CODES = {
    "Escape": 27, "Enter": 13, "Tab": 9, "Backspace": 8, "Delete": 46, " ": 32, "Shift": 16,
    "Control": 17, "Alt": 18, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40,
}  # fmt: skip


def chromium_path() -> str | None:
    """Return where Chromium is installed, or None."""
    return next(filter(None, map(shutil.which, _NAMES)), None)


needs_chromium = pytest.mark.skipif(
    chromium_path() is None, reason="Chromium is not installed (Debian: apt-get install chromium)"
)


class PageError(RuntimeError):
    """A command that Chromium refused, or a script that failed in the page."""


class Chromium:
    """A browser process of its own, with a profile that is deleted at the end."""

    def __init__(self, width: int = 1200, height: int = 800) -> None:
        path = chromium_path()
        assert path is not None
        self._profile = tempfile.mkdtemp(prefix="chromium-")
        # Chromium reads commands from descriptor 3 and writes answers to 4.
        theirs_in, self._out = os.pipe()
        self._in, theirs_out = os.pipe()
        saved = os.dup(theirs_in), os.dup(theirs_out)  # away from 3 and 4 themselves
        os.close(theirs_in)
        os.close(theirs_out)

        def give_pipes() -> None:
            high = [os.dup(fd) for fd in saved]
            for target, fd in zip((3, 4), high, strict=True):
                os.dup2(fd, target)

        self.process = subprocess.Popen(
            [path, *_FLAGS, f"--user-data-dir={self._profile}",
             f"--window-size={width},{height}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            preexec_fn=give_pipes, close_fds=False, start_new_session=True,
        )  # fmt: skip
        for fd in saved:
            os.close(fd)
        self._size = width, height
        self._last = 0
        self._buffer = b""
        self._answers: dict[int, Any] = {}
        self.events: list[dict[str, Any]] = []

    def __enter__(self) -> Chromium:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def page(
        self,
        url: str = "about:blank",
        *,
        size: tuple[int, int] | None = None,
        scale: float = 1.0,
        dark: bool = False,
        touch: bool = False,
        beside: Page | None = None,
    ) -> Page:
        """Open *url* in a context of its own, or *beside* a page, with a viewport of *size*."""
        if beside is None:
            context = self.call("Target.createBrowserContext")["browserContextId"]
        else:
            context = beside.context
        # In a window of its own, because a tab behind another one draws nothing.
        target = self.call("Target.createTarget", url="about:blank", browserContextId=context,
                           newWindow=True)  # fmt: skip
        session = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        page = Page(self, session["sessionId"], target["targetId"], context, beside is None)
        width, height = size or self._size
        for domain in ("Page", "Runtime", "Log"):
            page.call(f"{domain}.enable")
        page.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=scale, mobile=touch)  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        page.call("Emulation.setEmulatedMedia", features=[scheme])
        if touch:
            page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
        if url != "about:blank":
            page.go(url)
        return page

    def call(self, method: str, session: str | None = None, **params: Any) -> Any:
        """Send a command and return its answer."""
        self._last += 1
        number = self._last
        message: dict[str, Any] = {"id": number, "method": method, "params": params}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._out, data) :]
        deadline = time.monotonic() + 60
        while number not in self._answers:
            self._read(deadline, method)
        answer = self._answers.pop(number)
        if "error" in answer:
            raise PageError(f"{method}: {answer['error']['message']}")
        return answer["result"]

    def pump(self, seconds: float = 0.0) -> None:
        """Collect events for *seconds*."""
        deadline = time.monotonic() + seconds
        while self._read(deadline, None):
            pass

    def _read(self, deadline: float, method: str | None) -> bool:
        wait = max(0.0, deadline - time.monotonic())
        if not select.select([self._in], [], [], wait)[0]:
            if method is None:
                return False
            raise PageError(f"{method}: no answer from Chromium")
        data = os.read(self._in, 1 << 20)
        if not data:
            raise PageError("Chromium has ended")
        *whole, self._buffer = (self._buffer + data).split(b"\0")
        for each in map(json.loads, whole):
            if "id" in each:
                self._answers[each["id"]] = each
            else:
                self.events.append(each)
        return True

    def kill(self) -> None:
        """Kill all processes of the browser at once, as a crash would."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    def close(self) -> None:
        """End the browser and delete its profile."""
        self.kill()
        for name in ("_in", "_out"):
            if (fd := self.__dict__.pop(name, None)) is not None:
                os.close(fd)
        shutil.rmtree(self._profile, ignore_errors=True)


class Page:
    """One page; coordinates are CSS pixels from the upper left."""

    def __init__(
        self, browser: Chromium, session: str, target: str, context: str, is_first: bool
    ) -> None:
        self.browser, self._session, self._target = browser, session, target
        self.context, self._is_first = context, is_first
        self._held = "none"

    def call(self, method: str, **params: Any) -> Any:
        """Send a command of the DevTools protocol to the page."""
        return self.browser.call(method, self._session, **params)

    def go(self, url: str) -> None:
        """Load *url* and wait until it is loaded."""
        result = self.call("Page.navigate", url=url)
        if "errorText" in result:
            raise PageError(f"{url}: {result['errorText']}")
        self.wait("document.readyState == 'complete'")

    def evaluate(self, script: str) -> Any:
        """Return the value of an expression; promises are awaited."""
        result = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in result:
            fault = result["exceptionDetails"]
            raise PageError(fault.get("exception", {}).get("description", fault["text"]))
        return result["result"].get("value")

    def frame(self, url: str, seconds: float = 30.0) -> Page:
        """Wait for its frame at *url*, of another site; return it for scripts, without a mouse."""
        deadline = time.monotonic() + seconds
        while True:
            known = self.browser.call("Target.getTargets")["targetInfos"]
            found = [each["targetId"] for each in known if each["url"] == url]
            if found:
                break
            if time.monotonic() > deadline:
                raise PageError(f"no frame in {seconds:g} s: {url}")
            time.sleep(0.03)
        session = self.browser.call("Target.attachToTarget", targetId=found[0], flatten=True)
        frame = Page(self.browser, session["sessionId"], found[0], self.context, False)
        for domain in ("Runtime", "Log"):
            frame.call(f"{domain}.enable")
        return frame

    def wait(self, condition: str, seconds: float = 30.0) -> Any:
        """Wait until the expression *condition* is true, and return its value."""
        deadline = time.monotonic() + seconds
        while not (value := self.evaluate(condition)):
            if time.monotonic() > deadline:
                raise PageError(f"not in {seconds:g} s: {condition}")
            time.sleep(0.03)
        return value

    def messages(self) -> list[str]:
        """Return what the page has written to its console, with uncaught errors."""
        self.browser.pump()
        found = []
        for event in self.browser.events:
            if event.get("sessionId") != self._session:
                continue
            what = event["params"]
            if event["method"] == "Runtime.exceptionThrown":
                detail = what["exceptionDetails"]
                found.append(detail.get("exception", {}).get("description", detail["text"]))
            elif event["method"] == "Runtime.consoleAPICalled":
                words = (str(a.get("value", a.get("description", ""))) for a in what["args"])
                found.append(f"{what['type']}: {' '.join(words)}")
            elif event["method"] == "Log.entryAdded":
                found.append(f"{what['entry']['level']}: {what['entry']['text']}")
        return found

    def box(self, selector: str) -> tuple[float, float, float, float]:
        """Return left, top, width and height of the first element that matches."""
        wanted = json.dumps(selector)
        return tuple(self.evaluate(
            f"(() => {{ const b = document.querySelector({wanted}).getBoundingClientRect();"
            " return [b.left, b.top, b.width, b.height]; })()"
        ))  # fmt: skip

    def centre(self, selector: str) -> tuple[float, float]:
        """Return the centre of the first element that matches."""
        left, top, width, height = self.box(selector)
        return left + width / 2, top + height / 2

    def click(self, where: str | tuple[float, float], **keywords: Any) -> None:
        """Press and release the mouse on a point or on the element of a selector."""
        self.drag([self.centre(where) if isinstance(where, str) else where], **keywords)

    def drag(
        self,
        points: Iterable[tuple[float, float]],
        *,
        button: str = "left",
        modifiers: int = 0,
        pause: float = 0.0,
        release: bool = True,
    ) -> None:
        """Press at the first point, move through the others, release at the last."""
        points = list(points)
        self.move(points[0], modifiers=modifiers)
        self._mouse("mousePressed", points[0], button, modifiers)
        self._held = button
        for point in points[1:]:
            time.sleep(pause)
            self.move(point, modifiers=modifiers)
        if release:
            self.release(points[-1], modifiers=modifiers)

    def move(self, point: tuple[float, float], *, modifiers: int = 0) -> None:
        """Move the mouse to *point*."""
        self._mouse("mouseMoved", point, self._held, modifiers)

    def release(self, point: tuple[float, float], *, modifiers: int = 0) -> None:
        """Release the button that is held."""
        button, self._held = self._held, "none"
        self._mouse("mouseReleased", point, button, modifiers)

    def wheel(self, point: tuple[float, float], down: float, *, modifiers: int = 0) -> None:
        """Turn the wheel at *point* by *down* pixels."""
        self.call("Input.dispatchMouseEvent", type="mouseWheel", x=point[0], y=point[1],
                  deltaX=0, deltaY=down, modifiers=modifiers)  # fmt: skip

    def touch(self, kind: str, points: Sequence[tuple[float, float]] = ()) -> None:
        """Send a touch of the given *kind*, touchStart, touchMove or touchEnd."""
        marks = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
        self.call("Input.dispatchTouchEvent", type=kind, touchPoints=marks)

    def key(self, key: str, *, modifiers: int = 0) -> None:
        """Press and release a key, named as in KeyboardEvent.key."""
        typed = key if len(key) == 1 and not modifiers & (CTRL | ALT | META) else ""
        code = _CODES.get(key, ord(key.upper()) if len(key) == 1 else 0)
        common = {"key": key, "windowsVirtualKeyCode": code, "modifiers": modifiers}
        kind = "keyDown" if typed else "rawKeyDown"
        self.call("Input.dispatchKeyEvent", type=kind, text=typed, **common)
        self.call("Input.dispatchKeyEvent", type="keyUp", **common)

    def type(self, text: str) -> None:
        """Type *text* into the field that has the focus."""
        self.call("Input.insertText", text=text)

    def choose_files(self, selector: str, *paths: Path) -> None:
        """Choose files in an <input type="file">."""
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        node = self.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.call("DOM.setFileInputFiles", nodeId=node, files=[str(path) for path in paths])

    def save_downloads(self, folder: Path) -> None:
        """Save downloads into *folder*, under their suggested names."""
        self.browser.call("Browser.setDownloadBehavior", behavior="allow",
                          browserContextId=self.context, downloadPath=str(folder))  # fmt: skip

    def picture(self, path: Path) -> None:
        """Save a PNG of the page."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        Path(path).write_bytes(base64.b64decode(data))

    def close(self) -> None:
        """Close the page, and all that are beside it; forget what it wrote."""
        if self._is_first:
            self.browser.call("Target.disposeBrowserContext", browserContextId=self.context)
        else:
            self.browser.call("Target.closeTarget", targetId=self._target)
        kept = [each for each in self.browser.events if each.get("sessionId") != self._session]
        self.browser.events[:] = kept

    def _mouse(self, kind: str, point: tuple[float, float], button: str, modifiers: int) -> None:
        held = 0 if kind == "mouseReleased" else _BUTTONS[button]
        clicks = int(kind != "mouseMoved")
        self.call("Input.dispatchMouseEvent", type=kind, x=point[0], y=point[1], button=button,
                  buttons=held, modifiers=modifiers, clickCount=clicks)  # fmt: skip
