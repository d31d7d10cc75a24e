"""The gallery: each of `examples/` runs, and its page has its pictures, its words and its code.

``python -m making.gallery NAME`` makes the page of one.  An example that draws is called with a
folder and leaves its pictures there; of grids that it leaves a picture is made; and one that only
computes is shown by the mesh and the pose that it ends with.  Those in Qt, which take a screen, do
not run: their picture is in `docs/pictures`.
"""

from __future__ import annotations

import ast
import contextlib
import io
import os
import runpy
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import pyvista as pv

from making.made import DOCS, EXAMPLES
from making.made import GALLERY as FOLDER
from vtk_segdeform.pictures.canvas import view_of, write_panels
from vtk_segdeform.pictures.palette import BODY
from vtk_segdeform.pictures.pictures import picture_before_after

FROM_FIGURES = {"with_and_without_volume": ["exact_volume-1", "exact_volume-2"]}
_DRAWN = {".png", ".gif"}


def examples() -> list[Path]:
    """Return the programs of `examples/`, in order."""
    return sorted(EXAMPLES.glob("*.py"))


def make_page(name: str) -> None:
    """Run an example, if it can be run here, and write its page."""
    source = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    tree = ast.parse(source)
    words = ast.get_docstring(tree) or ""
    begins = tree.body[1].lineno
    title = name.replace("_", " ").capitalize()
    pictures, printed = ([], "") if "import qtpy" in source or "from qtpy" in source else run(name)
    pictures += [f"/figures/{figure}.png" for figure in FROM_FIGURES.get(name, ())]
    if not pictures:
        kept = [DOCS / "pictures" / f"{name.replace('_', '-')}.png"]
        pictures = [f"/pictures/{path.name}" for path in kept if path.exists()]
    lines = [
        title,
        "=" * len(title),
        "",
        *as_paragraphs(words),
        "",
        ".. container:: panels wide",
        "",
    ]
    lines += [f"   .. image:: {picture}\n      :alt: {title}\n" for picture in pictures]
    if printed:
        lines += ["It prints", "", ".. code-block:: text", "", indented(printed), ""]
    lines += [
        f"``examples/{name}.py``:",
        "",
        f".. literalinclude:: ../../examples/{name}.py",
        "   :language: python",
        f"   :lines: {begins}-",
        "",
    ]
    (FOLDER / f"{name}.rst").write_text("\n".join(lines), encoding="utf-8")


def run(name: str) -> tuple[list[str], str]:
    """Run an example; return the pictures that are kept of it, and what it printed."""
    said = io.StringIO()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        sys.argv = [name, place]
        with inside(folder), contextlib.redirect_stdout(said):
            names = runpy.run_path(str(EXAMPLES / f"{name}.py"))
        draw_grids(folder)
        left = sorted(path for path in folder.iterdir() if path.suffix in _DRAWN)
        if not left and name not in FROM_FIGURES:
            left = [draw_pose(folder / "pose.png", names)]
        for old in FOLDER.glob(f"{name}--*"):
            old.unlink()
        kept = [FOLDER / f"{name}--{path.name}" for path in left]
        for path, copy in zip(left, kept, strict=True):
            shutil.copyfile(path, copy)
    return [path.name for path in kept], said.getvalue().rstrip()


def draw_pose(path: Path, names: dict[str, Any]) -> Path:
    """Draw the mesh and the solution that a program ends with."""
    held = {"fixed": names["foot"], "handle": names["tip"]}
    picture_before_after(path, names["mesh"], names["solution"].vertices, **held)
    return path


def draw_grids(folder: Path) -> None:
    """Draw the grids in a folder, from one place."""
    grids = {path: pv.read(path) for path in sorted(folder.glob("*.vtu"), reverse=True)}
    if not grids:
        return
    seen = pv.merge(list(grids.values())).points.astype(float)
    for number, grid in enumerate(grids.values()):

        def draw(plotter: pv.Plotter, grid: Any = grid) -> None:
            plotter.add_mesh(grid, color=BODY, show_edges=True, line_width=1.5)

        write_panels(folder / f"grid-{number}.png", [("", draw)], seen, view_of(seen, seen))


def as_paragraphs(words: str) -> list[str]:
    """Return a docstring as text of a page: its indented lines are commands."""
    lines = []
    for block in words.split("\n\n"):
        is_command = block.startswith(("    ", "python "))
        lines += [".. code-block:: text", "", indented(block)] if is_command else [block]
        lines.append("")
    return lines


def indented(text: str) -> str:
    """Return lines three spaces further in."""
    return "\n".join(f"   {line}" for line in text.splitlines())


@contextlib.contextmanager
def inside(folder: Path) -> Any:
    """Do something in a folder; Python has `contextlib.chdir` for it from 3.11 on."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def write_index() -> None:
    """Write the gallery's own page, a card for each example."""
    title = "Gallery"
    lines = [
        title, "=" * len(title), "",
        "What the programs in ``examples/`` make.  They ran when this page was built.", "",
        ".. container:: cards", "",
    ]  # fmt: skip
    for path in examples():
        page = (FOLDER / f"{path.stem}.rst").read_text(encoding="utf-8")
        pictures = [line.split(":: ")[1] for line in page.splitlines() if ".. image::" in line]
        if not pictures:
            raise FileNotFoundError(f"no picture of {path.name} in {DOCS / 'pictures'}")
        shown = pictures[-1] if path.stem != "editor_by_itself" else pictures[0]
        lines += [
            f"   .. figure:: {shown}", f"      :target: {path.stem}.html",
            f"      :alt: {page.splitlines()[0]}", "", f"      :doc:`{path.stem}`", "",
        ]  # fmt: skip
    lines += [".. toctree::", "   :hidden:", "", *(f"   {path.stem}" for path in examples()), ""]
    text = "\n".join(lines)
    index = FOLDER / "index.rst"
    if not index.exists() or index.read_text(encoding="utf-8") != text:
        index.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    make_page(sys.argv[1])
