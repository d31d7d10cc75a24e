"""Volume meshes bent by 60 degrees: inner points by ours, radial basis functions, elasticity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv
from scipy import sparse
from scipy.interpolate import RBFInterpolator
from scipy.sparse.linalg import LinearOperator, cg

from ..arrays import BoolArray, FloatArray
from ..deformer import deform
from ..inside import VolumeMesh, edges, hat_gradients
from ..io import to_polydata
from ..mesh import Mesh
from ..models import cactus, random_limbs
from ..progress import Progress, tell
from .measuring import timed
from .results import Cell, Scale, Section, Table
from .tasks import Hand

_COLUMNS = ("body", "cells", "inner points by", "inverted", "scaled Jacobian / rest", "seconds")
_CENTRES = 1500  # of radial basis functions
_POISSON = 0.3
_TEXT = """\
The surface of each mesh is bent by 60 degrees, the same for all methods, and the inner points \
follow. *Radial basis functions*: thin plate splines through at most 1,500 points of the surface. \
*Linear elasticity*: linear elements with a Poisson ratio of 0.3, solved to 1e-6. *Inverted* are \
cells whose scaled Jacobian is 0 or less; the next column is the smallest one divided by that at \
rest. Seconds are of the processor, without the surface."""


def run(scale: Scale, progress: Progress | None = None) -> Section:
    """Return a table with three methods for every body."""
    rows: list[tuple[Cell, ...]] = []
    count = {"quick": 3000, "full": 100_000}.get(scale.name, 20_000)
    bodies = bodies_of(count)
    for k, (name, grid) in enumerate(bodies.items()):
        tell(progress, k / len(bodies), f"inside of {name}")
        rows += measured(name, grid)
    return Section("Volume meshes", _TEXT, [Table(_COLUMNS, rows, "cells after a bend")])


def bodies_of(count: int) -> dict[str, pv.UnstructuredGrid]:
    """Return meshes of about *count* cells: a bar of each kind, and hexahedra inside of bodies."""
    along = max(8, round((16.0 * count) ** (1.0 / 3.0)))
    shape = (along // 4 + 1, along // 4 + 1, along + 1)
    lattice = pv.ImageData(dimensions=shape, spacing=(1.0 / along,) * 3)
    blocks = lattice.cast_to_structured_grid().cast_to_unstructured_grid()
    small = pv.ImageData(dimensions=[round(0.55 * (n - 1)) + 1 for n in shape])
    tetrahedra = small.cast_to_structured_grid().cast_to_unstructured_grid().triangulate()
    return {
        "bar, hexahedra": blocks,
        "bar, tetrahedra": tetrahedra,
        "cactus, hexahedra": _blocks_inside(cactus(2000), count),
        "limbs, hexahedra": _blocks_inside(random_limbs(2000, seed=3), count),
    }


def _blocks_inside(body: Mesh, count: int) -> pv.UnstructuredGrid:
    """Return the largest part of the blocks whose centres are inside of *body*."""
    surface = to_polydata(body)
    step = (float(surface.volume) / count) ** (1.0 / 3.0)
    low, size = body.vertices.min(axis=0), np.ptp(body.vertices, axis=0)
    lattice = pv.ImageData(dimensions=np.ceil(size / step).astype(int) + 1, spacing=(step,) * 3)
    lattice.origin = low
    blocks = lattice.cast_to_structured_grid().cast_to_unstructured_grid()
    inside = blocks.cell_centers().select_interior_points(surface)["selected_points"]
    return blocks.extract_cells(np.flatnonzero(inside)).connectivity("largest")


def measured(name: str, grid: pv.UnstructuredGrid) -> list[tuple[Cell, ...]]:
    """Return the rows of one body."""
    volume = VolumeMesh(grid)
    mesh = volume.surface.mesh
    hand = Hand.on(mesh)
    x = deform(mesh, hand.fixed, hand.handle, hand.targets(np.radians(60.0))).vertices
    rest = np.array(volume.grid.points, dtype=float)
    start = np.asarray(volume.surface.moved(x).points, dtype=float)
    inner = np.ones(len(rest), dtype=bool)
    inner[volume.corners.faces] = False
    methods: dict[str, Callable[[], FloatArray]] = {
        "vtk_segdeform": lambda: volume.pose(x).points,
        "radial basis functions": lambda: by_radial_functions(rest, start, inner),
        "linear elasticity": lambda: by_elasticity(volume, rest, start, inner),
    }
    rows: list[tuple[Cell, ...]] = []
    before = volume.corners.scaled_jacobians(rest, grid.n_cells).min()
    for method, solve in methods.items():
        points, seconds = timed(solve)
        after = volume.corners.scaled_jacobians(points, grid.n_cells)
        count = int(np.count_nonzero(after <= 0.0))
        rows.append((name, grid.n_cells, method, count, float(after.min() / before), seconds))
    return rows


def by_radial_functions(rest: FloatArray, start: FloatArray, inner: BoolArray) -> FloatArray:
    """Return *start* (p, 3) with the *inner* points moved as the others around them."""
    outer = np.flatnonzero(~inner)
    centres = outer[:: -(-len(outer) // _CENTRES)]
    moves = RBFInterpolator(rest[centres], (start - rest)[centres])
    result = start.copy()
    result[inner] = rest[inner] + moves(rest[inner])
    return result


def by_elasticity(
    volume: VolumeMesh, rest: FloatArray, start: FloatArray, inner: BoolArray
) -> FloatArray:
    """Return *start* (p, 3) with the *inner* points in balance, in linear elasticity."""
    corners = volume.corners
    used = corners.volumes > 0.0
    ids, hats = corners.points[used], hat_gradients(edges(rest, corners.points[used]))
    places = np.repeat(np.arange(hats.size // 4), 4), np.repeat(ids, 3, axis=0).ravel()
    gradient = sparse.csr_array((hats.ravel(), places), (hats.size // 4, len(rest)))
    back, volumes = gradient.T.tocsr(), corners.volumes[used][:, None, None]
    lame = 2.0 * _POISSON / (1.0 - 2.0 * _POISSON)
    n_inner = int(np.count_nonzero(inner))

    def forces(moves: FloatArray) -> FloatArray:
        change = np.asarray(gradient @ moves).reshape(-1, 3, 3)
        trace = np.einsum("cii->c", change)[:, None, None]
        stress = change + np.swapaxes(change, 1, 2) + lame * trace * np.eye(3)
        return np.asarray((back @ (volumes * stress).reshape(-1, 3))[inner].ravel())

    def of_inner(moves: FloatArray) -> FloatArray:
        whole = np.zeros_like(rest)
        whole[inner] = moves.reshape(-1, 3)
        return forces(whole)

    given = np.where(inner[:, None], 0.0, start - rest)
    matrix = LinearOperator((3 * n_inner, 3 * n_inner), of_inner, dtype=np.float64)
    found, _ = cg(matrix, -forces(given), rtol=1e-6)
    result = start.copy()
    result[inner] = rest[inner] + found.reshape(-1, 3)
    return result
