"""The pictures in ``docs/figures``, drawn before Sphinx reads the pages if the code is newer.

`making.figures` and `making.by_hand` draw them.
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
FIGURES = DOCS / "figures"


def make(app: Sphinx) -> None:
    """Draw the pictures that are missing or older than the code."""
    from making import by_hand, figures

    FIGURES.mkdir(exist_ok=True)
    stale = [name for name in figures.FIGURES if is_old(figures.files(name)[-1], "figures")]
    jobs = [("figures", stale)] if stale else []
    if is_old(f"{by_hand.PICTURES[-1]}.png", "by_hand"):
        jobs.append(("by_hand", []))
    for module, names in status_iterator(
        jobs, "drawing... ", "brown", len(jobs), app.verbosity, lambda job: " ".join(job[1])
    ):
        run(module, *names)


def is_old(picture: str, module: str) -> bool:
    """Tell whether a picture is missing, or older than the module that draws it."""
    makers = ("made", "scene", "plots", module)
    return older(FIGURES / picture, [DOCS / "making" / f"{name}.py" for name in makers])


def older(product: Path, makers: list[Path]) -> bool:
    """Tell whether *product* is missing, or older than *makers* or the package."""
    code = [
        path for folder in ("vtk_segdeform", "widgets") for path in ROOT.glob(f"{folder}/**/*.py")
    ]
    newest = max(path.stat().st_mtime for path in [*makers, *code])
    return not product.exists() or product.stat().st_mtime < newest


def run(module: str, *names: str) -> None:
    """Run a module of this folder in a process of its own."""
    paths = os.pathsep.join([str(DOCS), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", f"making.{module}", *names],
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": paths}, cwd=DOCS,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise ExtensionError(f"making.{module} {names} failed:\n{done.stdout}{done.stderr}")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.connect("builder-inited", make)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
