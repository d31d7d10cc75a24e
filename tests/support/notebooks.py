"""A kernel whose cells a test runs one by one, and the example notebook."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "in_a_notebook.ipynb"


class Kernel:
    """A running kernel of its own, in a private folder for temporary files."""

    def __init__(self, client: NotebookClient) -> None:
        self._client = client

    def run(self, source: str) -> Any:
        """Run a cell; return its outputs, or raise the error in it."""
        cell = nbformat.v4.new_code_cell(source)
        self._client.nb.cells.append(cell)
        self._client.execute_cell(cell, len(self._client.nb.cells) - 1)
        return cell.outputs

    def value(self, source: str) -> str:
        """Return the value of the last expression of a cell, as text."""
        return str(self.run(source)[-1]["data"]["text/plain"])

    def html(self, source: str) -> str:
        """Return all HTML that a cell shows."""
        return " ".join(output.get("data", {}).get("text/html", "") for output in self.run(source))

    def wait(self, condition: str, seconds: float = 60.0) -> None:
        """Wait until the expression *condition* is true in the kernel, which idles meanwhile."""
        deadline = time.monotonic() + seconds
        while self.value(f"bool({condition})") != "True":
            assert time.monotonic() < deadline, condition
            time.sleep(0.05)


@contextmanager
def kernel(folder: Path) -> Iterator[Kernel]:
    """Run a kernel, with *folder* for its temporary files."""
    env = {**os.environ, "TMPDIR": str(folder), "IPYTHONDIR": str(folder / "ipython")}
    client = NotebookClient(nbformat.v4.new_notebook(), timeout=200, kernel_name="python3")
    with client.setup_kernel(env=env):
        yield Kernel(client)


def example(change: Callable[[str], str] = str) -> list[str]:
    """Return the code of the example's cells, each changed by *change*."""
    cells = nbformat.read(EXAMPLE, as_version=4).cells
    return [change(cell.source) for cell in cells if cell.cell_type == "code"]
