"""Bend a dense closed mesh by hand while its detail and its volume stay."""

from __future__ import annotations

from pathlib import Path as _Path

# Source checkout: the folder ``widgets/`` beside this package is the subpackage
# ``vtk_segdeform.widgets`` (package_dir in setup.cfg).  An installed package has it inside.
_root = _Path(__file__).resolve().parent.parent
if not (_root / "vtk_segdeform" / "widgets").exists() and (_root / "setup.cfg").is_file():
    __path__.append(str(_root))
del _Path, _root

__version__ = "0.1.0"
