"""The poses of a batch: one SQLite file with an index, which survives kills at any moment.

    meshes      key, packed mesh with its regions and cages
    poses       key, status and numbers, cage vertices
    plan        number, names of the mesh and of the pose, and their keys

Poses are found by the hash of their content, so that a plan can be continued, and extended.
A pose of 155 cage vertices is 3.7 kB; the mesh is W~ times these, to rounding error.
"""

from __future__ import annotations

import csv
import hashlib
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import FloatArray, is_whole
from ..checks import Described, as_path, shown
from ..errors import ArgumentError
from ..files import replacing
from ..importing import imported
from ..mesh import Mesh
from .remote import RemoteFolder, is_url
from .tasks import FAILED, SET_ASIDE, TOO_LONG, Row, deformer_of, rigid_deformer_of, unpacked

NAME = "poses.segposes"
_COLUMNS = (
    "number", "mesh", "pose", "status", "message", "volume_change", "crossings", "folds", "steps",
    "draws", "seconds",
)  # fmt: skip
_TABLES = f"""
CREATE TABLE IF NOT EXISTS meshes (key TEXT PRIMARY KEY, data BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS poses (key TEXT PRIMARY KEY, {", ".join(Row._fields)});
CREATE TABLE IF NOT EXISTS plan (
    number INTEGER PRIMARY KEY, mesh TEXT, pose TEXT, pose_key TEXT, mesh_key TEXT);
"""
_JOINED = "FROM plan LEFT JOIN poses ON poses.key = plan.pose_key"
_NOT_DONE = (FAILED, SET_ASIDE, TOO_LONG)


