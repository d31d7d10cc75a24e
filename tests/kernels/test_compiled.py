"""The compiled kernels agree with their equivalents in numpy."""

from __future__ import annotations

import copy
import functools
import importlib
import sys
import threading
import time
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from open_surfaces import bottle, moebius, sheet
from scipy import sparse
from solids import OCTAHEDRON, icosphere, together, torus

from vtk_segdeform import Mesh, Surface, models, sizes
from vtk_segdeform.cages.fit import fit_cages
from vtk_segdeform.cages.mean_value import mean_value_coordinates
from vtk_segdeform.cages.simplify import (
    _NO_EDGES,
    _accumulated,
    _costs,
    _independent,
    _valid,
    simplify,
)
from vtk_segdeform.deformer.deformer import Deformer
from vtk_segdeform.energy.hessian import Factor
from vtk_segdeform.errors import Cancelled
from vtk_segdeform.finish import CellEnergy
from vtk_segdeform.finish.factor import factored
from vtk_segdeform.geometry.lids import lids_of
from vtk_segdeform.geometry.normals import VertexNormals
from vtk_segdeform.geometry.rotations import closest_rotations
from vtk_segdeform.geometry.volume import (
    area_gradient,
    signed_volume,
    volume_along,
    volume_gradient,
)
from vtk_segdeform.io.polygons import (
    triangles_of,
)
from vtk_segdeform.kernels import dispatch, threads
from vtk_segdeform.mesh import (
    find_faults,
    intersections_of,
    mesh_of,
    nearest_on_triangles,
    self_intersections,
)
from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.solver.exact_volume import moved_along
from vtk_segdeform.solver.other_measures import CentroidConstraint, area_of, centroid_of
from vtk_segdeform.solver.volume_constraints import region_volumes
from vtk_segdeform.solver.volumes import values_along, violations
from vtk_segdeform.subspace.subspace import Subspace, _add_product

RNG = np.random.default_rng(2)


@pytest.fixture
def twin(monkeypatch):
    """Return a function that calls with and without compiled kernels and returns both results."""
    pytest.importorskip("numba")
    assert dispatch.compiled_kernels(10**6) is not None

    def both(call):
        quick = call()
        with monkeypatch.context() as without:
            without.setattr(dispatch, "_kernels", lambda: None)
            return quick, call()

    return both


def test_checks_import_numba_only_where_it_pays(monkeypatch):
    pytest.importorskip("numba")
    monkeypatch.delitem(sys.modules, "vtk_segdeform.kernels.compiled", raising=False)
    monkeypatch.setattr(dispatch, "_checked", [0])
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED_CHECKS", 100)
    assert dispatch.compiled_checks(60) is None
    assert dispatch.compiled_checks(60) is not None


def test_kernels_are_loaded_early_in_another_thread_and_only_once(monkeypatch):
    names = []
    kernels = functools.cache(lambda: names.append(threading.current_thread().name))
    started = []
    monkeypatch.setattr(dispatch, "_module", kernels)
    monkeypatch.setattr(dispatch, "Thread", lambda **k: started.append(k) or threading.Thread(**k))
    for _ in range(2):
        dispatch.load_early()
        for thread in threading.enumerate():
            if thread.name == "segdeform kernels":
                thread.join()
        assert names == ["segdeform kernels"]
    kernels.cache_clear()
    dispatch.compiled_kernels()
    dispatch.load_early()
    assert len(started) == 1


def test_small_arrays_do_not_wait_for_late_kernels(monkeypatch):
    loaded = object()
    monkeypatch.delitem(sys.modules, "vtk_segdeform.kernels.compiled", raising=False)
    monkeypatch.setattr(dispatch, "_checked", [sizes.COMPILED_CHECKS])
    kernels = functools.cache(lambda: loaded)
    monkeypatch.setattr(dispatch, "_module", kernels)
    monkeypatch.setattr(dispatch, "_is_late", [False])
    dispatch.load_late()
    assert dispatch.compiled_kernels(sizes.COMPILED_LATE - 1) is None
    for _ in range(2):  # nor do checks, however many of them there are
        assert dispatch.compiled_checks(sizes.COMPILED_LATE - 1) is None
    assert not kernels.cache_info().currsize
    assert dispatch.compiled_kernels(sizes.COMPILED_LATE) is loaded
    assert dispatch.compiled_kernels(sizes.COMPILED) is loaded
    dispatch.load_late()  # too late
    assert dispatch.compiled_kernels(sizes.COMPILED) is loaded
    assert dispatch.compiled_kernels(sizes.COMPILED - 1) is None


