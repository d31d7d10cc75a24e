"""The tasks of a plan, on any executor: in bounded numbers, each tried twice, each stored at once.

    plan  ->  tasks: one mesh, a block of poses  ->  executor  ->  rows  ->  store

A task that ends without a result, because it raised an unexpected error or its worker died, is
tried again pose by pose; a pose, or a mesh, that fails again is set aside.  When a process of the
pool here dies, its tasks cannot be told from those of the others: so all that were under way are
tried again one at a time, with no others beside them.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Any, TypeAlias

from ..arrays import is_whole
from ..checks import as_callable, as_flag, as_path, require, shown
from ..errors import ArgumentError, Cancelled, MissingDependencyError, SegDeformError
from ..interpreter import spawning
from ..kernels import n_threads, wait_until_compiled
from ..progress import Progress, tell
from .plan import Given, Plan, Settings, digest
from .remote import RemoteFolder, is_url
from .store import NAME, PoseStore, Writer
from .tasks import FAILED, SET_ASIDE, Row, begin, compute, compute_alone, packed, ready

_MOST_TRIES, _MOST_WORKERS = 2, 100_000
_AHEAD = 2  # tasks for each worker, so that none waits for the next
_PERIOD = 0.5  # seconds between reports
_CONTINUE = "what is done is stored: call batch again to continue"
_Poses: TypeAlias = dict[str, Mapping[str, Any]]  # resolved, by their keys


@dataclass(frozen=True, eq=False)
class _Task:
    """Poses of one mesh; and tasks that follow as soon as it has its regions and cages."""

    mesh_key: str
    data: bytes
    poses: _Poses
    later: tuple[_Task, ...] = ()
    is_prepared: bool = False
    tries: int = 0
    is_suspect: bool = False


def batch(
    plan: Mapping[str, Any] | str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    executor: Executor | None = None,
    n_workers: int | None = None,
    retry: bool = False,
    progress: Progress | None = None,
) -> PoseStore:
    """Compute all poses of all meshes of a *plan*, in several processes, and store them.

    Every pose starts from rest, so that it is the same to the last bit whatever the number and
    order of tasks.  Called again with the same plan and *output* it computes only what is not there
    yet: after Ctrl+C, after a kill, or with more meshes or poses.

    Parameters
    ----------
    plan : mapping, or path or URL of a JSON file
        ``meshes``: paths, URLs, patterns of these such as ``limbs/*.ply``, or whatever
        ``sd.deform`` takes.
        ``poses``: each a mapping of one of these kinds:

        - ``fixed``, and ``handles``, each with a selection under ``select`` and ``rotate``,
          ``translate``, ``matrix`` and ``pivot`` as of ``segdeform deform``; or ``handle`` and
          ``targets`` as of `deform`; or none but goals
        - ``vertex`` and ``to``, with ``radius``, ``pins``, ``locality``, ``limb`` and ``hinge``, as
          of `pull`
        - ``random``, a number of poses, with ``seed`` and ``degrees``, as of `random_poses`

        Fixed vertices and pins are numbers, or selections such as "z<10%".  The first two kinds may
        have ``volumes``, goals by name; ``stiffness``, as ``{"z>80%": 5, "z<10%": "inf"}``, or one
        number for each vertex; ``slides``, each a selection or with ``select``, ``along`` and
        ``direction``, as of `Slide`; and ``symmetry``, all as of `deform`.

        Of all poses: ``refine`` (False: cages are stored; True: finished vertices),
        ``avoid_contact`` (False), ``n_regions``, ``n_cage_vertices`` (automatic); ``block``, poses
        of a task (10); ``seconds``, for a pose (120), and ``memory``, for a process, in GB (4).
    output : path or URL
        A folder, which is created, for ``poses.segposes`` and a table.  That of a URL is written in
        a temporary folder, copied every minute and at the end, and continued from there.
    executor : concurrent.futures.Executor, optional
        Runs the tasks; by default processes of this machine, of one thread each.
    n_workers : int, optional
        Number of processes; by default that of the cores.  With *executor*, the number of its
        workers, so that each has a task and another one waiting.
    retry : bool
        Whether to try poses again that have failed, took too long or were set aside.
    progress : Progress, optional
        Called with the fraction done, 0 to 1, and a text with the time left.  Raising `Cancelled`
        ends the batch after the tasks that are under way, which are stored.

    Returns
    -------
    PoseStore
        A pose that failed has its reason in the table; the others are not affected.

    Raises
    ------
    ArgumentError, ConstraintError
        If the *plan* is invalid, or another batch writes to *output*.
    MissingDependencyError
        If no processes can be started, or a URL is given without fsspec, or without the library
        that it needs.
    Cancelled
        If *progress* raised it, or the *executor* has ended.
    """
    found = Plan.of(plan)
    remote = RemoteFolder(output, NAME) if isinstance(output, str) and is_url(output) else None
    folder = as_path(output, "output") if remote is None else remote.path
    if executor is not None:
        require(executor, Executor, "executor")
    if n_workers is not None and not is_whole(n_workers, 1, _MOST_WORKERS):
        raise ArgumentError(f"n_workers must be 1 to {_MOST_WORKERS:,}; got {shown(n_workers)}")
    if progress is not None:
        as_callable(progress, "progress")
    count = int(n_workers or n_threads())
    try:
        store = Writer(folder)
    except OSError as fault:
        raise ArgumentError(f"output {folder} cannot be written: {fault.strerror}") from None
    try:
        run = _Run(found, store, as_flag(retry, "retry"), progress, remote)
        if executor is None:
            _run_here(run, count, found.settings)
        elif not run.on(lambda *task: executor.submit(compute, *task), _AHEAD * count):
            raise Cancelled(f"the executor has broken; {_CONTINUE}")
        store.end(len(found.meshes) * len(found.poses))
    finally:
        store.close()
        if remote is not None:
            remote.send(NAME)
    result = PoseStore(folder if remote is None else remote)
    table = result.write_table()
    if remote is not None:
        remote.send(table.name)
    return result


def _run_here(run: _Run, count: int, settings: Settings) -> None:
    """Run all tasks in *count* processes, and restart these after one of them has died."""
    tries, most = 0, _AHEAD * count
    while run.is_left():
        wait_until_compiled()
        with spawning() as context:
            pool = ProcessPoolExecutor(
                count, context, initializer=begin, initargs=(settings.memory,)
            )
            started = [pool.submit(ready) for _ in range(count)]
            wait(started)
        with pool:
            if not any(each.exception() for each in started):
                run.on(partial(_submitted, pool), most, is_own=True)
                continue
        tries += 1
        if tries == _MOST_TRIES:
            raise MissingDependencyError(
                "the processes of the batch end at once. A program must call batch under "
                "'if __name__ == \"__main__\":', as each process imports it; or the plan's "
                "'memory' is too little"
            )


class _Run:
    """The tasks of one call of `batch`: waiting and under way; and how many poses are done."""

    def __init__(
        self,
        plan: Plan,
        store: Writer,
        retry: bool,
        progress: Progress | None,
        remote: RemoteFolder | None,
    ) -> None:
        self._remote = remote
        self._plan, self._store, self._retry, self._progress = plan, store, retry, progress
        self._total = len(plan.meshes) * len(plan.poses)
        self._done = self._computed = self._missing = 0
        self._began = time.monotonic()
        self._new = self._new_tasks()
        self._waiting: deque[_Task] = deque()
        self._suspects: deque[_Task] = deque()  # run one at a time
        self._under_way: dict[Future[Any], _Task] = {}

    def is_left(self) -> bool:
        """Return whether any task is left."""
        if not (self._waiting or self._suspects):
            self._waiting.extend(islice(self._new, 1))
        return bool(self._waiting or self._suspects)

    def on(self, submit: Callable[..., Future[Any]], most: int, *, is_own: bool = False) -> bool:
        """Run all tasks, at most so many at a time; return False if the executor has broken."""
        try:
            while self._filled(submit, most):
                done, _ = wait(self._under_way, _PERIOD, FIRST_COMPLETED)
                took = [self._took(each) for each in done]
                if not all(took):
                    raise BrokenExecutor
                self._report()
        except BrokenExecutor:
            for each in list(self._under_way):
                self._took(each)
            return False
        except (KeyboardInterrupt, Cancelled):
            self._drain(is_own)
            raise
        self._report()
        return True

    def _filled(self, submit: Callable[..., Future[Any]], most: int) -> bool:
        """Submit tasks until *most* are under way; return whether any is."""
        while self.is_left() and len(self._under_way) < (1 if self._suspects else most):
            queue = self._suspects or self._waiting
            task = queue[0]
            future = submit(task.data, list(task.poses.values()), self._plan.settings)
            self._under_way[future] = queue.popleft()
        return bool(self._under_way)

    def _took(self, future: Future[Any]) -> bool:
        """Store the result of a task, or try it again; return False if its process has died."""
        task = self._under_way.pop(future)
        try:
            data, rows = future.result()
        except CancelledError:
            raise Cancelled(f"the executor has ended; {_CONTINUE}") from None
        except BrokenExecutor:
            self._try_again(task, "its process died", is_suspect=True)
            return False
        except Exception as fault:  # noqa: BLE001 - whatever a task or an executor raises
            self._try_again(task, f"{type(fault).__name__}: {fault}", is_suspect=False)
            return True
        self._add(task.mesh_key, data, dict(zip(task.poses, rows, strict=True)))
        for each in reversed(task.later):
            queue = self._suspects if each.is_suspect else self._waiting
            queue.appendleft(replace(each, data=data, is_prepared=True))
        return True

    def _try_again(self, task: _Task, reason: str, *, is_suspect: bool) -> None:
        """Try a task again pose by pose, its mesh first; the second time set its poses aside."""
        if task.tries + 1 == _MOST_TRIES:
            poses = [key for each in (task, *task.later) for key in each.poses]
            row = Row(SET_ASIDE, f"tried {_MOST_TRIES} times: {reason}")
            self._add(task.mesh_key, None, dict.fromkeys(poses, row))
            return
        again = replace(task, tries=task.tries + 1, is_suspect=is_suspect)
        each = [replace(again, poses={key: pose}, later=()) for key, pose in task.poses.items()]
        if not task.is_prepared:
            each = [replace(again, poses={}, later=(*each, *task.later))]
        (self._suspects if is_suspect else self._waiting).extend(each)

    def _drain(self, cancels: bool) -> None:
        """Wait for the tasks that are under way, and store them."""
        for future, task in self._under_way.items():
            if not (cancels and future.cancel()):
                with suppress(Exception):
                    data, rows = future.result()
                    self._add(task.mesh_key, data, dict(zip(task.poses, rows, strict=True)))

    def _add(self, mesh_key: str, data: bytes | None, rows: Mapping[str, Row]) -> None:
        self._store.add(mesh_key, data, rows)
        self._done += len(rows)
        self._computed += len(rows) if data is not None else 0
        self._missing += sum(not row.data for row in rows.values())

    def _report(self) -> None:
        if self._remote is not None:
            self._remote.checkpoint(NAME, self._store.copy)
        left, text = self._total - self._done, f"{self._done:,} of {self._total:,} poses"
        if self._missing:
            text += f", {self._missing:,} failed"
        if self._computed and left:
            seconds = left * (time.monotonic() - self._began) / self._computed
            text += f", {_duration(seconds)} left"
        tell(self._progress, self._done / self._total, text)

    def _new_tasks(self) -> Iterator[_Task]:
        """Yield the tasks of one mesh after another, and number their poses."""
        plan, store = self._plan, self._store
        for m, given in enumerate(plan.meshes):
            mesh_key, name, keys = "", str(given), list[str]()
            poses, failed = _Poses(), dict[str, Row]()
            try:
                own = Given(given, m)
                mesh_key, name = plan.mesh_key(own.mesh), own.name
                resolve = own.resolved
            except (SegDeformError, OSError) as fault:
                resolve = partial(_raised, ArgumentError(str(fault)))
            for k, pose in enumerate(plan.poses):
                try:
                    values = resolve(pose)
                    key = plan.pose_key(mesh_key, values)
                    poses[key] = values
                except (SegDeformError, OSError) as fault:
                    key = digest(mesh_key, name, k, str(fault))
                    failed[key] = Row(FAILED, str(fault))
                keys.append(key)
            names = [_name(k, each) for k, each in enumerate(plan.poses)]
            first = m * len(names)
            store.name(
                (first + k, name, *both, mesh_key)
                for k, both in enumerate(zip(names, keys, strict=True))
            )
            self._add(mesh_key, None, failed)
            left = {k: v for k, v in poses.items() if not store.has(k, retry=self._retry)}
            self._done += len(keys) - len(failed) - len(left)
            if not left:
                continue
            known = store.packed(mesh_key)
            task = _Task(mesh_key, known or packed(own.mesh), left, is_prepared=known is not None)
            each = [replace(task, poses=block) for block in _blocks(left, plan.block)]
            if len(each) > 1 and known is None:
                each = [replace(task, poses={}, later=tuple(each))]
            yield from each


def _submitted(pool: Executor, *task: Any) -> Future[Any]:
    return pool.submit(compute_alone, *task)


def _raised(fault: Exception, _: object) -> Any:
    raise fault


def _name(number: int, pose: Mapping[str, Any]) -> str:
    return f"random {pose['number']}" if "number" in pose else f"pose {number}"


def _blocks(poses: _Poses, size: int) -> Iterator[_Poses]:
    items = iter(poses.items())
    while block := dict(islice(items, size)):
        yield block


def _duration(seconds: float) -> str:
    """Return a duration as text.

    >>> _duration(40.2), _duration(400.0), _duration(9e4)
    ('40 s', '7 min', '25.0 h')
    """
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
