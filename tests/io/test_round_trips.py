"""Round trips of any surface, any arrays and any names, in every format.

Surfaces with random arrays are written and read by this package.  Points and polygons are the same;
each array is the same, under its name or the new name given in a warning, or a warning says that it
is left out.
"""

from __future__ import annotations

import ast
import logging
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from solids import CUBE, TETRAHEDRON
from vtkmodules.util.numpy_support import vtk_to_numpy

from vtk_segdeform.io.array_names import get_names, set_names
from vtk_segdeform.io.convert import read_polydata, write_mesh
from vtk_segdeform.io.polygons import corner_values, polydata_of, polygons_of
from vtk_segdeform.io.surface import Surface

TYPES = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "?"]
SPECIAL = [
    "x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "alpha", "s", "t", "u", "v",
    "texture_u", "texture_v", "vertex_indices", "vertex_index", "texcoord", "#", "#0", "end_header",
    "comment", "element", "property", "list", "RGB", "RGBA", "TextureCoordinates",
    "TextureCorners", "Group", "Object", "Material", "Smoothing", "Normals", "a b", "a\nb", "a_b",
    "x_1", "\n", " ", "Größe", "身体", "<&\">'", "a" * 300, "a" * 299 + "b", "end\\",
    "{", "}", "{}", "%s%n",
]  # fmt: skip
NAMES = st.sampled_from(SPECIAL) | st.text(
    st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=8
)
LOST = re.compile(r"cannot store (.*): left out$", re.DOTALL)
RENAMED = re.compile(
    r"(point array|cell array|group|object|material) (.*) is written as (.*)$", re.S
)


def prism(n):
    """Return two n-gons with quadrangles between them."""
    angle = np.arange(n) * (2 * np.pi / n)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    k, after = np.arange(n), (np.arange(n) + 1) % n
    sides = np.stack([k, after, after + n, k + n], axis=-1).ravel()
    corners = np.concatenate([k[::-1], k + n, sides])
    return polydata_of(np.vstack([ring, ring + [0, 0, 1]]), np.array([n, n] + [4] * n), corners)


def triangles(vertices, faces):
    return polydata_of(vertices / 3, np.full(len(faces), 3), faces.ravel())


SHAPES = {
    "tetrahedron": lambda: triangles(*TETRAHEDRON),
    "cube": lambda: triangles(*CUBE),
    "quads": lambda: prism(4),
    "polygons": lambda: prism(7),
    "wide": lambda: prism(300),
    "half wide": lambda: prism(130),  # 260 texture coordinates of a face
}


@st.composite
def surfaces(draw):
    """Return a closed surface with up to six arrays of any name, type and shape."""
    surface = SHAPES[draw(st.sampled_from(sorted(SHAPES)))]()
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    for _ in range(draw(st.integers(0, 6))):
        of_points, name = draw(st.booleans()), draw(NAMES)
        attributes = surface.point_data if of_points else surface.cell_data
        most = 2 * int(polygons_of(surface)[0].max())
        wide = draw(st.sampled_from([(), (), (), (2,), (3,), (4,), (6,), (most,), (most + 2,)]))
        kind = np.dtype(draw(st.sampled_from(TYPES)))
        shape = (surface.n_points if of_points else surface.n_cells, *wide)
        span = draw(st.sampled_from([2, 100, 2**31, 2**52, 2**62]))
        values = rng.integers(0, span, shape, dtype=np.int64)
        attributes[name] = (values / 7 if kind.kind == "f" else values).astype(kind)
    if draw(st.booleans()) and not of_textures(surface):
        surface.point_data["uv"] = rng.random((surface.n_points, 2))
        surface.point_data.active_texture_coordinates_name = "uv"
    for key in draw(st.sets(st.sampled_from(["Object", "Group", "Material"]))):
        names = draw(st.lists(NAMES, min_size=1, max_size=4))
        set_names(surface, f"{key}Names", names)
        surface.cell_data[key] = rng.integers(
            0, len(names) + draw(st.integers(0, 1)), surface.n_cells
        )
    return surface