def test_a_product_stays_the_same_when_late_kernels_are_loaded(monkeypatch, rng):
    pytest.importorskip("numba")
    block = rng.random((900, 60))
    subspace = Subspace(900, (np.arange(900),), (block,))
    p = rng.normal(size=(60, 3))
    monkeypatch.setattr(dispatch, "_is_late", [True])
    before = subspace.map(p)
    monkeypatch.setattr(dispatch, "_is_late", [False])
    assert_array_equal(subspace.map(p), before)
    assert not subspace._is_compiled
    assert Subspace(900, (np.arange(900),), (block,))._is_compiled


def test_any_triangles_become_the_same_mesh(twin, monkeypatch):
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED_CHECKS", 0)
    for seed in range(12):
        vertices, faces = torn(seed)

        def call(vertices=vertices, faces=faces):
            soup, report = mesh_of(vertices, faces), find_faults(vertices, faces)
            texts = *map(str, soup.workarounds), str(report), str(report.is_closed)
            arrays = [soup.vertex_of, soup.mesh.boundary, soup.mesh.vertices, soup.mesh.faces]
            return texts, [*arrays, *(each.points for each in soup.workarounds)]

        (texts, arrays), (expected, others) = twin(call)
        assert texts == expected
        for one, other in zip(arrays, others, strict=True):
            assert_array_equal(one, other)


