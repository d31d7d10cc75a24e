"""The pictures of Sphinx-Gallery: whatever an example writes to the folder in ``sys.argv[1]``.

An example without pictures of its own is shown by its mesh before and after the deformation.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from sphinx_gallery.scrapers import figure_rst

from making.made import DOCS
from vtk_segdeform.pictures import picture_before_after

FOLDER = DOCS / "build" / "example-output"


def arguments(conf: dict[str, Any], script: dict[str, Any]) -> list[str]:
    """Return the arguments of an example: an empty folder for its pictures."""
    del conf, script
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    return [str(FOLDER)]


def pictures(block: object, script: dict[str, Any], conf: dict[str, Any]) -> str:
    """Move the pictures of an example into the gallery, and return them as reStructuredText."""
    del block
    found = sorted(path for path in FOLDER.iterdir() if path.suffix in {".png", ".gif"})
    names = script["example_globals"]
    if not found and "solution" in names:
        found = [FOLDER / "pose.png"]
        handle = np.atleast_1d(names.get("tip", [])).astype(int)
        ends = {"fixed": names.get("foot", []), "handle": handle}
        picture_before_after(found[0], names["mesh"], names["solution"].vertices, **ends)
    places = []
    for path, place in zip(found, script["image_path_iterator"], strict=False):
        places.append(Path(place).with_suffix(path.suffix))
        shutil.move(path, places[-1])
    return str(figure_rst(places, conf["src_dir"]))
