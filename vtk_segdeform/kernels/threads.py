"""Parallel loops over rows, on all cores that this process may use.

    in_parallel(work, n, size)        calls work(start, stop) for tasks of about *size* rows
    nearest(tree, points)             queries a k-d tree
    one_thread()                      a task among many works in its own thread only
    quick_turns()                     lets the main thread in, while another one works in Python

numpy and the compiled kernels release the GIL, so ordinary threads suffice.  There are two thread
pools per process, for any number of open meshes: one for the main thread, which draws, and one for
all other threads, so that the main thread never waits for tasks of theirs.  A host application can
limit them with ``SEGDEFORM_THREADS=1``.  Every row is computed in the same way on any thread, so
results do not depend on the number of threads.
"""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import sizes
from ..arrays import FloatArray, IntArray
from ..importing import imported
from ..progress import Progress

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

ROWS_AT_ONCE = 1 << 15
"""Rows of a task or of a temporary array: beside their work a call takes no time."""

_TURN = 1e-4  # seconds
_finding = threading.Lock()
_own = threading.local()  # is_alone: whether this thread uses no others
_turns_lock = threading.Lock()
_turns: list[float] = []  # the interval before, and that of each thread with quick turns


def in_parallel(
    work: Callable[[int, int], None],
    n: int,
    size: int,
    *,
    progress: Progress | None = None,
    message: str = "",
    blas: bool = True,
) -> None:
    """Call *work* with (start, stop) for all rows of 0..n, *size* at a time and in any order.

    Parameters
    ----------
    work : callable
        Must write to its own rows only, and must not call `in_parallel`.
    n, size : int
        Number of rows in total and per task.
    progress : Progress, optional
        Called in the caller's thread with the fraction done; if it raises, the remaining tasks
        are cancelled.
    message : str
        Text passed to *progress*.
    blas : bool
        Whether *work* multiplies matrices.  If not, BLAS is not looked for: the first time in a
        process takes as long as opening a mesh of 10,000 vertices.
    """
    tasks = [(start, min(start + size, n)) for start in range(0, n, size)]
    if len(tasks) <= 1 or n_threads() == 1:
        for start, stop in tasks:
            work(start, stop)
            if progress is not None:
                progress(stop / n, message)
        return
    with one_blas_thread() if blas else contextlib.nullcontext():
        pool = _pool(threading.current_thread() is threading.main_thread())
        futures = list[Future[None]]()
        try:
            for task in tasks:
                futures.append(pool.submit(work, *task))
            if progress is None:  # waking for each task would take time from the other threads
                wait(futures, return_when=FIRST_EXCEPTION)
            for task, future in zip(tasks, futures, strict=True):
                future.result()
                if progress is not None:
                    progress(task[1] / n, message)
        except BaseException:  # Ctrl+C as well: nothing may run any more
            for future in futures:
                future.cancel()
            _surely(lambda: wait(futures))
            raise