class PoseStore(Described):
    """The poses of a batch, by their numbers in the plan: mesh by mesh, pose by pose.

    Parameters
    ----------
    path : path or URL
        The output folder of `batch`, or the file in it.  That of a URL is copied to this machine.

    Raises
    ------
    ArgumentError
        If it has no poses, or a batch is being written to it.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        # A copy is deleted with its last owner.
        self._given = RemoteFolder(path, NAME) if isinstance(path, str) and is_url(path) else path
        place = as_path(self._given)
        self.path = place / NAME if os.path.isdir(place) else place
        if not os.path.isfile(self.path):
            where = path if isinstance(self._given, RemoteFolder) else self.path
            raise ArgumentError(f"path must have poses of a batch; there is no file {where}")
        with self._open() as database:
            count = database.execute("SELECT count(*) FROM plan").fetchone()[0]
        self._count = int(count)

    def __len__(self) -> int:
        return self._count

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        with faults_named(self.path):
            database = sqlite3.connect(f"{self.path.resolve().as_uri()}?mode=ro", uri=True)
            try:
                yield database
            finally:
                database.close()

    def facts(self) -> dict[str, str]:
        """Return its numbers as texts, by what they are."""
        with self._open() as database:
            counts = database.execute(f"SELECT status, count(*) {_JOINED} GROUP BY status")
            statuses = {status or "not computed": f"{count:,}" for status, count in counts}
        return {"poses": f"{self._count:,}", **statuses}

    def mesh(self, number: int) -> Mesh:
        """Return the mesh, at rest, of the pose with this *number*."""
        return unpacked(self._found(number)[2])[0]

    def cage_vertices(self, number: int) -> tuple[FloatArray, ...]:
        """Return the cages (m_r, 3) of a pose, one for each region; of a refined one none."""
        refined, data, packed_mesh = self._found(number)
        return () if refined else _cages(data, packed_mesh)[0]

    def vertices(self, number: int) -> FloatArray:
        """Return the mesh (n, 3) in the pose with this *number*.

        The first pose of a mesh takes as long as binding it, or reading its binding from the cache.

        Raises
        ------
        ArgumentError
            If there is no such pose, or it has failed.
        """
        refined, data, packed_mesh = self._found(number)
        if refined:
            return np.frombuffer(data).reshape(-1, 3)
        cages, rigid = _cages(data, packed_mesh)
        own = rigid_deformer_of(packed_mesh, rigid) if rigid else deformer_of(packed_mesh)
        return own.surface(cages)

    def write_mesh(self, number: int, path: str | os.PathLike[str]) -> None:
        """Write the mesh in the pose with this *number* to a file of any format of `write_mesh`."""
        imported("vtk_segdeform.io")  # imports pyvista
        from ..io import write_mesh

        write_mesh(as_path(path), self.mesh(number).with_vertices(self.vertices(number)))

    def table(self) -> dict[str, list[Any]]:
        """Return a column for each of number, mesh, pose, status, message and so on, by name."""
        names = ", ".join(_COLUMNS)
        with self._open() as database:
            rows = database.execute(f"SELECT {names} {_JOINED} ORDER BY number").fetchall()
        return {name: [row[k] for row in rows] for k, name in enumerate(_COLUMNS)}

    def write_table(self) -> Path:
        """Write the table beside the poses, as Parquet if pyarrow is installed, or else as CSV."""
        table = self.table()
        try:
            imported("pyarrow.parquet")
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            path = self.path.with_suffix(".csv")
            with replacing(path) as draft, open(draft, "w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(table)
                writer.writerows(zip(*table.values(), strict=True))
            return path
        path = self.path.with_suffix(".parquet")
        with replacing(path) as draft:
            parquet.write_table(pyarrow.table(table), draft)
        return path

    def digest(self) -> str:
        """Return a hash of all poses in their order: equal for equal bytes of all vertices."""
        seen = hashlib.blake2b(digest_size=16)
        with self._open() as database:
            for status, data in database.execute(f"SELECT status, data {_JOINED} ORDER BY number"):
                seen.update(repr((status, len(data or b""))).encode() + (data or b""))
        return seen.hexdigest()

    def _found(self, number: int) -> tuple[bool, bytes, bytes]:
        """Return whether a pose is refined, its data, and its packed mesh."""
        if not is_whole(number, 0, self._count - 1):
            raise ArgumentError(f"number must be 0 to {self._count - 1}; got {shown(number)}")
        with self._open() as database:
            status, message, refined, data, mesh = database.execute(
                "SELECT status, message, refined, poses.data, meshes.data "
                f"{_JOINED} LEFT JOIN meshes ON meshes.key = plan.mesh_key WHERE number = ?",
                (int(number),),
            ).fetchone()
        if not data:
            reason = f"{status}: {message}" if status else "not computed yet"
            raise ArgumentError(f"number {number} is a pose without vertices: {reason}")
        return bool(refined), data, mesh


def _cages(data: bytes, packed_mesh: bytes) -> tuple[tuple[FloatArray, ...], bytes]:
    """Return the cages (m_r, 3) in the *data* of a pose, and the bits after them; see `Row`."""
    ends = np.cumsum([cage.n_vertices for cage in deformer_of(packed_mesh).cages])
    points = np.frombuffer(data, count=3 * int(ends[-1])).reshape(-1, 3)
    return tuple(np.split(points, ends[:-1])), data[points.nbytes :]


class Writer:
    """The same file, written by one batch at a time; everything added is there after a kill.

    Raises
    ------
    ArgumentError
        If another batch is writing to it, or it is no such file.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / NAME
        with faults_named(self.path):
            self._database = sqlite3.connect(self.path, timeout=1.0, isolation_level=None)
            for line in ("locking_mode=EXCLUSIVE", "journal_mode=WAL", "synchronous=NORMAL"):
                self._database.execute(f"PRAGMA {line}")
            self._database.executescript(_TABLES)

    def packed(self, mesh_key: str) -> bytes | None:
        """Return a mesh with its regions and cages."""
        found = self._execute("SELECT data FROM meshes WHERE key = ?", [mesh_key]).fetchone()
        return None if found is None else bytes(found[0])

    def has(self, pose_key: str, *, retry: bool) -> bool:
        """Return whether a pose is there; with *retry* not if it has failed."""
        found = self._execute("SELECT status FROM poses WHERE key = ?", [pose_key]).fetchone()
        return found is not None and not (retry and found[0] in _NOT_DONE)

    def add(self, mesh_key: str, data: bytes | None, rows: Mapping[str, Row]) -> None:
        """Add a packed mesh, if it has regions and cages, and the rows of poses, by key."""
        with self._transaction():
            if data is not None:
                self._execute("INSERT OR IGNORE INTO meshes VALUES (?, ?)", [mesh_key, data])
            marks = ", ".join("?" for _ in range(1 + len(Row._fields)))
            for key, row in rows.items():
                self._execute(f"INSERT OR REPLACE INTO poses VALUES ({marks})", [key, *row])

    def name(self, rows: Iterable[tuple[int, str, str, str, str]]) -> None:
        """Set the names of the mesh and of the pose, and the keys of both, of numbers."""
        with self._transaction():
            for row in rows:
                self._execute("INSERT OR REPLACE INTO plan VALUES (?, ?, ?, ?, ?)", row)

    def end(self, count: int) -> None:
        """Forget the numbers of an earlier, longer plan, and leave a single file."""
        self._execute("DELETE FROM plan WHERE number >= ?", [count])
        self._execute("PRAGMA journal_mode=DELETE")

    def copy(self, path: Path) -> None:
        """Write what is there now to another file."""
        with faults_named(path):
            path.unlink(missing_ok=True)
            other = sqlite3.connect(path)
            try:
                self._database.backup(other)
            finally:
                other.close()

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def _execute(self, query: str, values: Sequence[Any] = ()) -> sqlite3.Cursor:
        with faults_named(self.path):
            return self._database.execute(query, values)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._execute("BEGIN")
        try:
            yield
        except BaseException:
            self._execute("ROLLBACK")
            raise
        self._execute("COMMIT")


@contextmanager
def faults_named(path: Path) -> Iterator[None]:
    """Raise errors of SQLite as an ArgumentError that names the file."""
    try:
        yield
    except sqlite3.Error as fault:
        if "locked" in str(fault):
            raise ArgumentError(f"{path} is being written by another batch") from None
        raise ArgumentError(f"{path} cannot be read or written: {fault}") from None
