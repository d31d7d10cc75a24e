"""The command ``subdivide``: long edges are split, for pulls in the middle of large faces.

The points that were given come first, in their order; the shape does not change.
"""

from __future__ import annotations

from argparse import Namespace

from .. import io
from ..errors import ConstraintError
from ..io import Surface
from ..progress import Progress
from .outputs import Say, report_surface

_LEAST, _MOST = 0.5, 100.0  # per cent; shorter edges make millions of triangles of any body
_PASSES = 100  # each halves edges


def subdivide(options: Namespace, say: Say, progress: Progress) -> bool:
    """Split the edges of a surface until none is longer than a share of its diagonal."""
    io.require_writable(options.output)
    if not _LEAST <= options.edge <= _MOST:
        raise ConstraintError(f"--edge must be from {_LEAST} to {_MOST:.0f}; got {options.edge}")
    surface = Surface.read(options.input)
    report_surface(surface, say)
    given = surface.given
    longest = 0.01 * options.edge * surface.mesh.diagonal
    split = given.triangulate().subdivide_adaptive(max_edge_len=longest, max_n_passes=_PASSES)
    progress(0.9, "writing")
    say(f"points          {split.n_points}, from {given.n_points}")
    say(f"triangles       {split.n_cells}")
    if given.n_lines + given.n_verts:
        say(f"left out        {given.n_lines + given.n_verts} lines and vertex cells")
    io.write_mesh(options.output, split)
    say(f"written         {options.output}")
    return True
