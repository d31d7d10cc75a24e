"""All that is computed once for a mesh, its regions and its cages: what takes seconds.

    W~              `subspace.bind`
    E(p)            `energy.shape_energy`, `cage_stiffness`
    the stand-in    `stand_in.StandIn`
    W~ in patches   `patches.Patches`, of a large mesh

With a *cache*, a folder, it is kept there under a name made from all that it depends on, so that
the same mesh with the same cages is bound once: opening a million vertices again takes seconds.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import sys
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import FloatArray, IntArray
from .cage_stiffness import with_cage_stiffness
from .cages import Cage
from .energy import Energy, shape_energy
from .grouping import join_rotations
from .mesh import Mesh
from .patches import Patches
from .progress import Progress, part
from .regions import Regions
from .rotations import rotation_groups
from .stand_in import StandIn
from .subspace import Subspace, bind

_FORMAT = 6  # raise it whenever what is bound changes
_BITS, _EACH = 2000, 6  # rotations at first: so many, or more, for each one asked for
_MOST = 4 << 30  # bytes in a folder
_ENDING = ".bound.npz"
_LARGE = 100_000  # vertices beyond which what every frame maps by is kept in patches


@dataclass(frozen=True, eq=False)
class Binding:
    """What a `Deformer` solves with."""

    energy: Energy
    stand_in: StandIn
    patches: Patches | None = None

    @property
    def mapping(self) -> Subspace | Patches:
        """What maps the cages to the mesh: W~, or W~ in patches."""
        return self.patches or self.energy.subspace


@dataclass(frozen=True, eq=False)
class Binder:
    """What is to be bound, and how; `bound` does it.

    Parameters
    ----------
    rest : Mesh
        The mesh at rest, size about 1.
    regions : Regions
        Of the mesh.
    cages : sequence of Cage
        In the mesh's own unit, and ...
    rest_cages : (m, 3) float
        ... their vertices as *rest* is.
    blend : (r, n) float or None
        See `subspace.bind`.
    stretch : float
        See `energy.shape_energy`.
    n_groups : int or None
        Rotations, None for one per vertex.
    """

    rest: Mesh
    regions: Regions
    cages: Sequence[Cage]
    rest_cages: FloatArray
    blend: FloatArray | None
    stretch: float
    n_groups: int | None

    def bound(
        self, cache: str | os.PathLike[str] | None = None, progress: Progress | None = None
    ) -> Binding:
        """Return the binding, from the folder *cache* if it is there, and leave it there."""
        path = None
        if cache is not None and self.n_groups is not None and self.stretch > 0.0:
            path = Path(cache) / (self._name() + _ENDING)
            if found := self._read(path):
                return found
        binding = self._make(progress)
        if path is not None:
            _write(path, binding)
        return binding

    def _make(self, progress: Progress | None) -> Binding:
        blend, share = self.blend, part(progress, 0.0, 0.8)
        subspace = bind(self.regions, self.cages, blend=blend, progress=share)
        if progress:
            progress(0.8, "factoring")
        groups = self._groups()
        energy = shape_energy(self.rest, subspace, self.stretch, groups)
        if groups is not None and energy.exact:
            faces = [cage.faces for cage in self.cages]
            energy = with_cage_stiffness(energy, self.rest_cages, faces, groups)
            energy = self._joined(energy, groups)
        if progress:
            progress(0.85, "standing in")
        stand_in = StandIn.of(self.regions.mesh, subspace, whole=energy.turns_vertices)
        patches = None
        if self.rest.n_vertices > _LARGE:
            share = part(progress, 0.9, 1.0)
            patches = Patches.of(subspace, self.rest.vertices, self.rest_cages, progress=share)
        return Binding(energy, stand_in, patches)

    def _groups(self) -> IntArray | None:
        """Return the rotation of each vertex; more than asked for, where `_joined` follows."""
        n, count = self.rest.n_vertices, self.n_groups
        if count is None:
            return None
        many = self.stretch > 0.0
        count = max(_BITS, _EACH * count) if many else count
        if count >= n:
            return np.arange(n)
        return rotation_groups(self.rest.vertices, self._parts, count, quick=many)

    @property
    def _parts(self) -> IntArray:
        component = self.regions.mesh.components
        return np.asarray(self.regions.labels * (int(component.max()) + 1) + component)

    def _joined(self, energy: Energy, groups: IntArray) -> Energy:
        """Return *energy* with as many rotations as asked for."""
        assert self.n_groups is not None
        counts = np.bincount(groups)
        if len(counts) <= self.n_groups:
            return energy
        means = np.stack([np.bincount(groups, x) / counts for x in self.rest.vertices.T], axis=1)
        parts = np.zeros(len(counts), dtype=np.int64)
        parts[groups] = self._parts
        return join_rotations(energy, self.rest_cages, (means, parts, counts), self.n_groups)[0]

    def _name(self) -> str:
        """Return a name that is the same exactly when the binding is."""
        regions = self.regions
        seen = hashlib.blake2b(digest_size=20)
        seen.update(repr((_FORMAT, self.stretch, self.n_groups, regions.smoothness)).encode())
        arrays = [regions.mesh.vertices, regions.mesh.faces, regions.membership, self.blend]
        for array in [*arrays, *(a for cage in self.cages for a in (cage.vertices, cage.faces))]:
            if array is not None:
                seen.update(repr((array.shape, array.dtype.str)).encode())
                seen.update(np.ascontiguousarray(array).view(np.uint8).data)
        return seen.hexdigest()

    def _read(self, path: Path) -> Binding | None:
        """Return what is in a file; None if there is none, or none that can be believed."""
        try:
            with open(path, "rb") as raw, np.load(raw, allow_pickle=False) as file:
                subspace = _subspace(file, "w", self.rest.n_vertices)
                pull = file["pull"]
                energy = Energy(
                    file["quadratic"], float(file["constant"]), file["mass"], pull, pull, subspace
                )
                stand_in = StandIn(subspace)
                if "cells" in file:
                    surface = _subspace(file, "s", int(file["n_cells"]))
                    stand_in = StandIn(surface, file["cells"], file["shares"])
                patches = None
                if "patch_starts" in file:
                    patches = Patches(*(file["patch_" + each.name] for each in fields(Patches)))
            os.utime(path)  # used: among the last to be thrown away
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None
        return Binding(energy, stand_in, patches)


def cache_folder() -> Path | None:
    """Return where this user's programs keep bindings; None if ``SEGDEFORM_CACHE`` is 0."""
    chosen = os.environ.get("SEGDEFORM_CACHE", "")
    if chosen:
        return None if chosen == "0" else Path(chosen)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "segdeform" / "bound"