def nearest(
    tree: cKDTree, points: FloatArray, k: Sequence[int] = (1,), *, within: float = np.inf
) -> tuple[FloatArray, IntArray]:
    """Return the distances to the nearest points of a k-d tree, and their indices.

    The option ``workers`` of SciPy's query is unsafe: if a signal handler raises an exception while
    SciPy waits for its threads, it frees the arrays that they use, and the process crashes.

    Parameters
    ----------
    tree : cKDTree
        Of m points.
    points : (n, d) float
        Where to search.
    k : sequence of int
        Which neighbours to return; 1 is the nearest.
    within : float
        Upper bound of the distances.

    Returns
    -------
    distance : (n, len(k)) float
        Infinite if there is none within the bound.
    index : (n, len(k)) int
        m if there is none.
    """
    distance = np.empty((len(points), len(k)))
    index = np.empty(distance.shape, dtype=np.int64)

    def work(start: int, stop: int) -> None:
        distance[start:stop], index[start:stop] = tree.query(
            points[start:stop], k=list(k), distance_upper_bound=within
        )

    in_parallel(
        work, len(points), max(sizes.PARALLEL_SEARCH, -(-len(points) // n_threads())), blas=False
    )
    return distance, index


@contextlib.contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread, in a ``with`` block or, as a decorator, in a function.

    BLAS threads compete with the threads of `in_parallel`.  Besides, a step of the solver has many
    small products: waking another thread takes longer than such a product, and while the thread
    waits for more work it occupies a core.

    Most builds of BLAS have one number of threads for the whole process, and the order of summation
    depends on it.  So the first Python thread to enter sets the limit and the last to leave
    restores it, and calls in several threads give the same results as one after another, bit for
    bit.  Without threadpoolctl nothing is limited.
    """
    limit = _blas_limit()
    if limit is None:
        yield
        return
    caller = object()
    with limit.of_each_thread.limit(limits=1):
        try:
            limit.enter(caller)
            yield
        finally:
            _surely(lambda: limit.leave(caller))


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Let `in_parallel` work in the calling thread, in a ``with`` block, and BLAS in one thread.

    For one of many tasks that run side by side, each on a core of its own.
    """
    before, _own.is_alone = getattr(_own, "is_alone", False), True
    try:
        with one_blas_thread():
            yield
    finally:
        _own.is_alone = before


@contextlib.contextmanager
def quick_turns() -> Iterator[None]:
    """Let threads take turns in Python more often, in a ``with`` block of a background thread.

    Whenever the main thread waits for the GIL, another thread keeps it for 5 ms.  A frame waits
    dozens of times: with turns of 0.1 ms the first pull of 50,000 vertices, while the compiled
    kernels are imported, is held up for 0.4 s instead of 0.7.
    """
    with _turns_lock:
        if not _turns:
            _turns.append(sys.getswitchinterval())
            sys.setswitchinterval(min(_TURN, _turns[0]))
        _turns.append(_TURN)
    try:
        yield
    finally:
        with _turns_lock:
            _turns.pop()
            if len(_turns) == 1:
                sys.setswitchinterval(_turns.pop())


class _BlasLimit:
    """Limits BLAS to one thread in the whole process while any Python thread requires it."""

    def __init__(self, controller: Any) -> None:
        self._controller = controller
        # OpenMP builds have one limit per thread.  Most processes have none of them, but entering
        # and leaving also tells threadpoolctl that this thread has finished setting limits; until
        # then no other thread can set any.
        self.of_each_thread = controller.select(threading_layer="openmp")
        self._lock = threading.Lock()
        self._inside: set[object] = set()
        self._before: Any = None

    def enter(self, caller: object) -> None:
        """Limit BLAS, unless it is limited already."""
        with self._lock:
            self._inside.add(caller)
            if self._before is None:
                self._before = self._controller.limit(limits=1, user_api="blas")

    def leave(self, caller: object) -> None:
        """Restore the previous numbers of threads, unless another caller is still inside."""
        with self._lock:
            self._inside.discard(caller)
            if not self._inside and self._before is not None:
                self._before.restore_original_limits()
                self._before = None


def _surely(action: Callable[[], object]) -> None:
    """Call *action* again until it completes; it must raise no exception of its own.

    Exceptions of signal handlers are raised afterwards.
    """
    raised: BaseException | None = None
    while True:
        try:
            action()
            break
        except BaseException as fault:  # noqa: BLE001 - raised again below
            raised = fault
    if raised is not None:
        raise raised


def _blas_limit() -> _BlasLimit | None:
    if not _found_blas_limit.cache_info().currsize:
        with _finding:  # otherwise two threads would both search for the libraries
            return _found_blas_limit()
    return _found_blas_limit()


@functools.cache
def _found_blas_limit() -> _BlasLimit | None:
    try:
        library = imported("threadpoolctl")
    except ImportError:
        return None
    return _BlasLimit(library.ThreadpoolController())


def n_threads() -> int:
    """Return the number of threads: ``SEGDEFORM_THREADS``, or the cores of this process."""
    return 1 if getattr(_own, "is_alone", False) else _all_threads()


@functools.cache
def _all_threads() -> int:
    wanted = os.environ.get("SEGDEFORM_THREADS", "")
    if wanted.isdigit() and int(wanted) > 0:
        return int(wanted)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@functools.cache
def _pool(is_main: bool) -> ThreadPoolExecutor:
    """Return the pool of the main thread, or that of all other threads."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_pool.cache_clear)  # threads stay in the parent
    name = "segdeform" if is_main else "segdeform background"
    return ThreadPoolExecutor(n_threads(), thread_name_prefix=name)
