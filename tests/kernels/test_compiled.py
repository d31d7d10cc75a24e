"""The compiled kernels do what their twins in numpy do."""

from __future__ import annotations

import importlib
import threading
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vtk_segdeform import models
from vtk_segdeform.cages.fit import fit_cages
from vtk_segdeform.cages.mean_value import mean_value_coordinates
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.energy.hessian import Factor
from vtk_segdeform.errors import Cancelled
from vtk_segdeform.geometry.rotations import closest_rotations
from vtk_segdeform.geometry.volume import signed_volume, volume_along, volume_gradient
from vtk_segdeform.kernels import dispatch, threads
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.subspace.subspace import Subspace, _add_product, _adjoint_product

MESH = models.torus(3000)
RNG = np.random.default_rng(2)
MOVE = RNG.normal(size=MESH.vertices.shape)


@pytest.fixture
def twin(monkeypatch):
    """Return a caller that calls once compiled and once plain, and returns both results."""
    pytest.importorskip("numba")
    assert dispatch.compiled_kernels(10**6) is not None

    def both(call):
        quick = call()
        with monkeypatch.context() as without:
            without.setattr(dispatch, "_kernels", lambda: None)
            return quick, call()

    return both


@pytest.mark.parametrize("far", [0.0, 1e3])
def test_volumes_agree(twin, far):
    x, faces = MESH.vertices + far, MESH.faces
    size = abs(signed_volume(MESH.vertices, faces))
    for call in (
        lambda: signed_volume(x, faces),
        lambda: volume_along(x, MOVE, faces),
        lambda: volume_gradient(x, faces),
    ):
        quick, plain = twin(call)
        assert_allclose(quick, plain, rtol=1e-12, atol=(1e-14 + 1e-15 * far) * size)


