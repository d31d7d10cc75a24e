"""Notebooks in a real JupyterLab: cells by keys, the editor in their output by the mouse.

JupyterLab is no dependency of the tests.  It is found beside their Python or on the path; the
kernel is always that of the tests' Python.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import pytest

pytest.importorskip("trame")
pytest.importorskip("ipykernel", reason="Jupyter is missing: pip install ipykernel nbclient")
pytest.importorskip("nbclient", reason="Jupyter is missing: pip install ipykernel nbclient")
import nbformat
from chromium import SHIFT, Chromium, Page, needs_chromium
from notebooks import EXAMPLE
from web_hands import pull, rested

_BESIDE = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
_LAB = shutil.which("jupyter-lab", path=_BESIDE)
pytestmark = [
    pytest.mark.campaign,
    needs_chromium,
    pytest.mark.skipif(_LAB is None, reason="JupyterLab is missing: pip install jupyterlab"),
]
_SHORT = [
    "import vtk_segdeform as sd\nmesh = sd.models.cactus()\neditor = sd.edit(mesh)\neditor",
    "editor.session.history.position",
    "editor.session.volume_change",
    "float(abs(editor.mesh.vertices - mesh.vertices).max() / mesh.diagonal)",
    "editor.session.regions.n_regions",
]
_QUIET = {"@jupyterlab/apputils-extension:notification": {"fetchNews": "false"}}
_READY = "!!document.querySelector('#jp-bottom-panel')?.textContent.includes('Python 3 | Idle')"
_FRAME = ".jp-Notebook iframe"


class Lab:
    """``jupyter lab`` on a folder of notebooks, without files or settings of the user."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.token = folder / "notebooks", secrets.token_hex(16)
        kernel = folder / "path" / "kernels" / "python3"
        settings = folder / "config" / "labconfig"
        for each in (self.folder, kernel, settings):
            each.mkdir(parents=True)
        (settings / "default_setting_overrides.json").write_text(json.dumps(_QUIET))
        command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        spec = {"argv": command, "display_name": "Python 3", "language": "python"}
        (kernel / "kernel.json").write_text(json.dumps(spec))
        own = {f"JUPYTER_{name.upper()}_DIR": str(folder / name)
               for name in ("config", "data", "runtime")}  # fmt: skip
        env = {
            **os.environ,
            **own,
            "HOME": str(folder),
            "TMPDIR": str(folder),
            "IPYTHONDIR": str(folder / "ipython"),
            "JUPYTER_PATH": str(folder / "path"),
        }
        assert _LAB is not None
        self.log = folder / "log.txt"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [_LAB, "--no-browser", "--allow-root", "--ServerApp.port=0",
                 f"--ServerApp.root_dir={self.folder}", f"--IdentityProvider.token={self.token}",
                 "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate"],
                env=env, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
            )  # fmt: skip
        self._runtime, self.url = folder / "runtime", ""

    def wait(self) -> None:
        """Wait until the server answers."""
        deadline = time.monotonic() + 120
        while not self.url:
            for file in self._runtime.glob("jpserver-*.json"):
                with suppress(ValueError, OSError):
                    url = json.loads(file.read_text())["url"]
                    urllib.request.urlopen(f"{url}api", timeout=20).close()
                    self.url = url
            assert self.process.poll() is None, self.log.read_text()
            assert time.monotonic() < deadline, self.log.read_text()
            time.sleep(0.1)

    def add(self, name: str, cells: Sequence[str]) -> None:
        """Write a notebook."""
        notebook = nbformat.read(EXAMPLE, as_version=4)  # for its kernel
        notebook.cells = [nbformat.v4.new_code_cell(source) for source in cells]
        nbformat.write(notebook, self.folder / name)

    def open(self, browser: Chromium, name: str) -> Notebook:
        """Open a notebook, alone in a workspace, and wait for its kernel."""
        workspace = f"workspaces/{secrets.token_hex(4)}"
        page = browser.page(f"{self.url}lab/{workspace}/tree/{name}?token={self.token}")
        page.wait(_READY, 60.0)
        return Notebook(page)

    def close(self) -> None:
        """End the server, and its kernels with it."""
        self.process.terminate()
        self.process.wait(60)


