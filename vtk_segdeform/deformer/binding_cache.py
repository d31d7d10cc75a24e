"""Bindings kept on disk, so that a mesh with the same regions and cages is bound once.

A folder holds one file for each binding, an ``.npz`` whose name is a digest of its inputs
(`binding`).  The file contains this digest as well, so that a renamed file is detected.  Files of
other users, symbolic links and pipes are neither read nor replaced.  A file that is ignored is
logged, once for each reason.

A binding of a million vertices is some 400 megabytes.  First touch of fresh memory dominates, so
the arrays are read in parallel.
"""

from __future__ import annotations

import functools
import logging
import os
import re
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import FloatArray, IntArray
from ..energy import Energy
from ..files import fault_of, open_regular, replacing
from ..kernels import in_parallel
from ..progress import Progress
from ..solver import CoarseVolume
from ..subspace import AffineParts, InterpolatedBlock, Subspace
from .binding import Binding, BindingInputs

ENDING = ".binding.npz"
_MOST = 4 << 30  # bytes in a folder
_OURS = re.compile(r"[0-9a-f]{40}" + re.escape(ENDING))

_log = logging.getLogger(__name__)


def cached_binding(
    inputs: BindingInputs, folder: Path | None, progress: Progress | None = None
) -> Binding:
    """Return the binding of *inputs*, read from *folder*, or else computed and written there."""
    if folder is None:
        return Binding.compute(inputs, progress)
    path = folder / (inputs.digest() + ENDING)
    binding = read_binding(path, inputs.rest.vertices)
    if binding is None:
        binding = Binding.compute(inputs, progress)
        write_binding(path, binding)
    return binding


def read_binding(path: Path, rest: FloatArray) -> Binding | None:
    """Return the binding of vertices *rest* (n, 3) in a file; None if there is no valid file."""
    try:
        arrays = _read(path)
        cages = subspace = _subspace(arrays, "w", len(rest))
        rigid = None
        if "rigid_maps" in arrays:
            rigid = AffineParts(*(arrays[f"rigid_{each.name}"] for each in fields(AffineParts)))
            subspace = rigid.blended(cages, rest, rigid.shares)
        energy = Energy(
            quadratic=arrays["quadratic"],
            constant=float(arrays["constant"]),
            scale=float(arrays["scale"]),
            mass=arrays["mass"],
            rotation_operator=arrays["operator"],
            subspace=subspace,
        )
        coarse = CoarseVolume(subspace)
        if "cells" in arrays:
            surface = _subspace(arrays, "c", int(arrays["n_cells"]))
            coarse = CoarseVolume(surface, arrays["cells"], arrays["shares"])
        binding = Binding(cages, rigid, energy, arrays["interior"], coarse)
        os.utime(path)  # recently used files are deleted last
    except FileNotFoundError:
        return None
    except Exception as fault:  # noqa: BLE001 - damaged files raise a dozen kinds
        _warn_once(path, f"ignored, {getattr(fault, 'strerror', None) or fault}")
        return None
    return binding


def write_binding(path: Path, binding: Binding) -> None:
    """Write a binding to a file, atomically; if the disk is full, do without the file."""
    energy, coarse = binding.energy, binding.coarse_volume
    arrays: dict[str, Any] = {
        "key": np.array(_key(path)),
        "quadratic": energy.quadratic,
        "constant": np.array(energy.constant),
        "scale": np.array(energy.scale),
        "mass": energy.mass,
        "operator": energy.rotation_operator,
        "interior": binding.interior,
        **_arrays(binding.cages, "w"),
    }
    if (rigid := binding.rigid) is not None:
        arrays |= {f"rigid_{each.name}": getattr(rigid, each.name) for each in fields(rigid)}
    if coarse.cells is not None:
        arrays |= {"cells": coarse.cells, "shares": coarse.shares}
        arrays |= {"n_cells": np.array(coarse.surface.n_vertices)}
        arrays |= _arrays(coarse.surface, "c")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):
            if fault := fault_of(os.lstat(path), own=True):
                raise OSError(f"is {fault}")
        with replacing(path, follow=False, durable=False) as draft, open(draft, "wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        _make_room(path.parent)
    except OSError as fault:  # full disk or read-only folder: continue without the file
        _warn_once(path, f"not written, {fault.strerror or fault}")


def _read(path: Path) -> dict[str, Any]:
    """Return all arrays of a file by name."""
    with open_regular(path, own=True) as raw, np.load(raw, allow_pickle=False) as file:
        first, names = os.fstat(raw.fileno()), list(file.files)
        key = str(file["key"]) if "key" in names else ""
    if key != _key(path):
        raise ValueError(f"it was renamed; it contains {key or 'an older format'}")
    arrays: dict[str, Any] = {}

    def read_some(start: int, stop: int) -> None:
        with open_regular(path, own=True) as raw, np.load(raw, allow_pickle=False) as file:
            if not os.path.samestat(first, os.fstat(raw.fileno())):
                raise ValueError("it was replaced while it was read")
            arrays.update({name: file[name] for name in names[start:stop]})

    in_parallel(read_some, len(names), 1)
    return arrays


def _key(path: Path) -> str:
    """Return the digest in the name of a file."""
    return path.name.removesuffix(ENDING)


@functools.lru_cache(maxsize=256)  # once for each file and reason
def _warn_once(path: Path, reason: str) -> None:
    _log.warning("cached binding %s: %s", path, reason)


def _make_room(folder: Path) -> None:
    """Delete the bindings that are unused for longest, until the folder is small enough."""
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
    arrays: dict[str, Any] = {}
    for r, (rows, block) in enumerate(zip(subspace.rows, subspace.blocks, strict=True)):
        arrays[f"{name}{r}r"] = rows
        if isinstance(block, InterpolatedBlock):
            for each in fields(block):
                arrays[f"{name}{r}b_{each.name}"] = getattr(block, each.name)
        else:
            arrays[f"{name}{r}b"] = block
    return arrays


def _subspace(arrays: dict[str, Any], name: str, n: int) -> Subspace:
    rows: list[IntArray] = []
    blocks: list[FloatArray | InterpolatedBlock] = []
    names = [each.name for each in fields(InterpolatedBlock)]
    while (key := f"{name}{len(rows)}r") in arrays:
        block = arrays.get(key[:-1] + "b")
        if block is None:
            block = InterpolatedBlock(*(arrays[f"{key[:-1]}b_{each}"] for each in names))
        rows.append(arrays[key])
        blocks.append(block)
    return Subspace(n, tuple(rows), tuple(blocks))