def torn(seed):
    """Return parts with holes, flips, repeated faces, fins, seams or points in no face."""
    rng = np.random.default_rng(seed)
    band = np.asarray(moebius().points, float), triangles_of(moebius())
    parts = [icosphere(1), band, torus(9, 6), torus(8, 5), OCTAHEDRON]
    vertices, faces = together(*(parts[k] for k in rng.integers(0, len(parts), 2)))
    vertices = vertices * 10 ** rng.uniform(-7, 6) + 0.0
    if seed % 2:
        faces = faces[rng.random(len(faces)) > 0.02]
    if seed % 3 == 1:
        flip = rng.random(len(faces)) < 0.03
        faces = np.where(flip[:, None], faces[:, ::-1], faces)
    if seed % 4 == 1:
        more = np.c_[faces[:3, :2], rng.integers(0, len(vertices), 3)]
        faces = np.vstack([faces, faces[:2, [1, 0, 2]], more])
    if seed % 4 == 2:
        side = vertices[faces].mean(axis=1)[:, 0] > 0
        keys, number = np.unique(2 * faces.ravel() + np.repeat(side, 3), return_inverse=True)
        vertices, faces = vertices[keys // 2], number.reshape(-1, 3)
    if seed % 5 == 1:
        vertices = np.vstack([vertices, [[np.nan, 0, 0], vertices[0]]])
    return vertices, faces


def lattice(seed):
    """Return triangles that touch, overlap in a plane, fold over an edge or are flat."""
    rng = np.random.default_rng(seed)
    points = np.stack(np.meshgrid(*3 * [np.arange(3.0)]), axis=-1).reshape(-1, 3)
    return points, np.array([rng.permutation(27)[:3] for _ in range(120)])


def needles(seed):
    """Return triangles of very different sizes, some of which are needles."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2.0, 0.5, 200)[:, None, None]
    corners = rng.normal(size=(200, 1, 3)) + size * rng.normal(size=(200, 3, 3))
    share = 10.0 ** rng.uniform(-14.0, 0.0, 50)[:, None]
    corners[:50, 2] = corners[:50, 0] + share * (corners[:50, 2] - corners[:50, 0])
    return corners.reshape(-1, 3), np.arange(600).reshape(-1, 3)


def crossed(seed):
    """Return two spheres that cross, and a third one nearby."""
    turned = [
        (x + 0.7 * k * np.array([1.0, 0.1, 0.2 * seed]), f)
        for k in range(2)
        for x, f in [icosphere(3)]
    ]
    return together(*turned, (icosphere(2)[0] + [0.0, 0.0, 1.95], icosphere(2)[1]))


@pytest.mark.parametrize(("seed", "far"), [(0, 0.0), (1, 1e5)])
@pytest.mark.parametrize("soup", [lattice, needles, crossed])
def test_the_same_faces_intersect(twin, monkeypatch, soup, seed, far):
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED_CHECKS", 0)
    monkeypatch.setattr("vtk_segdeform.mesh.near_faces._PIECE", 50)
    points, faces = soup(seed)
    points = (1.0 + far) * points + far
    some = np.random.default_rng(seed).permutation(len(faces))[:40]
    quick, slow = twin(lambda: self_intersections(points, faces))
    assert len(quick) > 10
    assert_array_equal(quick, slow)
    quick, slow = twin(lambda: np.unique(intersections_of(points, faces, some), axis=0))
    assert len(quick) > 1
    assert_array_equal(quick, slow)


def test_energies_of_cells_agree(twin, monkeypatch, rng):
    monkeypatch.setattr("vtk_segdeform.finish.cell_energy._PIECE", 500)
    mesh = models.cactus(1500)  # its vertices have different degrees
    energy = CellEnergy.of(mesh, 100.0)  # two rounds
    x = mesh.vertices + 0.05 * rng.normal(size=mesh.vertices.shape)
    (quick, steep), (slow, steeper) = twin(lambda: energy.value_and_slope(x))
    assert quick == pytest.approx(slow, rel=1e-12)
    assert_allclose(steep, steeper, atol=1e-12)


@pytest.mark.parametrize("spread", [0.0, 3.0])
@pytest.mark.parametrize("n", [0, 1, 700])
def test_sparse_factors_solve_their_matrix(twin, monkeypatch, n, spread, rng):
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED", 0)
    links = sparse.random_array((n, n), density=0.01, rng=np.random.default_rng(0))
    ring = links + links.T
    scale = sparse.diags_array(10.0 ** rng.uniform(-spread, spread, size=n))
    matrix = (scale @ (sparse.diags_array(ring.sum(axis=1) + 1e-3) - ring) @ scale).tocsr()
    right = scale @ rng.normal(size=(n, 3))
    quick, slow = twin(lambda: scale @ factored(matrix)(right))
    assert_allclose(quick, slow, rtol=1e-9, atol=1e-9)
    assert_allclose(quick, scale @ np.linalg.solve(matrix.toarray(), right), rtol=1e-9, atol=1e-9)


def finned() -> Mesh:
    """Return a ball with a fin, an edge with three faces, and with two tips of equal position."""
    points, faces = icosphere(3)
    edge = faces[0, :2]
    tips = 1.5 * points[[edge[0], edge[0]]]
    fin = [[*edge, len(points)], [edge[1], edge[0], len(points) + 1]]
    return Mesh(np.vstack([points, tips]), np.vstack([faces, fin]))


OPEN = {
    "holes": lambda: Surface(bottle(5, 3)).mesh,
    "sheet": lambda: Surface(sheet(20)).mesh,
    "one triangle": lambda: Mesh(np.eye(3), [[0, 1, 2]]),
    "finned": finned,
    "one-sided": lambda: Surface(moebius()).mesh,
}


@pytest.mark.parametrize("name", OPEN)
def test_on_open_meshes_volumes_and_normals_agree(twin, name, monkeypatch):
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED", 0)
    mesh = OPEN[name]()
    rng = np.random.default_rng(3)
    x = mesh.vertices + 0.01 * rng.normal(size=mesh.vertices.shape)
    quick, plain = twin(lambda: VertexNormals(mesh).of(x))
    assert_allclose(quick, plain, atol=1e-6)
    lids = lids_of(mesh, True)
    for points, faces in ((x, mesh.faces), (lids.extension @ x, lids.closed(mesh))):
        calls = [
            partial(signed_volume, points, faces),
            partial(volume_along, points, rng.normal(size=points.shape), faces.astype(np.int32)),
            partial(volume_gradient, points, faces),
        ]
        centroid = CentroidConstraint(faces, 0.0, axis=(0.1, 0.5, -0.3))
        if abs(signed_volume(points, faces)) > 0.1:
            calls += [partial(centroid.value, points + 5.0), partial(centroid.slope, points + 5.0)]
        for call in calls:
            quick, plain = twin(call)
            assert_allclose(quick, plain, rtol=1e-10, atol=1e-10)


def test_motions_along_directions_of_several_volumes_agree(twin, monkeypatch, rng):
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED", 0)
    mesh = Surface(bottle(5, 3)).mesh
    labels = np.digitize(mesh.vertices[:, 2], np.quantile(mesh.vertices[:, 2], [0.3, 0.6]))
    constraints = region_volumes(mesh, labels)
    assert len(constraints) == 3
    paths = np.hstack([mesh.vertices, rng.normal(size=(mesh.n_vertices, 9))])
    x = mesh.vertices + 0.01 * rng.normal(size=mesh.vertices.shape)
    area = area_of(mesh.vertices, mesh.faces)
    centroid = centroid_of(constraints[0], mesh.vertices, 1, diagonal=mesh.diagonal)
    for some in (constraints, (area, centroid, *constraints), (area,)):
        for call in (
            lambda some=some: values_along(some, np.hstack([x, paths[:, 3:]]))[0],
            lambda some=some: values_along(some, np.hstack([x, paths[:, 3:]]))[1],
            partial(moved_along, paths, np.array([0.3, -2.0, 0.7])),
        ):
            quick, plain = twin(call)
            assert_allclose(quick, plain, rtol=1e-11, atol=1e-12)
        here, slopes = values_along(some, np.hstack([x, paths[:, 3:]]))
        assert_allclose(here, violations(some, x), atol=1e-13)
        steps = 1e-5 * np.eye(3)
        there, back = (
            [violations(some, x - paths[:, :3] + moved_along(paths, t)) for t in sign * steps]
            for sign in (1.0, -1.0)
        )
        differences = (np.transpose(there) - np.transpose(back)) / 2e-5
        assert_allclose(slopes, differences, rtol=1e-5, atol=1e-5)
    quick, plain = twin(partial(area_gradient, x, mesh.faces))
    assert_allclose(quick, plain, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("name", OPEN)
def test_on_open_meshes_no_kernel_leaves_its_arrays(name):
    """Python raises an error where compiled code would write beyond an array."""
    kernels = pytest.importorskip("vtk_segdeform.kernels.compiled.normals")
    mesh = OPEN[name]()
    faces, n = mesh.faces, mesh.n_vertices
    starts = np.concatenate([[0], np.cumsum(np.bincount(faces.ravel()))])
    guarded = np.full(faces.size, -7, dtype=np.int32)
    kernels.rings.py_func(guarded, faces, starts)
    assert 0 <= guarded.min() <= guarded.max() < n
    ring = np.full(faces.size + 64, -7, dtype=np.int32)
    kernels.rings(ring[: faces.size], *dispatch.inputs(faces, starts))
    assert_array_equal(ring[: faces.size], guarded)
    assert (ring[faces.size :] == -7).all()


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
def test_rotations_are_rotations_and_equally_close(twin, kind):
    s = SHAPES[kind]
    quick, plain = twin(lambda: closest_rotations(s))
    assert_allclose(quick @ np.swapaxes(quick, 1, 2), np.tile(np.eye(3), (300, 1, 1)), atol=1e-13)
    assert_allclose(np.linalg.det(quick), 1.0, atol=1e-13)
    # Several rotations may be equally close, so compare how close they are.
    reached, best = (np.einsum("gij,gji->g", r, s) for r in (quick, plain))
    assert_allclose(reached, best, rtol=0.0, atol=1e-13 * np.abs(s).max())
    if kind in ("any", "almost at rest", "flat"):
        assert_allclose(quick, plain, atol=1e-11)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("columns", [3, 6, 9])
def test_products_agree_and_accumulate_in_double_precision(twin, dtype, columns, rng):
    rows = np.sort(rng.permutation(6000)[:4000])
    block, p = rng.normal(size=(4000, 37)).astype(dtype), rng.normal(size=(37, columns))
    y = rng.normal(size=(6000, 3))

    def product():
        x = np.ones((6000, columns))
        _add_product(x, *dispatch.inputs(rows, block), p, compiled=True)
        return x

    quick, plain = twin(product)
    exact = np.ones((6000, columns))
    exact[rows] += block.astype(np.float64) @ p
    assert_allclose(plain, exact, atol=1e-12)
    assert_allclose(quick, exact, atol=1e-12)
    subspace = Subspace(6000, (rows,), (block,))
    vars(subspace)["_is_compiled"] = True
    quick, plain = twin(lambda: subspace.adjoint(y))
    assert_allclose(quick, plain, atol=1e-10)
    assert_allclose(plain, block.astype(np.float64).T @ y[rows], atol=1e-10)


@pytest.mark.parametrize(("coupled", "n"), [(True, 3 * 60), (False, 180)])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_triangular_solves_agree(twin, coupled, n, count, rng):
    spread = rng.normal(size=(n, n))
    hessian = spread @ spread.T + np.eye(n)
    factor = Factor(np.linalg.cholesky(hessian), coupled)
    ys = [rng.normal(size=(n // 3 if coupled else n, 3)) for _ in range(count)]
    exact = np.linalg.inv(hessian)
    for quick, plain, y in zip(*twin(lambda: factor.solve_all(ys)), ys, strict=True):
        solved = (exact @ y.T.ravel()).reshape(3, -1).T if coupled else exact @ y
        assert quick.shape == plain.shape == y.shape
        assert_allclose(plain, solved, atol=1e-9 * np.abs(solved).max())
        assert_allclose(quick, solved, atol=1e-9 * np.abs(solved).max())


def test_every_row_is_processed_once_and_in_other_threads_than_the_callers(monkeypatch):
    monkeypatch.setattr(threads, "n_threads", lambda: 2)
    done, workers = np.zeros(1000, dtype=int), set()

    def work(start, stop):
        done[start:stop] += 1
        workers.add(threading.current_thread())

    threads.in_parallel(work, 1000, 7)
    assert (done == 1).all()
    assert threading.current_thread() not in workers


def test_nothing_runs_after_cancellation(monkeypatch):
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


def test_an_exception_in_a_task_reaches_the_caller(monkeypatch):
    monkeypatch.setattr(threads, "n_threads", lambda: 2)

    def work(start, stop):
        if start == 50:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        threads.in_parallel(work, 100, 10)


def test_mean_value_coordinates_agree_at_any_point(twin, rng):
    cage = models.sphere(162)
    p, corners = cage.vertices, cage.vertices[cage.faces]
    share = rng.dirichlet(np.ones(3), len(corners))[:, :, None]
    on_faces, on_edges = (share * corners).sum(axis=1), corners[:, :2].mean(axis=1)
    in_planes = 2.0 * corners[:, 0] - corners[:, 1]
    places = [p, on_faces, on_edges, in_planes, on_faces * (1.0 - 1e-9), rng.normal(size=(2000, 3))]
    points = np.concatenate(places)
    quick, plain = twin(lambda: mean_value_coordinates(points, p, cage.faces))
    assert_allclose(quick, plain, atol=1e-11)
    assert_allclose(quick @ p, points, atol=1e-11)


def test_kernels_are_compiled_once_for_copies_read_only_arrays_and_literals(rng):
    pytest.importorskip("numba")
    from vtk_segdeform.kernels.compiled import add_adjoint, solve_factored

    rows = np.arange(2500), np.arange(1500, 4000)
    subspace = Subspace(4000, rows, tuple(rng.random((2, 2500, 40))))
    p, y = rng.normal(size=(80, 3)), rng.normal(size=(4000, 3))
    for one in (subspace, copy.deepcopy(subspace)):
        one.map(p)
        one.map(*dispatch.inputs(p, y))
        for each in (y, *dispatch.inputs(y)):
            one.adjoint(each)
    for coupled in (True, False):
        Factor(np.eye(180), coupled).solve(np.ones((60 if coupled else 180, 3)))
    closest_rotations(SHAPES["any"])
    for kernel in (add_adjoint, solve_factored):
        # One for each precision; none if in the cache with its caller.
        kinds = {
            tuple(getattr(each, "dtype", each) for each in types) for types in kernel.signatures
        }
        assert len(kernel.signatures) == len(kinds), kernel


@pytest.mark.parametrize("regions", [1, 5, 70])
def test_the_cages_of_each_vertex_are_found_for_any_number_of_regions(regions, rng):
    n = 400
    rows = [np.sort(rng.permutation(n)[: rng.integers(0, 30)]) for _ in range(regions)]
    rows[0] = np.arange(n)
    subspace = Subspace(n, tuple(rows), tuple(rng.normal(size=(len(own), 2)) for own in rows))
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
    some = np.sort(rng.permutation(n)[:50])
    columns, w = subspace.nonzeros(some)
    assert_array_equal(columns, np.flatnonzero(np.repeat(membership[:, some].any(axis=1), 2)))
    assert_array_equal(w, dense[np.ix_(some, columns)])


def test_kernels_are_compiled_without_a_cache_folder(monkeypatch):
    caching = pytest.importorskip("numba.core.caching")
    kernels = importlib.import_module("vtk_segdeform.kernels.compiled.kernels")
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    twice = kernels.kernel()()(lambda x: x + x)
    assert twice(1.5) == 3.0
    assert twice.signatures


def test_set_up_runs_a_trial_step_so_that_the_first_frame_compiles_nothing(monkeypatch):
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


@pytest.mark.parametrize(("n", "length"), [(4, 1.0), (20, 1.0), (150, 30.0)])
def test_surfaces_are_simplified_to_the_bit(twin, monkeypatch, n, length):
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED_CHECKS", 0)
    ball, ball_faces = icosphere(2)
    vertices, faces = together(torus(24, 12), (ball + [4.0, 0.0, 0.0], ball_faces))
    vertices = vertices * [1.0, 1.0, length]
    vertices += 0.05 * np.random.default_rng(3).normal(size=vertices.shape)
    quick, slow = twin(lambda: simplify(vertices, faces, n))
    for one, other in zip(quick, slow, strict=True):
        assert_array_equal(one, other)
    assert len(quick[0]) == n if n > 20 else 8 < len(quick[0]) < 40


def test_collapses_to_needles_are_refused_alike(twin, monkeypatch):
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED_CHECKS", 0)
    vertices, faces = icosphere(3)
    surface = _accumulated(vertices, faces)
    edges, cost = _costs(surface, _NO_EDGES, np.ones(len(vertices), dtype=bool))
    chosen = edges.taken(_independent(edges, cost, len(vertices)))
    last = dict(zip(faces.ravel().tolist(), np.arange(faces.size), strict=True))
    face, corner = np.divmod([last[v] for v in chosen.i.tolist()], 3)
    p, q = (vertices[faces[face, (corner + k) % 3]] for k in (1, 2))
    height = np.geomspace(1e-4, 1.0, len(face))[:, None]  # over the opposite edge of a face
    to = chosen._replace(place=0.5 * (p + q) + height * (vertices[chosen.i] - 0.5 * (p + q)))
    quick, slow = twin(lambda: _valid(surface, to))
    assert_array_equal(quick, slow)
    assert 0 < quick.sum() < len(quick)


def test_nearest_points_of_triangles_agree_and_none_is_nearer(twin, rng, monkeypatch):
    monkeypatch.setattr("vtk_segdeform.sizes.COMPILED", 0)
    corners, points = rng.normal(size=(300, 3, 3)), 2.0 * rng.normal(size=(300, 3))
    corners[:20, 2] = 0.5 * (corners[:20, 0] + corners[:20, 1])  # a line
    corners[20:25] = corners[20:25, :1]  # a point
    points[30:60] = corners[30:60].mean(axis=1)
    (quick, away), (plain, expected) = twin(lambda: nearest_on_triangles(corners, points))
    assert_allclose(away, expected, atol=1e-12)
    assert_allclose(quick.sum(axis=1), 1.0)
    at, other = (np.einsum("kc,kcj->kj", shares, corners) for shares in (quick, plain))
    assert_allclose(at, other, atol=1e-9)
    assert_allclose(np.linalg.norm(at - points, axis=1), away, atol=1e-9)
    others = np.einsum("skc,kcj->skj", rng.dirichlet(np.ones(3), (400, 300)), corners)
    assert (np.linalg.norm(others - points, axis=2).min(axis=0) >= away - 1e-12).all()