SHAPES = {
    "any": RNG.normal(size=(300, 3, 3)),
    "almost at rest": np.eye(3) + 0.1 * RNG.normal(size=(300, 3, 3)),
    "flat": RNG.normal(size=(300, 3, 2)) @ RNG.normal(size=(300, 2, 3)),
    "straight": RNG.normal(size=(300, 3, 1)) @ RNG.normal(size=(300, 1, 3)),
    "mirrored": np.linalg.qr(RNG.normal(size=(300, 3, 3)))[0] * [1.0, 1.0, -1.0],
    "half turns": np.tile(np.diag([-1.0, -1.0, 1.0]), (300, 1, 1)),
    "nothing": np.zeros((300, 3, 3)),
    "tiny": 1e-160 * RNG.normal(size=(300, 3, 3)),
    "huge": 1e100 * RNG.normal(size=(300, 3, 3)),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_rotations_are_rotations_and_as_close(twin, kind):
    s = SHAPES[kind]
    quick, plain = twin(lambda: closest_rotations(s))
    assert_allclose(quick @ np.swapaxes(quick, 1, 2), np.tile(np.eye(3), (300, 1, 1)), atol=1e-13)
    assert_allclose(np.linalg.det(quick), 1.0, atol=1e-13)
    # Where several rotations are equally close, either may be found: what counts is how close.
    reached, best = (np.einsum("gij,gji->g", r, s) for r in (quick, plain))
    assert_allclose(reached, best, rtol=0.0, atol=1e-13 * np.abs(s).max())
    if kind in ("any", "almost at rest", "flat"):
        assert_allclose(quick, plain, atol=1e-11)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("columns", [3, 6, 9])
def test_products_agree_and_are_taken_in_double_precision(twin, dtype, columns):
    rows = np.sort(RNG.permutation(6000)[:4000])
    block, p = RNG.normal(size=(4000, 37)).astype(dtype), RNG.normal(size=(37, columns))
    y = RNG.normal(size=(6000, 3))

    def product():
        x = np.ones((6000, columns))
        _add_product(x, rows, block, p, compiled=True)
        return x

    quick, plain = twin(product)
    exact = np.ones((6000, columns))
    exact[rows] += block.astype(np.float64) @ p
    assert_allclose(plain, exact, atol=1e-12)
    assert_allclose(quick, exact, atol=1e-12)
    quick, plain = twin(lambda: _adjoint_product(rows, block, y, compiled=True))
    assert_allclose(quick, plain, atol=1e-10)
    assert_allclose(plain, block.astype(np.float64).T @ y[rows], atol=1e-10)


@pytest.mark.parametrize(("coupled", "n"), [(True, 3 * 60), (False, 180)])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_triangles_are_solved_alike(twin, coupled, n, count):
    spread = RNG.normal(size=(n, n))
    hessian = spread @ spread.T + np.eye(n)
    factor = Factor(np.linalg.cholesky(hessian), coupled)
    ys = [RNG.normal(size=(n // 3 if coupled else n, 3)) for _ in range(count)]
    exact = np.linalg.inv(hessian)
    for quick, plain, y in zip(*twin(lambda: factor.solve_all(ys)), ys, strict=True):
        solved = (exact @ y.T.ravel()).reshape(3, -1).T if coupled else exact @ y
        assert quick.shape == plain.shape == y.shape
        assert_allclose(plain, solved, atol=1e-9 * np.abs(solved).max())
        assert_allclose(quick, solved, atol=1e-9 * np.abs(solved).max())


def test_results_do_not_depend_on_how_many_threads_there_are(monkeypatch):
    volume = volume_along(MESH.vertices, MOVE, MESH.faces)
    monkeypatch.setattr(threads, "n_threads", lambda: 1)
    assert_array_equal(volume_along(MESH.vertices, MOVE, MESH.faces), volume)


def test_every_row_is_worked_on_once_and_by_others_than_the_caller(monkeypatch):
    monkeypatch.setattr(threads, "n_threads", lambda: 2)
    done, workers = np.zeros(1000, dtype=int), set()

    def work(start, stop):
        done[start:stop] += 1
        workers.add(threading.current_thread())

    threads.in_parallel(work, 1000, 7)
    assert (done == 1).all()
    assert threading.current_thread() not in workers


def test_after_it_was_cancelled_nothing_works_on(monkeypatch):
    monkeypatch.setattr(threads, "n_threads", lambda: 2)
    done = []

    def stop(fraction, message):
        assert message == "counting"
        if fraction >= 0.1:
            raise Cancelled

    def work(start, stop):
        time.sleep(1e-3)
        done.append(start)

    with pytest.raises(Cancelled):
        threads.in_parallel(work, 500, 1, progress=stop, message="counting")
    finished = len(done)
    assert 50 <= finished < 250
    time.sleep(5e-3)
    assert len(done) == finished


def test_a_fault_in_the_work_reaches_the_caller(monkeypatch):
    monkeypatch.setattr(threads, "n_threads", lambda: 2)

    def work(start, stop):
        if start == 50:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        threads.in_parallel(work, 100, 10)


def test_mean_value_coordinates_agree_wherever_the_point_is(twin):
    cage = models.sphere(162)
    p, corners = cage.vertices, cage.vertices[cage.faces]
    share = RNG.dirichlet(np.ones(3), len(corners))[:, :, None]
    on_faces, on_edges = (share * corners).sum(axis=1), corners[:, :2].mean(axis=1)
    in_planes = 2.0 * corners[:, 0] - corners[:, 1]
    places = [p, on_faces, on_edges, in_planes, on_faces * (1.0 - 1e-9), RNG.normal(size=(2000, 3))]
    points = np.concatenate(places)
    quick, plain = twin(lambda: mean_value_coordinates(points, p, cage.faces))
    assert_allclose(quick, plain, atol=1e-11)
    assert_allclose(quick @ p, points, atol=1e-11)


@pytest.mark.parametrize("columns", [3, 6, 9])
def test_a_small_subspace_multiplied_in_one_call_is_the_sum_over_its_regions(twin, columns):
    rows = [np.sort(RNG.permutation(4001)[:count]) for count in (3000, 1801, 0, 7)]
    blocks = [RNG.normal(size=(len(own), m)) for own, m in zip(rows, (50, 33, 20, 12), strict=True)]
    subspace = Subspace(4001, tuple(rows), tuple(blocks))
    reached = subspace.sets_by_cages()
    assert 5 <= len(reached) <= 8  # by none, by one, by two, by three
    assert_array_equal(np.sort(np.concatenate(reached)), np.arange(4001))
    p, start, y = (RNG.normal(size=(k, c)) for k, c in ((115, columns), (4001, 3), (4001, 3)))
    for call in (
        lambda: subspace.map(p),
        lambda: subspace.map(p, start),
        lambda: subspace.adjoint(y),
        lambda: subspace.adjoints([y]),
        lambda: subspace.adjoints([y, y[::-1]]),
        lambda: subspace.adjoints([y, 2.0 * y, -y]),
    ):
        quick, plain = twin(call)
        assert subspace._is_packed
        assert_allclose(quick, plain, rtol=1e-12, atol=1e-11)
    assert subspace.adjoints([]) == []


@pytest.mark.parametrize("regions", [1, 5, 70])
def test_the_cages_that_reach_a_vertex_are_found_for_any_number_of_regions(regions):
    n = 400
    rows = [np.sort(RNG.permutation(n)[: RNG.integers(0, 30)]) for _ in range(regions)]
    rows[0] = np.arange(n)
    subspace = Subspace(n, tuple(rows), tuple(RNG.normal(size=(len(own), 2)) for own in rows))
    dense = subspace.map(np.eye(2 * regions))
    membership = np.array([np.isin(np.arange(n), own) for own in rows])
    alike = subspace.sets_by_cages()
    kinds = np.unique(membership.T, axis=0)  # in this order: by the first region, then the second
    assert len(alike) == len(kinds)
    for ids, kind in zip(alike, kinds, strict=True):
        assert_array_equal(ids, np.flatnonzero((kind == membership.T).all(axis=1)))
        columns, w = subspace.nonzeros(ids)
        assert_array_equal(columns, np.flatnonzero(np.repeat(kind, 2)))
        assert_array_equal(w, dense[np.ix_(ids, columns)])
    some = np.sort(RNG.permutation(n)[:50])
    columns, w = subspace.nonzeros(some)
    assert_array_equal(columns, np.flatnonzero(np.repeat(membership[:, some].any(axis=1), 2)))
    assert_array_equal(w, dense[np.ix_(some, columns)])


def test_without_a_cache_folder_kernels_are_compiled_nevertheless(monkeypatch):
    caching = pytest.importorskip("numba.core.caching")
    kernels = importlib.import_module("vtk_segdeform.kernels.compiled.kernels")
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    twice = kernels.kernel()(lambda x: x + x)
    assert twice(1.5) == 3.0
    assert twice.signatures


def test_set_up_runs_a_trial_step_so_the_first_frame_waits_for_no_kernel(monkeypatch):
    pytest.importorskip("numba")
    mesh = models.torus(3000)
    regions = Regions.single(mesh)
    cages = fit_cages(mesh, regions, 60)
    loaded, messages = [], []
    for name in dispatch._kernels().__all__:
        own = getattr(dispatch._kernels(), name)

        def called(*arguments, own=own):
            loaded.append((own, *(type(each) for each in arguments)))
            return own(*arguments)

        monkeypatch.setattr(dispatch._kernels(), name, called)
    deformer = Deformer(mesh, regions, cages, progress=lambda _, text: messages.append(text))
    assert messages[-2:] == ["taking a trial step", "ready"]
    before = set(loaded)
    held = deformer.hold(fixed=mesh.vertices[:, 0] < -1.0, handle=[0, 1, 2])
    assert held.solve(mesh.vertices[:3] + [0.1, 0.0, 0.0]).steps > 0
    assert set(loaded) == before
