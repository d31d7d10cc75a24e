"""What a worker computes: a block of poses of one mesh, each from rest.

What travels is the mesh with its regions and cages as bytes (`packed`), of a new mesh without
them, and poses by vertices; back come cage vertices.  A worker keeps the last two deformers, and
finds others by their bindings in the cache.
"""

from __future__ import annotations

import functools
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from multiprocessing import parent_process
from typing import Any, NamedTuple

import numpy as np

from ..arrays import FloatArray
from ..cages import Cage, fit_cages, suggested_size
from ..deformer import (
    SPREAD,
    Deformer,
    Mirror,
    Slide,
    Stiffness,
    automatic_locality,
    changing_components,
    checked_constraints,
    checked_goals,
    checked_locality,
    checked_place,
    checked_point,
    checked_radius,
    fault_of_grab,
    solved_along,
)
from ..errors import Cancelled, ConstraintError, SegDeformError
from ..files import cache_folder
from ..importing import imported
from ..kernels import load_for, one_thread, wait_until_compiled
from ..mesh import Mesh
from ..progress import Progress
from ..regions import Regions, segment
from ..solver import Solution
from .plan import Settings
from .random_poses import Skeleton, drawn

FAILED, TOO_LONG, SET_ASIDE = "failed", "too long", "set aside"
"""Statuses of poses that were not computed."""


class Row(NamedTuple):
    """The result of a pose: a row of the table, and its vertices."""

    status: str
    message: str = ""
    volume_change: float | None = None
    crossings: int | None = None
    folds: int | None = None
    steps: int | None = None
    draws: int | None = None
    """How often a random pose was drawn."""
    seconds: float = 0.0
    refined: bool = False
    data: bytes = b""
    """float64: the cage vertices (m, 3), or of a refined pose its vertices (n, 3).  After those of
    cages with rigid parts a bit for each vertex: whether it is rigid, which W~ depends on."""


def packed(mesh: Mesh, regions: Regions | None = None, cages: Sequence[Cage] = ()) -> bytes:
    """Return a mesh, and its regions and cages if they are known, as bytes: .npz."""
    arrays: dict[str, Any] = {"vertices": mesh.vertices, "faces": _small(mesh.faces)}
    if regions is not None:
        arrays["membership"] = np.packbits(regions.membership, axis=1)
        arrays["smoothness"] = np.array(float(regions.smoothness))
        for name in ("carrier", "leader"):
            if getattr(regions, name) is not None:
                arrays[name] = getattr(regions, name)
    for r, cage in enumerate(cages):
        arrays |= {f"cage{r}": cage.vertices, f"cage{r}_faces": _small(cage.faces)}
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpacked(data: bytes) -> tuple[Mesh, Regions | None, tuple[Cage, ...]]:
    """Return the mesh, the regions and the cages in *data*."""
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    mesh = Mesh(arrays["vertices"], arrays["faces"])
    if "membership" not in arrays:
        return mesh, None, ()
    membership = np.unpackbits(arrays["membership"], axis=1, count=mesh.n_vertices).astype(bool)
    regions = Regions(
        mesh, membership, float(arrays["smoothness"]), arrays.get("carrier"), arrays.get("leader")
    )
    count = len(membership)
    cages = (Cage(arrays[f"cage{r}"], arrays[f"cage{r}_faces"]) for r in range(count))
    return mesh, regions, tuple(cages)


@functools.lru_cache(maxsize=2)
def deformer_of(data: bytes) -> Deformer:
    """Return a deformer of a packed mesh with regions and cages, its binding from the cache."""
    mesh, regions, cages = unpacked(data)
    assert regions is not None
    return Deformer(mesh, regions, cages, cache=cache_folder())


@functools.lru_cache(maxsize=2)
def rigid_deformer_of(data: bytes, rigid: bytes) -> Deformer:
    """Return `deformer_of` the same with the W~ of *rigid* parts, a bit for each vertex."""
    deformer = deformer_of(data)
    bits = np.unpackbits(np.frombuffer(rigid, np.uint8), count=deformer.mesh.n_vertices)
    return deformer.stiffened(np.where(bits, np.inf, 1.0))


@functools.lru_cache(maxsize=2)
def _stiffened(deformer: Deformer, stiffness: bytes) -> Deformer:
    return deformer.stiffened(np.frombuffer(stiffness))


def compute(
    data: bytes, poses: Sequence[Mapping[str, Any]], settings: Settings
) -> tuple[bytes, list[Row]]:
    """Return the packed mesh *data* with regions and cages, and the `Row` of each pose."""
    with one_thread():
        wait_until_compiled()
        mesh, regions, _ = unpacked(data)
        try:
            if regions is None:
                data = packed(mesh, *_prepared(mesh, settings))
            deformer = deformer_of(data)
        except SegDeformError as fault:
            return data, [Row(FAILED, str(fault)) for _ in poses]
        return data, [_row(deformer, pose, settings) for pose in poses]


def compute_alone(
    data: bytes, poses: Sequence[Mapping[str, Any]], settings: Settings
) -> tuple[bytes, list[Row]]:
    """Return the same, in a process of our own, which ends if that takes far too long."""
    if hasattr(signal, "setitimer"):  # without a handler, the signal ends the process
        signal.setitimer(signal.ITIMER_REAL, (len(poses) + 2) * settings.seconds)
    try:
        return compute(data, poses, settings)
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)


