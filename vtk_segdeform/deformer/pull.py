"""One point pulled, in one call: segment, fit cages, bind, solve."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from numpy.typing import ArrayLike

from ..cages import fit_cages, require_cage_vertices, suggested_size
from ..checks import as_flag
from ..errors import ConstraintError
from ..geometry import Attach
from ..mesh import Mesh, SurfacePoint, require_mesh
from ..progress import Progress
from ..regions import segment
from ..solver import Solution
from .arguments import (
    SPREAD,
    as_lids,
    automatic_locality,
    checked_constraints,
    checked_hinge,
    checked_limb,
    checked_locality,
    checked_place,
    checked_point,
    checked_radius,
    fault_of_grab,
)
from .deform import checked_refine, finished, is_finished, stages_of
from .deformer import Deformer
from .enclosed_volume import changing_components
from .slides import Slide, checked_slides
from .stiffness import Stiffness
from .symmetry import Symmetry
from .volume_goals import Goals, checked_goals


def pull(
    mesh: Mesh,
    vertex: int | ArrayLike | SurfacePoint,
    to: ArrayLike,
    radius: float | None = None,
    *,
    pins: ArrayLike = (),
    locality: float | None = None,
    limb: int | None = None,
    hinge: float = 0.0,
    n_regions: int | None = None,
    n_cage_vertices: int | None = None,
    volumes: Goals | None = None,
    parts: Mapping[str, ArrayLike] | None = None,
    stiffness: ArrayLike | None = None,
    slides: Iterable[Slide] = (),
    symmetry: Symmetry = None,
    lids: bool | None = None,
    avoid_contact: bool = False,
    attach: Attach | None = None,
    refine: bool | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Return *mesh* with one point pulled to another place, its detail and its volume preserved.

    For one pull only.  `Session.pull` adds one to another.

    Parameters
    ----------
    mesh : Mesh
        n vertices.  ``sd.pull`` takes any surface, with vertices numbered as in what is given: a
        PolyData or another surface of VTK, a ``trimesh.Trimesh``, a ``meshio.Mesh``, a pair
        (vertices, faces) or a path.  It returns a `Deformed`, whose `mesh` is the same, deformed.
        Of a grid of tetrahedra, hexahedra, wedges or pyramids the inside follows; see `VolumeMesh`.
    vertex : int, (3,) float or SurfacePoint
        The grabbed vertex, or another point of the surface, which the pull moves as exactly: if
        a position is given, the nearest one.
    to : (3,) float
        Where it is pulled to.
    radius : float, optional
        Of the pulled surface, in the mesh's unit; by default 15 % of the mesh's diagonal.
    pins : (k,) int or (n,) bool
        Vertices that stay in place.  With three or more the surface between them is free.
    locality : float, optional
        1 keeps the surface in place; beyond four radii, of 10 % of the diagonal or more, it hardly
        moves.  With less, more of it follows, above all the ends of limbs; with less than 0.2 also
        the body that the pulled limb is on; with 0 all is free.  By default 0.2 without pins, 0.05
        with one or two, and 0 with more.
    limb : int, optional
        The limb that moves, up to its joint, by its number in `Deformer.limbs`: 0 is the smallest
        one of the point, and beyond the last one is the whole body.  By default the first one that
        is longer than half the radius.
    hinge : float
        0 to 1: where that limb bends, with 0 along its length, with 1 at its joint only.
    n_regions : int or None
        How many regions; None lets `segment` choose.
    n_cage_vertices : int, optional
        Total number of cage vertices; by default it follows the number of regions.
    volumes, parts : mappings, optional
        Goals for volumes, by name, and named parts of the surface; see `Deformer`.
    stiffness : (n,) float, optional
        Of each vertex, relative to the others; infinite where the surface is rigid.
    slides : sequence of Slide, optional
        Vertices that move along a plane, a line or the surface at rest only.
    symmetry : str or pair of (3,) float, optional
        The plane about which motions are mirrored: "x", "y", "z", "auto", or a point and a normal.
    lids : bool or None
        Whether an open surface encloses a volume under lids over its borders; see `Deformer`.
    avoid_contact : bool
        Keep parts of the surface from crossing each other; see `Deformer`.
    attach : mapping of int to int or "free", optional
        The components that others follow, as of `deform`.  Those with pins are no exception: a pull
        moves all that lies together.
    refine : bool or None
        Whether to finish the pose on the mesh itself, within the reach of the pull; see `deform`.
        None does so only with *avoid_contact*, and to place rigid, sliding and mirrored vertices
        exactly: triangles are less distorted then, but a smooth bend may get a step where the
        finish ends.
    progress : Progress, optional
        Called with the fraction done, 0 to 1, and a text, while cages are fitted and bound, and
        before every step.  It cancels by raising `Cancelled`.

    Returns
    -------
    Solution

    Raises
    ------
    ConstraintError
        If *vertex*, *to*, *radius*, *pins*, *locality*, *limb* or *hinge* are invalid, or the faces
        at the grabbed point are so large that no vertex is within the radius.
    Cancelled
        If *progress* raised it.

    Examples
    --------
    >>> import vtk_segdeform as sd
    >>> ball = sd.models.sphere(600)
    >>> top = int(ball.vertices[:, 2].argmax())
    >>> solution = sd.pull(ball, top, ball.vertices[top] + [0.0, 0.0, 0.5])
    >>> abs(solution.volume_change) < 1e-12
    True
    """
    require_mesh(mesh)
    as_lids(lids)
    as_flag(avoid_contact, "avoid_contact")
    checked_refine(refine)
    slides, stiff = checked_slides(mesh, slides), Stiffness.of(mesh, stiffness)
    is_rigid = stiff is not None and bool(stiff.rigid)
    if refine is None and not (avoid_contact or slides or is_rigid or symmetry is not None):
        refine = False
    point = checked_place(mesh, vertex)
    fixed, handle = checked_constraints(mesh, pins, [point.vertex], "pins")
    target = checked_point(to)[None] - point.at(mesh.vertices) + mesh.vertices[handle]
    radius, locality = checked_radius(mesh, radius), checked_locality(locality)
    limb, hinge = checked_limb(limb), checked_hinge(hinge)
    if fault := fault_of_grab(mesh, point, radius):
        raise ConstraintError(fault)
    if locality is None:
        locality = automatic_locality(len(fixed))
    stages = iter(stages_of(progress, finishes=is_finished(mesh, refine)))
    apart = changing_components(mesh, lids, checked_goals(volumes))
    regions = segment(mesh, n_regions, attach=attach, apart=apart, progress=next(stages))
    size = suggested_size(regions) if n_cage_vertices is None else n_cage_vertices
    require_cage_vertices(size, regions.n_regions, "n_cage_vertices")
    cages = fit_cages(mesh, regions, size, progress=next(stages))
    deformer = Deformer(
        mesh, regions, cages, fixed=fixed, handle=handle, lids=lids, volumes=volumes, parts=parts,
        stiffness=stiffness, slides=slides, symmetry=symmetry, avoid_contact=avoid_contact,
        progress=next(stages),
    )  # fmt: skip
    reach, follows, depth = deformer.reach_of_pull(point, radius, locality, limb)
    deformer = deformer.local(
        point, reach, SPREAD * radius, follows=follows, depth=depth, hinge=hinge
    )
    solution = deformer.solve(target, progress=next(stages))
    return finished(deformer, solution, refine, progress=next(stages))