def of_textures(surface):
    return surface.active_texture_coordinates is not None


class Warnings(logging.Handler):
    """Collects the warnings of the package while it writes."""

    def __init__(self, path, surface):
        super().__init__(logging.WARNING)
        self.texts = []
        logger = logging.getLogger("vtk_segdeform")
        logger.addHandler(self)
        try:
            write_mesh(path, surface)
        finally:
            logger.removeHandler(self)

    def emit(self, record):
        self.texts.append(record.getMessage())

    def left_out(self, sort, name):
        lost = [found[1] for text in self.texts if (found := LOST.search(text))]
        return any(f"{sort} array {name!r}" in each for each in lost)

    def written(self, what, name):
        """Return the name that *name* was written as."""
        found = [match for text in self.texts if (match := RENAMED.match(text))]
        names = {match[2]: match[3] for match in found if match[1] == what}
        return ast.literal_eval(names.get(repr(name), repr(name)))


def lost_in(path, surface):
    """Write, read, and return a description of everything that is neither the same nor reported."""
    warnings = Warnings(path, surface)
    again = read_polydata(path)
    assert_array_equal(again.points, surface.points)
    assert_array_equal(again.faces, surface.faces)
    texture = surface.point_data.active_texture_coordinates_name
    wrong = []
    for sort in ("point", "cell"):
        mine, theirs = getattr(surface, f"{sort}_data"), getattr(again, f"{sort}_data")
        for name in list(mine):
            values = np.asarray(mine[name])
            if warnings.left_out(sort, name):
                continue
            other = theirs.get(warnings.written(f"{sort} array", name))
            if sort == "point" and name == texture and other is None:
                other = again.active_texture_coordinates
                if other is None:  # per vertex or per corner, both are valid
                    continue
                values = values[:, :2]
            if other is None or not equal(
                path, surface, again, name, values, np.asarray(other), warnings
            ):
                wrong.append(f"{sort} {name!r} {values.dtype}{values.shape}: {warnings.texts}")
    return wrong


def equal(path, surface, again, name, values, other, warnings):
    """Return whether an array was read back: groups by name, corners where there are any."""
    counts = polygons_of(surface)[0]
    if name == "TextureCorners" and path.suffix in (".ply", ".obj"):
        mine, theirs = corner_values(values, counts), corner_values(other, counts)
        kind = "f4" if path.suffix == ".ply" else "f8"
        if mine is not None:
            return theirs is not None and np.array_equal(mine.astype(kind), theirs.astype(kind))
    if name in ("Object", "Group", "Material") and path.suffix == ".obj":
        names, others = get_names(surface, f"{name}Names"), get_names(again, f"{name}Names")
        mine = [warnings.written(name.lower(), names[int(k)]) for k in values]
        return mine == [others[k] for k in other]
    return np.array_equal(values, other)


EASY = settings(
    deadline=None, derandomize=True, max_examples=25,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)  # fmt: skip


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off"])
@EASY
@given(surface=surfaces())
def test_a_surface_with_any_arrays_is_read_back_or_losses_are_reported(tmp_path, suffix, surface):
    assert not lost_in(tmp_path / f"a{suffix}", surface)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off", ".vtk", ".vtp", ".vtu"])
def test_every_special_name_is_read_back_or_losses_are_reported(tmp_path, suffix):
    surface = prism(4)
    for k, name in enumerate(SPECIAL):
        surface.point_data[name] = np.arange(8.0) + k
        surface.cell_data[name] = np.arange(6) + k
    assert not lost_in(tmp_path / f"a{suffix}", surface)


