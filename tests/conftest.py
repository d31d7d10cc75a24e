"""Settings for all tests: no windows, one thread per worker, no files in the user's folders."""

from __future__ import annotations

import functools
import gc
import hashlib
import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

# Set before numpy, scipy and VTK are imported, because they read these variables once.  More
# threads than cores slow the workers down, and another order of summation changes last digits.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ.setdefault("LP_NUM_THREADS", "0")  # additional rendering threads of Mesa
os.environ["PYVISTA_OFF_SCREEN"] = "true"
os.environ["SEGDEFORM_CACHE"] = "0"  # no files in the user's folders
os.environ.setdefault("SEGDEFORM_THREADS", "1")
if "PYTEST_XDIST_WORKER" in os.environ:
    # Without bytecode files, every worker and every child process would compile all modules again.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    # Without a display VTK warns once per window that it cannot connect to X; EGL needs none.
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import numpy as np  # noqa: E402 - it reads the variables above
import pytest  # noqa: E402 - its plugins read the variables above

# The product is imported where it is needed: not by the process that only distributes the tests,
# which would do so before it starts the workers.
_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
_WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
_PROGRAMS = {"app", "qt", "web"}
_parts: dict[bytes, Any] = {}  # of coarse surfaces
_bindings: dict[Any, Any] = {}  # by the digests of their inputs, and the sizes in force


class _Backwards(pytest.Dir):
    """A folder whose last file is collected first."""

    def collect(self) -> list[Any]:
        return [*super().collect()][::-1]


def pytest_collect_directory(path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Let every other worker begin at the end: what one has compiled, the other reads."""
    return _Backwards.from_parent(parent, path=path) if _WORKER % 2 else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let the last worker begin with the tests of programs.

    So the tests at the end, which workers take from each other, are short and start no browser.
    """
    if _WORKERS == 1:
        return
    items.sort(key=lambda item: item.path)
    programs = [item for item in items if item.path.parent.name in _PROGRAMS]
    others = [item for item in items if item.path.parent.name not in _PROGRAMS]
    last = (_WORKERS - 1) * len(items) // _WORKERS
    items[:] = [*others[:last], *programs, *others[last:]]


gc.disable()  # until all tests are collected: imports create no garbage that is worth a search


def pytest_collection_finish() -> None:
    """Exempt what is alive now, half a million objects, from every later garbage collection.

    Later ones are rarer than by default: a kernel being compiled or a source file being parsed has
    a million objects alive, among which they would search in vain dozens of times.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _quick_rendering() -> None:
    import pyvista as pv

    pv.global_theme.multi_samples = 1  # multisampling makes software rendering five times slower
    pv.global_theme.window_size = [400, 300]  # of whoever asks for no size


@pytest.fixture(scope="session", autouse=True)
def _no_flushing() -> Iterator[None]:
    """Leave it to the system when files reach the disk: no test survives a power failure."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", lambda _: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _compiled_kernels() -> Iterator[None]:
    """Compile the kernels first; after the tests, check that they cover all types that occurred."""
    from vtk_segdeform.kernels import wait_until_compiled

    wait_until_compiled()
    yield
    name = "vtk_segdeform.kernels.compiled.kernels"
    if name in sys.modules:
        made = importlib.import_module(name)  # waits for a thread that is loading it
        for kernel, combinations in made.KERNELS:
            others = set(kernel.signatures) - set(combinations)
            assert not others, f"{kernel.__name__} is not compiled in advance for {others}"


@pytest.fixture(scope="session", autouse=True)
def fitted_once() -> Iterator[Any]:
    """Fit equal cages around equal regions once per process; yield the function that fits."""
    from vtk_segdeform.cages import fit

    fitting, known = fit._fit, {}

    def fitted(patch: Any, n: int, offset: Any, progress: Any = None) -> Any:
        if progress is not None:  # which a test may count, or cancel by
            return fitting(patch, n, offset, progress)
        inputs = hashlib.blake2b(repr((n, offset)).encode())
        for array in (patch.surface.points, patch.surface.faces, patch.members):
            inputs.update(np.ascontiguousarray(array))
        key = inputs.digest()
        if key not in known:
            known[key] = fitting(patch, n, offset, None)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "_fit", fitted)
        yield fitting


@pytest.fixture(scope="session", autouse=True)
def _coordinates_once() -> Iterator[None]:
    """Compute equal mean value coordinates of bindings once, unless with reports of progress."""
    from vtk_segdeform import sizes
    from vtk_segdeform.energy import interior
    from vtk_segdeform.kernels import dispatch
    from vtk_segdeform.subspace import subspace

    compute = subspace.mean_value_coordinates
    known: dict[Any, np.ndarray] = {}

    def coordinates(points: Any, vertices: Any, faces: Any, *, progress: Any = None) -> Any:
        if progress is not None or len(points) * len(vertices) > 250_000:
            return compute(points, vertices, faces, progress=progress)
        inputs = hashlib.blake2b()
        for array in (points, vertices, faces):
            inputs.update(np.ascontiguousarray(array))
        key = inputs.digest(), len(points), sizes.COMPILED, dispatch._kernels
        if key not in known:
            if sum(each.nbytes for each in known.values()) > 100e6:
                known.clear()
            known[key] = compute(points, vertices, faces)
        return known[key].copy()

    with pytest.MonkeyPatch.context() as patch:
        for module in (subspace, interior):
            patch.setattr(module, "mean_value_coordinates", coordinates)
        yield


