"""Files that a session carries along: other surfaces, points, curves, grids and landmarks.

A session keeps the content of each file, as it keeps the surface that was given: it can be moved,
sent to a page or opened next year, and what it carries is there.  A point at rest q goes to

    x(q) = W~(q) p + d(q)        d: how far a finished mesh is from that of its cages, at q

where d is interpolated from the nearest vertices, as the blend weights of W~ are.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path

from ..arrays import FloatArray, as_points
from ..checks import as_path, shown
from ..errors import ConstraintError, MeshError
from ..files import open_regular
from ..landmarks import LANDMARK_SUFFIXES
from .handles import require_near
from .poses import Poses
from .state import CarriedFile
from .timeline import Timeline

_LARGEST = 1 << 28  # bytes of a file, which every autosave writes again


class SessionCarried(Mapping[str, CarriedFile]):
    """The files that a session carries along, by name, and edits of them, each one undo step.

    Examples
    --------
    >>> from vtk_segdeform import Session, models, write_mesh
    >>> session = Session(models.sphere(300))
    >>> write_mesh("bone.ply", models.sphere(100))
    >>> session.carried.add("bone.ply"), session.carried.points("bone.ply").shape
    (('bone.ply',), (100, 3))
    """

    def __init__(self, history: Timeline, poses: Poses) -> None:
        self._history, self._poses = history, poses
        self._own = {each.name: each for each in history.state.carried}

    def __getitem__(self, name: str) -> CarriedFile:
        return self._own[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._own)

    def __len__(self) -> int:
        return len(self._own)

    def __repr__(self) -> str:
        return repr(tuple(self))

    def add(self, *paths: str | Path) -> tuple[str, ...]:
        """Carry files along; return their names here.

        Parameters
        ----------
        *paths : path
            Surfaces, points, curves, grids (.vtu) or landmarks, in the coordinates of the mesh at
            rest.  Of several files of one name, the later ones get numbers: bone-2.ply.

        Raises
        ------
        MeshError
            If a file cannot be read, is empty or too large.
        ArgumentError, ConstraintError
            If points are not finite, or so far from the mesh that they must be in another unit.

        If one file cannot be added, none is.
        """
        own = dict(self._own)
        names = []
        for path in map(as_path, paths):
            try:
                with open_regular(path) as file:
                    content = file.read(_LARGEST + 1)
            except OSError as fault:
                raise MeshError(f"{path}: {fault.strerror or fault}") from None
            if len(content) > _LARGEST:
                raise MeshError(f"{path}: has more than {_LARGEST >> 20} MiB, too much to carry")
            made = CarriedFile(path.name, content)
            self._require_near(made)
            same = (k for k, each in own.items() if each.content == content)
            name = next(same, "") or _unused(path.name, own)
            own.setdefault(name, replace(made, name=name))
            names.append(name)
        if own.keys() != self._own.keys():
            label = names[0] if len(names) == 1 else f"{len(names)} files"
            self._step(f"carry {label}", own)
        return tuple(names)

    def remove(self, *names: str) -> None:
        """Stop carrying one or more files."""
        gone = {self._known(name) for name in names}
        if gone:
            label = names[0] if len(gone) == 1 else f"{len(gone)} carried files"
            self._step(
                f"remove {label}", {k: each for k, each in self._own.items() if k not in gone}
            )

    def points(self, name: str) -> FloatArray:
        """Return the points of a file in the current pose, (k, 3) float."""
        given = self._own[self._known(name)].follower.points
        return self._poses.carry(self._history.state, given)

    def write(self, name: str, path: str | Path) -> None:
        """Write a file as it was given, apart from coordinates, in the current pose.

        Raises
        ------
        ArgumentError, MeshError
            If it cannot be written there: landmarks need .csv, points .ply or .vtp, grids .vtu.
        """
        self._own[self._known(name)].follower.write(as_path(path), self.points(name))

    def write_all(
        self, folder: str | Path, *, ours: Collection[Path] = ()
    ) -> tuple[dict[str, Path], dict[str, str]]:
        """Write all files to a *folder*, under their own names.

        Parameters
        ----------
        folder : path
            Must exist.  A file of the same name is not replaced: then it is bone-2.ply.
        ours : collection of Path
            Files that may be replaced.

        Returns
        -------
        written : dict of str to Path
            Where they are, by name.
        failed : dict of str to str
            Why the others could not be written.

        Raises
        ------
        MeshError
            If there is no such folder.
        """
        folder = as_path(folder)
        if not folder.is_dir():
            raise MeshError(f"{folder}: there is no such folder")
        written, failed = dict[str, Path](), dict[str, str]()
        for name in self:
            stem, suffix = Path(name).stem, Path(name).suffix
            suffix = ".csv" if suffix.lower() in LANDMARK_SUFFIXES else suffix
            taken = {path.name for path in folder.iterdir() if path not in ours} | {
                path.name for path in written.values()
            }
            path = folder / _unused(f"{stem}{suffix}", taken)
            try:
                self.write(name, path)
                written[name] = path
            except (MeshError, ValueError) as fault:
                failed[name] = str(fault)
        return written, failed

    def _require_near(self, file: CarriedFile) -> None:
        points = as_points(file.follower.points, f"points of {file.name}")
        if not len(points):
            raise MeshError(f"{file.name}: has no points")
        require_near(self._poses.mesh, points, f"points of {file.name}")

    def _known(self, name: str) -> str:
        if not isinstance(name, str) or name not in self:
            names = ", ".join(map(repr, self))
            advice = f"these are carried: {names}" if names else "none is"
            raise ConstraintError(f"there is no carried file {shown(name)}; {advice}")
        return name

    def _step(self, label: str, own: Mapping[str, CarriedFile]) -> None:
        self._history.commit()
        self._history.step(label, replace(self._history.state, carried=tuple(own.values())))


def _unused(name: str, taken: Collection[str]) -> str:
    """Return *name*, or with a number before its suffix, so that it is none of *taken*."""
    path, lower = Path(name), {each.lower() for each in taken}
    names = (f"{path.stem}-{n}{path.suffix}" if n > 1 else name for n in count(1))
    return next(each for each in names if each.lower() not in lower)