@pytest.mark.parametrize("suffix", [".ply", ".obj"])
def test_cell_arrays_follow_their_cells_beside_points_lines_and_strips(tmp_path, suffix):
    strips = triangles(*CUBE).strip()
    mixed = prism(4)
    mixed.verts, mixed.lines, mixed.strips = [1, 0, 1, 1], [2, 0, 1], strips.strips
    mixed.cell_data["Group"] = np.arange(mixed.n_cells)
    set_names(mixed, "GroupNames", map(str, range(mixed.n_cells)))
    warnings = Warnings(tmp_path / f"a{suffix}", mixed)
    lost = any("2 vertex cells, 1 line cell: left out" in text for text in warnings.texts)
    assert lost == (suffix == ".ply")
    again = read_polydata(tmp_path / f"a{suffix}")
    others = 0 if lost else 3
    assert again.n_cells == others + 6 + 12
    names = get_names(again, "GroupNames")
    group = [int(names[k]) if names else k for k in again.cell_data["Group"]]
    assert group[:others] == list(range(others))
    group = group[others:]
    assert group[:6] == list(range(3, 9))  # after points and lines
    lengths = np.diff(vtk_to_numpy(mixed.GetStrips().GetOffsetsArray())) - 2
    assert group[6:] == np.repeat(np.arange(9, 9 + len(lengths)), lengths).tolist()


@pytest.mark.parametrize("n_corners", [1, 2])
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off", ".vtp", ".vtk", ".vtu"])
def test_a_face_of_one_or_two_corners_is_kept_and_the_others_can_be_bent(
    tmp_path, suffix, n_corners
):
    counts, corners = polygons_of(prism(5))
    at = int(counts[:3].sum())
    given = polydata_of(
        prism(5).points, np.insert(counts, 3, n_corners), np.insert(corners, at, [4, 7][:n_corners])
    )
    rng = np.random.default_rng(2)
    given.point_data["Normals"] = rng.normal(size=(given.n_points, 3))
    if suffix.startswith(".v"):
        given.cell_data["Normals"] = rng.normal(size=(given.n_cells, 3))
    write_mesh(tmp_path / f"a{suffix}", given)
    surface = Surface.read(tmp_path / f"a{suffix}")
    assert surface.mesh.is_closed
    there = surface.mesh.vertices + 0.1
    surface.write(tmp_path / f"b{suffix}", there)
    again = Surface.read(tmp_path / f"b{suffix}")
    for one, two in zip(polygons_of(given), polygons_of(again.given), strict=True):
        assert_array_equal(one, two)
    assert_allclose(again.mesh.vertices, there, atol=1e-12)
    assert_allclose(again.given.point_data["Normals"], given.point_data["Normals"], atol=1e-6)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off", ".stl"])
@settings(EASY, max_examples=8)
@given(surface=surfaces())
def test_pymeshlab_reads_the_same_surface(tmp_path, suffix, surface):
    pymeshlab = pytest.importorskip("pymeshlab")
    counts, _ = polygons_of(surface)
    if suffix == ".ply" and counts.max() > 255:  # its own limit, with a warning
        return
    if suffix == ".stl":
        surface = surface.triangulate()
    write_mesh(tmp_path / f"a{suffix}", surface)
    meshset = pymeshlab.MeshSet(verbose=False)
    meshset.load_new_mesh(str(tmp_path / f"a{suffix}"))
    theirs = meshset.current_mesh()
    assert theirs.face_number() == (counts - 2).sum()
    if suffix == ".stl":
        np.testing.assert_allclose(theirs.vertex_matrix().max(axis=0), surface.points.max(axis=0))
        return
    np.testing.assert_allclose(theirs.vertex_matrix(), surface.points, atol=1e-6)


@pytest.mark.campaign
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off", ".vtk", ".vtp"])
def test_a_thousand_surfaces_are_read_back_or_losses_are_reported(tmp_path, suffix):
    @settings(EASY, max_examples=1000 if suffix in (".ply", ".obj", ".off") else 100)
    @given(surface=surfaces())
    def each(surface):
        assert not lost_in(tmp_path / f"a{suffix}", surface)

    each()
