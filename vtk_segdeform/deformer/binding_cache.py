"""What a mesh, its regions and its cages are bound to, and how that is kept on disk.

A folder holds one file for each binding, an ``.npz`` whose name is a digest of all that it was
computed from (`binding`).  The file contains this digest as well, so that a renamed file is
detected.  Files of other users, symbolic links and pipes are neither read nor replaced.  A file
that is ignored is logged, once for each reason.

A binding of a million vertices is some 400 megabytes.  First touch of fresh memory dominates, so
the arrays are read in parallel.
"""

from __future__ import annotations

import functools
import logging
import os
import re
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..energy import Energy
from ..files import fault_of, open_regular, replacing
from ..kernels import in_parallel
from ..solver import StandIn
from ..subspace import Patches, Subspace

ENDING = ".bound.npz"
_MOST = 4 << 30  # bytes in a folder
_OURS = re.compile(r"[0-9a-f]{40}" + re.escape(ENDING))

_log = logging.getLogger(__name__)


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

    @classmethod
    def read(cls, path: Path, n_vertices: int) -> Binding | None:
        """Return what is in a file; None if there is none, or none that can be believed."""
        try:
            arrays = _read(path)
            subspace = _subspace(arrays, "w", n_vertices)
            pull = arrays["pull"]
            energy = Energy(
                quadratic=arrays["quadratic"],
                constant=float(arrays["constant"]),
                scale=float(arrays["scale"]),
                mass=arrays["mass"],
                fit=pull,
                pull=pull,
                subspace=subspace,
            )
            stand_in = StandIn(subspace)
            if "cells" in arrays:
                surface = _subspace(arrays, "s", int(arrays["n_cells"]))
                stand_in = StandIn(surface, arrays["cells"], arrays["shares"])
            patches = None
            if "patch_starts" in arrays:
                patches = Patches(*(arrays["patch_" + each.name] for each in fields(Patches)))
            os.utime(path)  # used: among the last to be thrown away
        except FileNotFoundError:
            return None
        except Exception as fault:  # noqa: BLE001 - damaged files raise a dozen kinds
            _warn_once(path, f"ignored, {getattr(fault, 'strerror', None) or fault}")
            return None
        return cls(energy, stand_in, patches)

    def write(self, path: Path) -> None:
        """Keep it in a file, whole or not at all; without room for it, it is not kept."""
        energy, stand_in = self.energy, self.stand_in
        arrays: dict[str, Any] = {
            "key": np.array(_key(path)),
            "quadratic": energy.quadratic,
            "constant": np.array(energy.constant),
            "scale": np.array(energy.scale),
            "mass": energy.mass,
            "pull": energy.pull,
            **_arrays(energy.subspace, "w"),
        }
        if stand_in.cells is not None:
            arrays |= {"cells": stand_in.cells, "shares": stand_in.shares}
            arrays |= {"n_cells": np.array(stand_in.surface.n_vertices)}
            arrays |= _arrays(stand_in.surface, "s")
        if patches := self.patches:
            arrays |= {
                "patch_" + each.name: getattr(patches, each.name) for each in fields(Patches)
            }
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):
                if fault := fault_of(os.lstat(path), own=True):
                    raise OSError(f"is {fault}")
            with replacing(path, follow=False, durable=False) as draft, open(draft, "wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
            _make_room(path.parent)
        except OSError as fault:  # full disk or read-only folder: go without the file
            _warn_once(path, f"not written, {fault.strerror or fault}")


def _read(path: Path) -> dict[str, Any]:
    """Return all arrays of a file by name."""
    with open_regular(path, own=True) as raw, np.load(raw, allow_pickle=False) as file:
        first, names = os.fstat(raw.fileno()), list(file.files)
        key = str(file["key"]) if "key" in names else ""
    if key != _key(path):
        raise ValueError(f"it was renamed; its content is {key or 'of an older version'}")
    arrays: dict[str, Any] = {}

    def some(start: int, stop: int) -> None:
        with open_regular(path, own=True) as raw, np.load(raw, allow_pickle=False) as file:
            if not os.path.samestat(first, os.fstat(raw.fileno())):
                raise ValueError("it was replaced while it was read")
            arrays.update({name: file[name] for name in names[start:stop]})

    in_parallel(some, len(names), 1)
    return arrays


def _key(path: Path) -> str:
    """Return the digest in the name of a file."""
    return path.name.removesuffix(ENDING)


@functools.lru_cache(maxsize=256)  # once for each file and reason
def _warn_once(path: Path, reason: str) -> None:
    _log.warning("cached binding %s: %s", path, reason)


def _make_room(folder: Path) -> None:
    """Throw away what has not been used for longest, until the folder is small enough."""
    files = [
        (status, path)
        for path in folder.iterdir()
        if _OURS.fullmatch(path.name) and not fault_of(status := os.lstat(path), own=True)
    ]
    files.sort(key=lambda each: each[0].st_mtime, reverse=True)
    used = np.cumsum([status.st_size for status, _ in files])
    for (_, path), size in zip(files, used, strict=True):
        if size > _MOST:
            path.unlink(missing_ok=True)


def _arrays(subspace: Subspace, name: str) -> dict[str, Any]:
    parts = enumerate(zip(subspace.rows, subspace.blocks, strict=True))
    return {f"{name}{r}{kind}": a for r, pair in parts for kind, a in zip("rb", pair, strict=True)}


def _subspace(arrays: dict[str, Any], name: str, n: int) -> Subspace:
    count = sum(key.startswith(name) and key[1:-1].isdigit() for key in arrays) // 2
    rows, blocks = ([arrays[f"{name}{r}{kind}"] for r in range(count)] for kind in "rb")
    return Subspace(n, tuple(rows), tuple(blocks))