def begin(gigabytes: float) -> None:
    """Prepare a process of our own: it ends with its parent, and its memory is bounded."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is for the process at the terminal
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True).start()
    if sys.platform == "linux":
        imported("resource")
        import resource

        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        most = int(gigabytes * 1e9)
        if hard == resource.RLIM_INFINITY or most < hard:
            resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def ready() -> int:
    """Load what every task needs, and return the process id."""
    with one_thread():
        wait_until_compiled()
        load_for(1 << 30)
    return os.getpid()


def _prepared(mesh: Mesh, settings: Settings) -> tuple[Regions, Sequence[Cage]]:
    goals = checked_goals(dict(settings.goals))
    apart = changing_components(mesh, None, goals)
    regions = segment(mesh, settings.n_regions, apart=apart)
    size = settings.n_cage_vertices
    return regions, fit_cages(mesh, regions, suggested_size(regions) if size is None else size)


def _row(deformer: Deformer, pose: Mapping[str, Any], settings: Settings) -> Row:
    began = time.perf_counter()

    def in_time(fraction: float, text: str) -> None:  # noqa: ARG001
        if time.perf_counter() - began > settings.seconds:
            raise Cancelled(f"took longer than {settings.seconds:g} s")

    try:
        solution, draws = _solved(deformer, pose, settings, in_time)
    except SegDeformError as fault:
        status = TOO_LONG if isinstance(fault, Cancelled) else FAILED
        return Row(status, str(fault), seconds=time.perf_counter() - began)
    refined = solution.is_finished
    data = solution.vertices if refined else np.concatenate(solution.cage_vertices)
    rigid = b"" if refined else _rigid(deformer.mesh, pose)
    return Row(
        solution.status.name.lower().replace("_", " "),
        volume_change=solution.volume_change,
        crossings=len(solution.crossings()),
        folds=len(solution.folds()),
        steps=solution.steps,
        draws=draws,
        seconds=time.perf_counter() - began,
        refined=refined,
        data=np.ascontiguousarray(data).tobytes() + rigid,
    )


def _rigid(mesh: Mesh, pose: Mapping[str, Any]) -> bytes:
    """Return a bit for each vertex of *mesh* that is rigid in a pose; nothing if none is."""
    stiffness = Stiffness.of(mesh, pose.get("stiffness"), Mirror.of(mesh, pose.get("symmetry")))
    if stiffness is None or not stiffness.rigid:
        return b""
    bits = np.zeros(mesh.n_vertices, dtype=bool)
    bits[np.concatenate(stiffness.rigid)] = True
    return np.packbits(bits).tobytes()


def _solved(
    deformer: Deformer, pose: Mapping[str, Any], settings: Settings, progress: Progress
) -> tuple[Solution, int | None]:
    """Return a pose; and how often it was drawn, if it is random."""
    held: dict[str, Any] = {"avoid_contact": settings.avoid_contact}
    if "number" in pose:
        return drawn(
            deformer.hold(**held), _skeleton(deformer), pose["seed"], pose["number"],
            degrees=pose["degrees"], refine=settings.refine, progress=progress,
        )  # fmt: skip
    if pose.get("stiffness") is not None:
        given = np.array(pose["stiffness"], dtype=np.float64)
        deformer = _stiffened(deformer, given.tobytes())
    held |= {"volumes": pose.get("volumes"), "symmetry": pose.get("symmetry")}
    held["slides"] = [Slide(*each) for each in pose.get("slides", ())]
    if "vertex" in pose:
        own, path = _pulling(deformer, pose, held)
    else:
        empty = np.zeros(0, dtype=np.int64)
        fixed, handle = pose.get("fixed", empty), pose.get("handle", empty)
        own = deformer.hold(fixed=fixed, handle=handle, **held)
        path = pose.get("targets", [np.empty((0, 3))])
    solution = solved_along(own, path, progress=progress)
    return (own.finish(solution, progress=progress) if settings.refine else solution), None


@functools.lru_cache(maxsize=2)
def _skeleton(deformer: Deformer) -> Skeleton:
    return Skeleton.of(deformer.mesh, deformer.regions.labels)


def _pulling(
    deformer: Deformer, pose: Mapping[str, Any], held: Mapping[str, Any]
) -> tuple[Deformer, list[FloatArray]]:
    """Return a deformer near the pulled point, and its target; as `pull`."""
    mesh = deformer.mesh
    point, radius = checked_place(mesh, pose["vertex"]), checked_radius(mesh, pose.get("radius"))
    fixed, handle = checked_constraints(mesh, pose.get("pins", ()), [point.vertex], "pins")
    if fault := fault_of_grab(mesh, point, radius):
        raise ConstraintError(fault)
    locality = checked_locality(pose.get("locality"))
    locality = automatic_locality(len(fixed)) if locality is None else locality
    own = deformer.hold(fixed=fixed, handle=handle, **held)
    reach, follows, depth = own.reach_of_pull(point, radius, locality, pose.get("limb"))
    hinge = pose.get("hinge", 0.0)
    own = own.local(point, reach, SPREAD * radius, follows=follows, depth=depth, hinge=hinge)
    return own, [checked_point(pose["to"])[None] - point.at(mesh.vertices) + mesh.vertices[handle]]


def _small(faces: Any) -> Any:
    """Return *faces* as int32, half the bytes, if that is enough."""
    return faces.astype(np.int32) if faces.max(initial=0) < 1 << 31 else faces