def _write(path: Path, binding: Binding) -> None:
    """Keep *binding*, whole or not at all; without room for it, it is not kept."""
    energy, stand_in = binding.energy, binding.stand_in
    arrays: dict[str, Any] = {
        "quadratic": energy.quadratic,
        "constant": np.array(energy.constant),
        "mass": energy.mass,
        "pull": energy.pull,
        **_arrays(energy.subspace, "w"),
    }
    if stand_in.cells is not None:
        arrays |= {"cells": stand_in.cells, "shares": stand_in.shares}
        arrays |= {"n_cells": np.array(stand_in.surface.n_vertices)}
        arrays |= _arrays(stand_in.surface, "s")
    if patches := binding.patches:
        arrays |= {"patch_" + each.name: getattr(patches, each.name) for each in fields(Patches)}
    draft = path.with_name(f".{secrets.token_hex(8)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with open(draft, "xb") as file:
                np.savez(file, allow_pickle=False, **arrays)
            os.replace(draft, path)
        finally:
            draft.unlink(missing_ok=True)
        _make_room(path.parent)
    except OSError:  # a full disk or a folder that cannot be written: then without
        return


def _make_room(folder: Path) -> None:
    """Throw away what has not been used for longest, until the folder is small enough."""
    files = [(path.stat(), path) for path in folder.glob("*" + _ENDING)]
    files.sort(key=lambda each: each[0].st_mtime, reverse=True)
    used = np.cumsum([stat.st_size for stat, _ in files])
    for (_, path), size in zip(files, used, strict=True):
        if size > _MOST:
            path.unlink(missing_ok=True)


def _arrays(subspace: Subspace, name: str) -> dict[str, Any]:
    parts = enumerate(zip(subspace.rows, subspace.blocks, strict=True))
    return {f"{name}{r}{kind}": a for r, pair in parts for kind, a in zip("rb", pair, strict=True)}


def _subspace(file: Any, name: str, n: int) -> Subspace:
    count = sum(key.startswith(name) and key[1:-1].isdigit() for key in file.files) // 2
    rows, blocks = ([file[f"{name}{r}{kind}"] for r in range(count)] for kind in "rb")
    return Subspace(n, tuple(rows), tuple(blocks))
