"""Pictures and the gallery, made before Sphinx reads the pages; only if the code is newer.

    docs/figures/*.png            the pictures of the pages       `making.figures`, `making.by_hand`
    docs/gallery/*.rst, *.png     a page for each of `examples/`  `making.gallery`

Each example runs in a process of its own, as it would by itself.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.display import status_iterator

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
EXAMPLES = ROOT / "examples"
FIGURES, GALLERY = DOCS / "figures", DOCS / "gallery"


def make(app: Sphinx) -> None:
    """Make whatever is missing, or older than the code it comes from."""
    from making import by_hand, figures, gallery

    for folder in (FIGURES, GALLERY):
        folder.mkdir(exist_ok=True)
    stale = [name for name in figures.FIGURES if is_old(figures.files(name)[-1], "figures")]
    jobs = [("figures", stale)] if stale else []
    if is_old(f"{by_hand.PICTURES[-1]}.png", "by_hand"):
        jobs.append(("by_hand", []))
    jobs += [("gallery", [path.stem]) for path in gallery.examples() if is_old_page(path)]
    for module, names in status_iterator(
        jobs, "drawing... ", "brown", len(jobs), app.verbosity, lambda job: " ".join(job[1])
    ):
        run(module, *names)
    gallery.write_index()


def is_old(picture: str, module: str) -> bool:
    """Tell whether a picture is missing, or older than what draws it."""
    makers = ("made", "scene", "plots", module)
    return older(FIGURES / picture, [DOCS / "making" / f"{name}.py" for name in makers])


def is_old_page(example: Path) -> bool:
    """Tell whether the page of an example is missing, or older than what it shows."""
    return older(GALLERY / f"{example.stem}.rst", [example, DOCS / "making" / "gallery.py"])


def older(product: Path, makers: list[Path]) -> bool:
    """Tell whether *product* is not there, or older than one of its makers or any of our code."""
    code = [
        path for folder in ("vtk_segdeform", "widgets") for path in ROOT.glob(f"{folder}/**/*.py")
    ]
    newest = max(path.stat().st_mtime for path in [*makers, *code])
    return not product.exists() or product.stat().st_mtime < newest


def run(module: str, *names: str) -> None:
    """Let a module of this folder make something, off-screen."""
    unseen = {"PYVISTA_OFF_SCREEN": "true", "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        unseen["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"
    paths = os.pathsep.join([str(DOCS), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", f"making.{module}", *names],
        env={**os.environ, **unseen, "PYTHONPATH": paths}, cwd=DOCS,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise ExtensionError(f"making.{module} {names} failed:\n{done.stdout}{done.stderr}")


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx."""
    app.connect("builder-inited", make)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