@pytest.fixture(scope="module", autouse=True)
def segmented_once() -> Iterator[None]:
    """Find the parts of equal coarse surfaces once per process, unless with reports of progress."""
    from vtk_segdeform.regions import segmentation

    find = segmentation._parts

    def found(surface: Any, n_regions: int | None, progress: Any) -> Any:
        if progress is not None:
            return find(surface, n_regions, progress)
        inputs = hashlib.blake2b(repr(n_regions).encode())
        tables = (surface.graph, surface.contact)
        arrays = [array for t in tables for array in (t.data, t.indices, t.indptr)]
        for array in (surface.vertices, surface.faces, surface.areas, *arrays):
            inputs.update(np.ascontiguousarray(array))
        key = inputs.digest()
        if key not in _parts:
            _parts[key] = find(surface, n_regions, None)
        return _parts[key].copy()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segmentation, "_parts", found)
        yield


@pytest.fixture(autouse=True)
def _windows_again() -> Iterator[None]:
    hands = sys.modules.get("hands")  # which imports VTK
    with hands.windows_again() if hands else nullcontext():
        yield


@pytest.fixture(scope="session", autouse=True)
def _bodies_once() -> Iterator[None]:
    """Create each body of limbs once per process; meshes are immutable."""
    from vtk_segdeform import models

    def once(make: Any) -> Any:
        known: dict[Any, Any] = {}

        @functools.wraps(make)
        def body(*args: Any, **named: Any) -> Any:
            if not all(type(value) is int for value in (*args, *named.values())):
                return make(*args, **named)
            key = args, tuple(sorted(named.items()))
            if key not in known:
                known[key] = make(*args, **named)
            return known[key]

        return body

    with pytest.MonkeyPatch.context() as patch:
        for name in ("cactus", "dinosaur", "random_limbs"):
            patch.setattr(models, name, once(getattr(models, name)))
        yield


@pytest.fixture(params=["numba", "numpy"])
def either(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run with and without compiled kernels, whatever the size."""
    from vtk_segdeform import sizes
    from vtk_segdeform.kernels import dispatch

    monkeypatch.setattr(sizes, "COMPILED", 0)
    monkeypatch.setattr(sizes, "COMPILED_CHECKS", 0)
    if request.param == "numba":
        pytest.importorskip("numba")
    else:
        monkeypatch.setattr(dispatch, "_kernels", lambda: None)


def _binding_of(bind: Any, inputs: Any, folder: Any, progress: Any) -> Any:
    from vtk_segdeform import sizes

    key = inputs.digest(), *(size for size in vars(sizes).values() if isinstance(size, int | float))
    if key not in _bindings:
        if len(_bindings) > 100:
            _bindings.clear()
        _bindings[key] = bind(inputs, folder, progress)
    return _bindings[key]


@pytest.fixture(scope="module", autouse=True)
def bound_once_in_memory() -> Iterator[None]:
    """Bind equal meshes, regions and cages once, unless in a folder or with reports of progress."""
    from vtk_segdeform.deformer import problem

    bind = problem.cached_binding

    def bound(inputs: Any, folder: Any, progress: Any = None) -> Any:
        known = folder is None and progress is None
        return _binding_of(bind, inputs, None, None) if known else bind(inputs, folder, progress)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(problem, "cached_binding", bound)
        yield


@pytest.fixture(scope="module")
def bound_once(bound_once_in_memory: None) -> Iterator[None]:
    """Bind equal inputs once, whatever the folder: for tests of poses, not of binding."""
    from vtk_segdeform.deformer import problem

    bind = problem.cached_binding

    def bound(inputs: Any, folder: Any, progress: Any = None) -> Any:
        return _binding_of(bind, inputs, folder, progress)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(problem, "cached_binding", bound)
        yield


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that do not depend on the tests before: modules share no generator."""
    return np.random.default_rng(5)


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute the volume of small meshes over a coarse surface in each step, as of larger ones."""
    from vtk_segdeform import sizes

    monkeypatch.setattr(sizes, "COARSE_VOLUME", 250)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 175)


@pytest.fixture
def scaled(coarse: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scale small meshes to their volume, as large ones are."""
    from vtk_segdeform import sizes

    monkeypatch.setattr(sizes, "SCALED_VOLUME", 250)