class Notebook:
    """A notebook in a page, whose cells are run by keys."""

    def __init__(self, page: Page) -> None:
        self.page, self._next = page, 0

    @property
    def _cell(self) -> str:
        return f"document.querySelectorAll('.jp-Notebook .jp-Cell')[{self._next}]"

    def select(self) -> None:
        """Click beside the cell that is run next, which gives the focus to the notebook."""
        self.page.evaluate(f"{self._cell}.scrollIntoView({{block: 'center'}})")
        x, y = self.page.evaluate(
            f"(() => {{ const b = {self._cell}.getBoundingClientRect();"
            " return [b.left + 20, b.top + 12]; })()"
        )
        self.page.click((x, y))
        self.page.wait(f"{self._cell}.classList.contains('jp-mod-active') && "
                       "!!document.activeElement.closest('.jp-Notebook')")  # fmt: skip

    def run(self) -> str:
        """Run the next code cell, and the text before it; return what it shows."""
        is_code = False
        while not is_code:
            cell = self._cell
            self._next += 1
            self.page.key("Enter", modifiers=SHIFT)
            is_code = self.page.evaluate(f"{cell}.classList.contains('jp-CodeCell')")
        prompt = f"{cell}.querySelector('.jp-InputPrompt').textContent"
        self.page.wait(f"/\\[\\d+\\]/.test({prompt})", 60.0)
        shown = f"{cell}.querySelector('.jp-OutputArea-output:last-child')"
        return str(self.page.evaluate(f"{shown}.textContent")).strip()

    def editor(self) -> Page:
        """Return the frame of the editor that a cell shows, in view and ready to be used."""
        frame = f"document.querySelector('{_FRAME}')"
        self.page.wait(f"!!{frame}")
        found = self.page.frame(self.page.evaluate(f"{frame}.src"))
        rested(found)
        self.page.evaluate(f"{frame}.scrollIntoView({{block: 'center'}})")
        return found

    def point(
        self, frame: Page, selector: str, place: tuple[float, float] = (0.5, 0.5)
    ) -> tuple[float, float]:
        """Point at an element of the *frame*, at a fraction of its size; return where that is.

        The mouse reaches the frame at its new place only after the browser has drawn it there.
        """
        deadline = time.monotonic() + 30
        while True:
            left, top, _, _ = self.page.box(_FRAME)
            x, y, width, height = frame.box(selector)
            at = left + x + place[0] * width, top + y + place[1] * height
            self.page.move(at)
            if frame.evaluate(f'document.querySelector("{selector}").matches(":hover")'):
                return at
            assert time.monotonic() < deadline, selector
            time.sleep(0.05)

    def pull(self, frame: Page) -> None:
        """Pull the trunk of the cactus in the *frame* to the right."""
        pull(self.page, self.point(frame, ".sd-canvas", (0.5, 0.3)), (90.0, -10.0), frame)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    lab = Lab(tmp_path_factory.mktemp("lab"))
    try:
        lab.wait()
        yield lab
    finally:
        lab.close()


def _errors(page: Page) -> list[str]:
    """Return what the page has reported, but for requests that are answered by a refusal."""
    wrong = [m for m in page.messages() if m.startswith("error")]
    return [m for m in wrong if not m.startswith("error: Failed to load resource")]


def test_a_pull_and_regions_by_mouse_are_there_in_the_next_cells(
    lab: Lab, browser: Chromium, tmp_path: Path
) -> None:
    lab.add("short.ipynb", _SHORT)
    notebook = lab.open(browser, "short.ipynb")
    notebook.select()
    notebook.run()
    frame = notebook.editor()
    notebook.pull(frame)
    picture = tmp_path / "pulled.png"
    notebook.page.picture(picture)
    notebook.select()
    position, volume, moved = (float(notebook.run()) for _ in range(3))
    print(f"position {position:g}, volume change {volume:.1e}, moved {moved:.3f}; {picture}")
    assert position == 1
    assert abs(volume) < 1e-12
    assert moved > 0.05

    notebook.editor()
    regions = "[data-name='mode.regions']"
    notebook.page.click(notebook.point(frame, regions))
    frame.wait(f'document.querySelector("{regions}").classList.contains("down")')
    notebook.page.key("g")
    frame.wait("document.querySelector('.sd-hint').textContent.includes('regions found')", 60.0)
    rested(frame)
    notebook.select()
    assert int(notebook.run()) == 3
    assert _errors(notebook.page) == _errors(frame) == []
    notebook.page.close()


def test_the_example_is_run_by_keys_and_pulled_by_the_mouse_on_its_way(
    lab: Lab, browser: Chromium
) -> None:
    shutil.copy(EXAMPLE, lab.folder)
    notebook = lab.open(browser, EXAMPLE.name)
    notebook.select()
    assert int(notebook.run()) == 3
    notebook.run()
    frame = notebook.editor()
    notebook.pull(frame)
    notebook.select()
    position, volume, moved = (float(notebook.run()) for _ in range(3))
    print(f"position {position:g}, volume change {volume:.1e}, moved {moved:.3f}")
    assert position == 4  # regions, cages, the pull by mouse, the pull by script
    assert abs(volume) < 1e-12
    assert moved > 0.05
    assert _errors(notebook.page) == _errors(frame) == []
    notebook.page.close()
