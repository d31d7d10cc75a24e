"""Every fault of a mesh is found, counted once and named; sound meshes have none."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from solids import CUBE, SOLIDS, icosphere, rotation, together, two_components

from vtk_segdeform.errors import MeshError
from vtk_segdeform.mesh import faults as search
from vtk_segdeform.mesh import shells, topology, triangles
from vtk_segdeform.mesh.faults import connectivity_faults, find_faults
from vtk_segdeform.mesh.grouping import first_equal_row
from vtk_segdeform.mesh.report import Fault, Kind
from vtk_segdeform.mesh_repair.repair import repair

SPHERE = icosphere(2)
N = len(SPHERE[0])
HARMLESS = (Kind.ZERO_AREA, Kind.COINCIDENT, Kind.COMPONENTS)  # of any closed mesh too


def kinds(vertices, faces):
    """Return the faults of a mesh and the notes on its topology as {kind: count}."""
    report = find_faults(vertices, faces)
    assert all(fault.kind.fatal for fault in report.faults)
    assert not any(note.kind.fatal for note in report.notes)
    found = {fault.kind: fault.count for fault in report.faults + report.notes}
    assert len(found) == len(report.faults + report.notes)  # each kind once
    return {kind: n for kind, n in found.items() if kind not in HARMLESS}


def test_a_missing_face_leaves_three_open_edges_around_one_hole():
    vertices, faces = SPHERE
    report = find_faults(vertices, faces[1:])
    assert kinds(vertices, faces[1:]) == {Kind.OPEN_EDGE: 3, Kind.HOLE: 1}
    a, b, c = sorted(faces[0].tolist())
    assert sorted(report.notes[0].examples) == [(a, b), (a, c), (b, c)]


def test_borders_and_branches_are_allowed_and_turned_faces_are_not():
    vertices, faces = SPHERE
    fin = np.append(faces, [[faces[0, 0], faces[0, 1], 40]], axis=0)
    for allowed in (faces, faces[1:], fin, faces[:1]):
        used = np.unique(allowed)
        report = find_faults(vertices[used], np.searchsorted(used, allowed))
        assert report.ok
        assert report.is_closed == report.is_two_manifold == (allowed is faces)
    for wrong in (
        np.append(faces[1:], faces[:1, ::-1], axis=0),
        np.append(faces[2:], faces[:1, ::-1], axis=0),
        np.append(fin[1:], fin[:1, ::-1], axis=0),
    ):
        report = find_faults(vertices, wrong)
        assert not report.ok
        assert not report.is_closed
        assert not report.is_two_manifold


def test_an_inside_out_mesh_is_found_at_any_position_and_scale():
    vertices, faces = SPHERE
    for moved in (vertices, vertices + 1e8, 1e-6 * vertices, vertices @ rotation([1, 2, 3], 2.0).T):
        assert find_faults(moved, faces).ok
        assert kinds(moved, faces[:, ::-1]) == {Kind.INWARD: 1}
    assert kinds(vertices * [1.0, 1.0, -1.0], faces) == {Kind.INWARD: 1}  # a reflection


def test_a_flat_closed_mesh_encloses_no_volume():
    vertices, faces = CUBE
    turned = vertices * [1.0, 1.0, 0.0] @ rotation([1.0, 2.0, 3.0], 0.7).T
    assert kinds(turned, faces) == {Kind.NO_VOLUME: 1}


@pytest.mark.parametrize(("scale", "kind"), [(1e150, Kind.TOO_LARGE), (1e-150, Kind.TOO_SMALL)])
def test_a_mesh_too_large_or_too_small_to_compute_volumes_is_a_fault(scale, kind):
    vertices, faces = CUBE
    assert set(kinds(vertices * scale, faces)) == {kind}
    for allowed in (scale**0.46, 1.0 / scale**0.46):
        assert find_faults(vertices * allowed, faces).ok


@pytest.mark.parametrize("depth", [1, 2, 3])
def test_nested_shells_alternate_between_bodies_and_cavities(depth):
    vertices, faces = SPHERE
    shells = [(vertices * 0.5**k, faces[:, :: (-1) ** k]) for k in range(depth + 1)]
    assert find_faults(*together(*shells)).ok
    wrong = [*shells[:-1], (shells[-1][0], shells[-1][1][:, ::-1])]
    assert kinds(*together(*wrong)) == {Kind.INWARD: 1}


def test_overlapping_bodies_are_not_cavities():
    vertices, faces = icosphere(3)
    bump = vertices * 0.2 + 0.55  # within the box of the ball, half of it outside the ball
    assert (bump.max(axis=0) < vertices.max(axis=0)).all()
    assert find_faults(*together((vertices, faces), (bump, faces))).ok


def test_a_face_without_area_and_a_coincident_vertex_are_notes():
    vertices, faces = SPHERE
    flat = vertices.copy()
    flat[faces[0, 0]] = flat[faces[0, 1]]
    report = find_faults(flat, faces)
    assert report.ok
    assert report.count(Kind.COINCIDENT) == 1
    assert report.count(Kind.ZERO_AREA) == 2  # the two faces at that edge


def test_a_mesh_without_any_area_is_a_fault():
    vertices, faces = SPHERE
    on_a_line = vertices[:, :1] * [3.0, -4.0, 12.0] + 5.0
    for flat in (vertices * 0.0, on_a_line):
        report = find_faults(flat, faces)
        assert report.faults[0].kind is Kind.FLAT
        assert str(report.faults[0]) == "all faces are flat"
        with pytest.raises(MeshError, match=r"all faces are flat; .*not on a line"):
            repair(flat, faces)
    assert find_faults(vertices * [1.0, 1.0, 0.0], faces).ok
    flat[faces[7]] = np.eye(3)
    assert find_faults(flat, faces).count(Kind.FLAT) == 0


def test_nan_and_infinite_coordinates_are_found():
    vertices, faces = SPHERE
    broken = vertices.copy()
    broken[4, 1], broken[9] = np.nan, np.inf
    report = find_faults(broken, faces)
    assert kinds(broken, faces) == {Kind.NON_FINITE: 2}
    assert report.faults[0].examples == (4, 9)


@pytest.mark.parametrize(
    ("vertices", "faces", "expected"),
    [
        ([], [], {Kind.EMPTY: 1}),
        ([[0, 0, 0]], [], {Kind.EMPTY: 1, Kind.UNREFERENCED: 1}),
        ([], [[0, 1, 2]], {Kind.BAD_INDEX: 1}),
        (np.eye(3), [[0, 1, 2]], {Kind.OPEN_EDGE: 3, Kind.HOLE: 1}),
        (
            np.eye(3),
            [[0, 1, 2], [0, 2, 1]],
            {Kind.DUPLICATE_FACE: 1, Kind.OPEN_EDGE: 3, Kind.HOLE: 1},
        ),
        (np.eye(3), [[0, 0, 1]], {Kind.UNREFERENCED: 1, Kind.DEGENERATE: 1}),
        (np.zeros((3, 3)), [[0, 1, 2]], {Kind.FLAT: 1, Kind.OPEN_EDGE: 3, Kind.HOLE: 1}),
        (
            np.full((3, 3), np.nan),
            [[0, 1, 2]],
            {Kind.NON_FINITE: 3, Kind.OPEN_EDGE: 3, Kind.HOLE: 1},
        ),
    ],
)
def test_the_smallest_meshes_do_not_break_the_search(vertices, faces, expected):
    assert kinds(vertices, faces) == expected


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((4, 2)), [[0, 1, 2]], r"vertices must have shape \(n, 3\); got \(4, 2\)"),
        (np.zeros((4, 3)), [[0, 1, 2, 3]], r"faces must have shape \(m, 3\), triangles"),
        (np.zeros((4, 3)), [[0.0, 1.0, 2.0]], "faces must contain integers; got float64"),
        (np.array([["a", "b", "c"]]), [[0, 0, 0]], "vertices must contain numbers"),
    ],
)
def test_arrays_of_the_wrong_shape_or_type_are_an_error(vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        find_faults(vertices, faces)


def test_the_text_of_a_report_has_the_size_the_faults_and_advice():
    vertices, faces = SPHERE
    text = str(find_faults(np.append(vertices, [[9, 9, 9]], axis=0), faces[1:]))
    assert text.splitlines()[0] == "67 vertices, 127 faces, 1 component: has faults"
    assert "fault: 1 unreferenced vertex (vertex 66); `repair` removes" in text
    assert "note: 3 open edges (" in text
    assert str(find_faults(*CUBE)).endswith(": a closed, outward oriented two-manifold")


def test_faults_of_random_triangles_agree_with_plain_counting():
    rng = np.random.default_rng(11)
    for _ in range(50):
        faces = rng.integers(0, 8, (rng.integers(1, 14), 3))
        report = find_faults(rng.normal(size=(8, 3)), faces)
        sound = {tuple(sorted(f)): tuple(f) for f in faces[::-1].tolist() if len(set(f)) == 3}
        at = {}
        for a, b, c in sound.values():
            for i, j in ((a, b), (b, c), (c, a)):
                at.setdefault((min(i, j), max(i, j)), []).append((i, j))
        assert report.count(Kind.OPEN_EDGE) == sum(len(s) == 1 for s in at.values())
        assert report.count(Kind.NON_MANIFOLD_EDGE) == sum(len(s) > 2 for s in at.values())
        turned = sum(len(s) == 2 and s[0] == s[1] for s in at.values())
        assert report.count(Kind.TURNED_EDGE) == turned
        assert report.count(Kind.UNREFERENCED) == 8 - len(set(faces.ravel().tolist()))


def damaged(vertices, faces, rng):
    """Return a closed mesh with up to three random changes; many of them keep it closed."""
    vertices, faces = vertices.copy(), faces.copy()
    for _ in range(rng.integers(0, 4)):
        one, other = rng.choice(len(vertices), 2, replace=False)
        face = rng.integers(len(faces))
        match rng.integers(7):
            case 0:
                faces[faces == one] = other  # a pinch, if they are far apart
            case 1:
                faces = np.delete(faces, face, axis=0)
            case 2:
                faces = np.append(faces, faces[[face], ::-1], axis=0)
            case 3:
                faces[face] = faces[face, ::-1]
            case 4:
                vertices[one] = vertices[other]
            case 5:
                more = faces[face] + [[0], [0]]  # a separate pillow of two faces
                vertices, faces = (
                    np.append(vertices, vertices[more[0]] + 9.0, axis=0),
                    np.append(faces, len(vertices) + np.array([[0, 1, 2], [0, 2, 1]]), axis=0),
                )
            case 6:
                faces[face, 0] = other
    return vertices, faces


def groups(items, links):
    """Return the number of connected components of *items* under *links*, by union-find."""
    parent = {item: item for item in items}

    def root(item):
        while parent[item] != item:
            item = parent[item]
        return item

    for one, other in links:
        parent[root(one)] = root(other)
    return sum(parent[item] == item for item in items)


def test_faults_of_damaged_surfaces_agree_with_plain_counting():
    rng = np.random.default_rng(5)
    bodies = [*SOLIDS.values(), together(CUBE, (CUBE[0] + 1.0, CUBE[1])), two_components()]
    bodies = [body for body in bodies if len(body[1]) < 100]
    pinches = 0
    for _ in range(300):
        vertices, faces = damaged(*bodies[rng.integers(len(bodies))], rng)
        report = find_faults(vertices, faces)
        whole = [f for f in faces.tolist() if len(set(f)) == 3]
        once = {}
        for f in whole:
            once.setdefault(frozenset(f), f)
        assert report.count(Kind.DUPLICATE_FACE) == len(whole) - len(once)
        seen = {tuple(v) for v in vertices.tolist()}
        assert report.count(Kind.COINCIDENT) == len(vertices) - len(seen)
        at = {}
        for f in once:
            for v in f:
                at.setdefault(f - {v}, []).append(f)
        touching = [(fs[0], f) for fs in at.values() for f in fs[1:]]
        assert report.n_components == groups(once, touching)
        non_manifold = set().union(*(edge for edge, fs in at.items() if len(fs) > 2))
        pairs = [(edge, fs) for edge, fs in at.items() if len(fs) == 2]
        pinched = sum(
            groups([f for f in once if v in f], [fs for edge, fs in pairs if v in edge]) > 1
            for v in range(len(vertices))
            if v not in non_manifold
        )
        assert report.count(Kind.NON_MANIFOLD_VERTEX) == pinched
        pinches += pinched > 0 and not report.count(Kind.OPEN_EDGE)
    assert pinches > 20  # enough pinched closed surfaces among them


def test_faults_do_not_depend_on_the_size_of_tasks_or_the_number_of_rounds(monkeypatch):
    pinched = together(CUBE, (CUBE[0] + 1.0, CUBE[1]))
    flat = SPHERE[0].copy()
    flat[SPHERE[1][0, 0]] = flat[SPHERE[1][0, 1]]
    cavity = together(SPHERE, (0.5 * SPHERE[0], SPHERE[1][:, ::-1]))
    far = [(CUBE[0] + at, CUBE[1]) for at in (1e15, -1e15)]
    apart = together(SPHERE, *far)  # their volumes need an origin near each
    meshes = [SPHERE, pinched, (flat, SPHERE[1]), cavity, apart, (SPHERE[0], SPHERE[1][:, ::-1])]
    before = [find_faults(*mesh) for mesh in meshes]
    for module in (triangles, shells):
        monkeypatch.setattr(module, "_PIECE", 7)
    monkeypatch.setattr(topology, "_ROUNDS", 4)  # more faces meet at most vertices
    assert [find_faults(*mesh) for mesh in meshes] == before


def test_rows_are_equal_by_value_not_by_bits():
    rows = np.array([[0.0, 1.0], [-0.0, 1.0], [np.nan, 1.0], [np.nan, 1.0], [1.0, 0.0], [0.0, 1.0]])
    assert first_equal_row(rows).tolist() == [0, 0, 2, 3, 4, 0]
    assert first_equal_row(rows.astype(np.float32)).tolist() == [0, 0, 2, 3, 4, 0]
    assert first_equal_row(rows[:0]).tolist() == []
    rng = np.random.default_rng(3)
    for dtype in (np.int64, np.float64):
        many = rng.integers(-4, 4, (400, 3)).astype(dtype)
        seen = {}
        assert first_equal_row(many).tolist() == [
            seen.setdefault(tuple(row), i) for i, row in enumerate(many.tolist())
        ]


def test_the_connectivity_of_a_cage_has_the_faults_of_its_faces():
    vertices, faces = CUBE
    n = len(vertices)
    assert connectivity_faults(n, faces) == []
    assert connectivity_faults(3, faces[:3]) == ["a closed surface needs at least 4 faces; got 3"]
    repeating = faces.copy()
    repeating[:2, 2] = repeating[:2, 0]
    assert connectivity_faults(n, repeating) == ["2 faces repeat a vertex"]
    for a, b in ((0, 1), (1, 2), (2, 0)):
        once = faces.copy()
        once[4, a] = once[4, b]
        assert connectivity_faults(n, once) == ["1 face repeats a vertex"]
    assert connectivity_faults(n, faces[1:]) == ["3 edges border only one face: the cage is open"]
    turned = np.vstack([faces[:1, ::-1], faces[1:]])
    assert connectivity_faults(n, turned) == ["3 edges have faces of opposite orientation"]
    assert connectivity_faults(n + 2, faces) == ["2 vertices are in no face"]
    assert connectivity_faults(n + 1, faces[1:]) == [
        "3 edges border only one face: the cage is open",
        "1 vertex is in no face",
    ]
    fin = np.vstack([faces, [[0, 1, n]]])
    assert connectivity_faults(n + 1, fin) == [
        "2 edges border only one face: the cage is open",
        "1 edge borders three or more faces",
    ]
    vertices, corner = together(CUBE, (CUBE[0] + 1.0, CUBE[1]))
    assert connectivity_faults(len(vertices), corner) == [
        "1 vertex joins several surfaces at one point"
    ]


def test_points_far_from_most_others_are_a_fault_if_they_are_in_a_face():
    vertices, faces = icosphere(2)
    n = len(vertices)
    for axis, sign in itertools.product(range(3), (1.0, -1.0)):
        far = vertices.copy()
        far[5, axis] = sign * 1e20
        loose = np.vstack([vertices, far[5:6]])
        report = find_faults(far, faces)
        assert [(each.kind, each.examples) for each in report.faults if each.count == 1][:1] == [
            (Kind.OUTLYING, (5,))
        ]
        assert find_faults(loose, faces).count(Kind.OUTLYING) == 0
        assert find_faults(loose, faces).count(Kind.UNREFERENCED) == 1
    assert find_faults(vertices + 1e6, faces).count(Kind.OUTLYING) == 0
    assert find_faults(np.where(np.arange(n)[:, None] == 5, 3.0, vertices), faces).ok


def test_used_points_and_repeating_faces_are_counted_unless_an_index_is_out_of_range():
    vertices, faces = CUBE
    found = search.Search(np.vstack([vertices, [[9.0, 9, 9]]]), faces)
    assert found.n_repeating == 0
    assert found.used.tolist() == [True] * 8 + [False]
    assert found.extent == 1.0
    assert search.Search(vertices, np.vstack([faces, [[1, 1, 2], [3, 3, 3]]])).n_repeating == 2
    for wrong in ([0, 1, 8], [-1, 2, 3]):
        found = search.Search(vertices, np.vstack([faces[:1], [wrong]]))
        assert found.n_repeating is None
        assert found.used.tolist() == [True] * 3 + [False] * 5
        assert found.n_components == 0


def test_the_text_of_a_fault_counts_it_and_shows_a_few_places():
    edge, face = Kind.OPEN_EDGE, Kind.ZERO_AREA
    assert str(Fault(edge, 1, ((3, 7),))) == "1 open edge (3-7)"
    assert str(Fault(edge, 2, ((3, 7), (4, 5)))) == "2 open edges (3-7, 4-5)"
    assert str(Fault(face, 3, (3, 7))) == "3 faces without area (face 3, 7, ...)"
    assert str(Fault(Kind.COMPONENTS, 2)) == "2 components"
    assert str(Fault(Kind.EMPTY, 1)) == "empty mesh"
    report = find_faults(*SPHERE)
    assert report.count(edge) == 0
    size = f"{N} vertices, {len(SPHERE[1])} faces, 1 component"
    assert str(report) == f"{size}: a closed, outward oriented two-manifold"
    assert "; " in str(find_faults(SPHERE[0], SPHERE[1][1:]))
    open_text = str(find_faults(SPHERE[0], SPHERE[1][1:])).splitlines()
    assert open_text[0].endswith("1 component: can be deformed")
    assert all(line.startswith("  note: ") for line in open_text[1:])
    turned = np.vstack([SPHERE[1][:1, ::-1], SPHERE[1][1:]])
    assert "has faults\n  fault: 3 inconsistently oriented edges" in str(
        find_faults(SPHERE[0], turned)
    )
