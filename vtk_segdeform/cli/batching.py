"""The commands ``batch``: all poses of a plan; and ``pose``: one of them as a mesh file."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from .. import io
from ..batches import PoseStore, is_url
from ..batches import batch as computed
from ..errors import MissingDependencyError
from ..progress import Progress
from .outputs import Say

_SHOWN = 10  # poses without vertices that are listed


def batch(options: Namespace, say: Say, progress: Progress) -> bool:
    """Compute all poses of a plan; False if some have no vertices."""
    with _cluster(options.scheduler) as (executor, count):
        store = computed(
            options.plan, options.output, executor=executor, n_workers=options.workers or count,
            retry=options.retry, progress=progress,
        )  # fmt: skip
    table = store.table()
    counts = Counter(table["status"])
    say(f"poses           {len(store):,}: {', '.join(f'{n:,} {s}' for s, n in counts.items())}")
    lost = [k for k, volume in enumerate(table["volume_change"]) if volume is None]
    for k in lost[:_SHOWN]:
        say(f"no pose {k:7} {table['mesh'][k]}, {table['pose'][k]}: {table['message'][k]}")
    if len(lost) > _SHOWN:
        say(f"                {len(lost) - _SHOWN:,} more; see the table")
    if draws := [count for count in table["draws"] if count is not None]:
        share = 1.0 - len(draws) / sum(draws)
        say(f"refused         {share:.0%} of {sum(draws):,} drawn random poses")
    say(f"written         {options.output if is_url(options.output) else store.path}")
    return not lost


def pose(options: Namespace, say: Say, progress: Progress) -> bool:  # noqa: ARG001
    """Write one pose of a batch as a mesh file."""
    io.require_writable(options.output)
    PoseStore(options.input).write_mesh(options.number, options.output)
    say(f"written         {options.output}")
    return True


@contextmanager
def _cluster(address: str | None) -> Iterator[tuple[Executor | None, int | None]]:
    """Yield the executor of a Dask cluster and the number of its threads, or None twice."""
    if address is None:
        yield None, None
        return
    try:
        from distributed import Client
    except ImportError:
        raise MissingDependencyError(
            "--scheduler requires Dask; pip install 'vtk-segdeform[dask]'"
        ) from None
    with Client(address) as client:  # type: ignore[no-untyped-call]
        yield client.get_executor(), sum(client.ncores().values()) or None
