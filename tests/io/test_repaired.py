"""Polygons and arrays that a repaired surface keeps, and the report of losses."""

from __future__ import annotations

import logging

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal

import vtk_segdeform.widgets.plugin  # noqa: F401  registers mesh.segdeform
from vtk_segdeform.cli.main import main
from vtk_segdeform.errors import Cancelled
from vtk_segdeform.io import convert
from vtk_segdeform.io.polygons import cut_into_triangles, polydata_of, polygons_of
from vtk_segdeform.io.repaired import repair_surface

N = 4


def box(drop=(), turn=()):
    """Return a cube of N by N quads per side, with some removed and others flipped."""
    grid = pv.ImageData(dimensions=(N + 1,) * 3).extract_surface(algorithm=None)
    grid = grid.clean()
    quads = polygons_of(grid)[1].reshape(-1, 4)
    quads[list(turn)] = quads[list(turn)][:, ::-1]
    quads = np.delete(quads, list(drop), axis=0)
    points = np.asarray(grid.points, dtype=float)
    surface = polydata_of(points, np.full(len(quads), 4), quads.ravel())
    surface.point_data["place"] = points
    surface.point_data["number"] = np.arange(len(points))
    surface.point_data["RGB"] = np.tile(np.uint8([250, 100, 0]), (len(points), 1))
    surface.point_data["TextureCoordinates"] = points[:, :2] / N
    surface.point_data.active_texture_coordinates_name = "TextureCoordinates"
    surface.cell_data["material"] = np.arange(1, len(quads) + 1)
    surface.cell_data["TextureCorners"] = points[quads][:, :, :2].reshape(-1, 8) / N
    surface.field_data["names"] = ["iron", "wood"]
    return surface


def same_corners(old, new):
    """Check that every new polygon has corners, and corner values, of the cell it came from."""
    n_new = 0
    (old_counts, old_corners), (counts, corners) = polygons_of(old), polygons_of(new)
    starts, old_starts = np.cumsum(counts) - counts, np.cumsum(old_counts) - old_counts
    values, old_values = (
        x.cell_data["TextureCorners"].reshape(x.n_cells, -1, 2) for x in (new, old)
    )
    for i, material in enumerate(new.cell_data["material"]):
        if not material:
            n_new += 1
            assert np.isnan(values[i]).all()
            continue
        its = slice(old_starts[material - 1], old_starts[material - 1] + old_counts[material - 1])
        there = {
            tuple(p): tuple(u)
            for p, u in zip(old.points[old_corners[its]], old_values[material - 1], strict=False)
        }
        mine = corners[starts[i] : starts[i] + counts[i]]
        for k, p in enumerate(new.points[mine]):
            assert there[tuple(p)] == tuple(values[i, k])
    return n_new


def test_a_surface_without_faults_is_unchanged():
    surface = box()
    same, done = repair_surface(surface)
    assert done.steps == ()
    assert_array_equal(polygons_of(same)[1], polygons_of(surface)[1])
    assert same.array_names == surface.array_names


def test_each_stage_is_reported_and_can_be_cancelled():
    damaged = box(drop=[5, 6, 9, 10, 40], turn=[7])
    told = []
    repair_surface(damaged, progress=lambda *what: told.append(what))
    fractions, messages = zip(*told, strict=True)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert (np.diff(fractions) >= 0.0).all()
    assert {"Filling 1 hole of 4 edges", "Filling 1 hole of 8 edges"} <= set(messages)
    for last in dict.fromkeys(messages):

        def stop(_, message, last=last):
            if message == last:
                raise Cancelled(last)

        with pytest.raises(Cancelled, match=last):
            repair_surface(damaged, progress=stop)
    told.clear()
    repair_surface(box(), progress=lambda *what: told.append(what))
    assert [fraction for fraction, _ in told][-1] == 1.0
    assert not any("Filling" in message for _, message in told)


def test_polygons_and_arrays_of_kept_faces_are_kept():
    surface = box(drop=[5, 6, 9, 10, 40])
    closed, done = repair_surface(surface)
    assert done.report.is_closed
    kept = surface.n_cells
    counts, corners = polygons_of(closed)
    assert (counts[:kept] == 4).all()
    assert (counts[kept:] == 3).all()
    assert_array_equal(done.vertex_map[corners[: 4 * kept]], polygons_of(surface)[1])
    there = np.flatnonzero(done.vertex_map >= 0)
    was = done.vertex_map[there]
    assert len(there) == surface.n_points - 1  # the corner of four missing quads
    for name in ("number", "RGB", "TextureCoordinates"):
        assert_array_equal(closed.point_data[name][there], surface.point_data[name][was])
        assert closed.point_data[name].dtype == surface.point_data[name].dtype
    assert_array_equal(closed.cell_data["material"][:kept], surface.cell_data["material"])
    assert closed.point_data.active_texture_coordinates_name == "TextureCoordinates"
    assert list(closed.field_data["names"]) == ["iron", "wood"]
    assert same_corners(surface, closed) == closed.n_cells - kept > 0


def test_new_vertices_interpolate_values_and_the_report_says_so():
    n = 40
    turn = 2.0 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    i = np.arange(n)
    walls = np.stack([i, i + n, (i + 1) % n + n, (i + 1) % n], axis=1)
    surface = polydata_of(np.concatenate([ring, ring - [0, 0, 1]]), np.full(n, 4), walls.ravel())
    surface.point_data["height"] = surface.points[:, 2] * 1.0
    surface.point_data["label"] = np.repeat([7, 9], n)
    surface.point_data["RGB"] = np.repeat(np.uint8([[200, 0, 0], [0, 0, 60]]), n, axis=0)
    surface.point_data["Normals"] = np.concatenate([ring, ring])
    surface.point_data.active_normals_name = "Normals"
    surface.cell_data["Normals"] = np.asarray(surface.face_normals, dtype=float)
    closed, done = repair_surface(surface)
    new = np.flatnonzero(done.vertex_map < 0)
    assert len(new) > 5
    top = closed.points[new, 2] > -0.5
    assert_allclose(closed.point_data["height"][new], np.where(top, 0.0, -1.0), atol=1e-12)
    assert_array_equal(closed.point_data["label"][new], np.where(top, 7, 9))
    assert_array_equal(closed.point_data["RGB"][new][top], [[200, 0, 0]] * top.sum())
    assert_allclose(np.linalg.norm(closed.point_data["Normals"], axis=1), 1.0)
    lids = closed.cell_data["Normals"][n:]
    assert_allclose(np.abs(lids), np.tile([0.0, 0.0, 1.0], (len(lids), 1)), atol=1e-9)
    assert_allclose(lids[:, 2].sum(), 0.0, atol=len(lids))
    assert (
        f"interpolate point data (height, label, RGB, Normals) at {len(new)} new vertices"
        in done.steps
    )


def test_a_flipped_polygon_stays_a_polygon_with_flipped_corners():
    surface = box(turn=[3, 50])
    surface.cell_data["Normals"] = np.tile([1.0, 0.0, 0.0], (surface.n_cells, 1))
    surface.cell_data.active_normals_name = "Normals"
    fixed, done = repair_surface(surface)
    assert done.report.is_closed
    assert done.steps == ("flip 4 faces to agree with the neighbours",)
    assert np.flatnonzero(done.face_turned).size == 4
    assert (polygons_of(fixed)[0] == 4).all()
    assert same_corners(surface, fixed) == 0
    sign = np.where(np.isin(np.arange(surface.n_cells), [3, 50]), -1.0, 1.0)
    assert_array_equal(fixed.cell_data["Normals"][:, 0], sign)
    outward = box()
    area = fixed.compute_cell_sizes(length=False, volume=False).cell_data["Area"]
    assert area.sum() == pytest.approx(6.0 * N * N)
    assert fixed.volume == pytest.approx(outward.volume)


def test_a_polygon_that_loses_a_part_becomes_triangles_and_is_reported():
    surface = box()
    points, (counts, corners) = np.asarray(surface.points), polygons_of(surface)
    triangles, quad = cut_into_triangles(points, counts, corners)
    extra = triangles[quad == 7][0]  # first, so that the triangle of the quad is the duplicate
    double = polydata_of(points, np.append(3, counts), np.append(extra, corners))
    double.cell_data["material"] = np.arange(double.n_cells)
    closed, done = repair_surface(double)
    assert done.report.is_closed
    assert done.steps == (
        "remove 1 duplicate face", "cut 1 polygon into triangles where the repair changed a part",
    )  # fmt: skip
    counts = polygons_of(closed)[0]
    assert sorted(counts)[:3] == [3, 3, 4]
    assert_array_equal(np.sort(closed.cell_data["material"][counts == 3]), [0, 8])


def test_values_merged_by_welding_are_reported():
    surface = box()
    corners = polygons_of(surface)[1]
    apart = polydata_of(np.asarray(surface.points)[corners], np.full(surface.n_cells, 4),
                        np.arange(len(corners)))  # fmt: skip
    apart.point_data["u"] = np.zeros(apart.n_points)
    apart.point_data["u"][3] = 1.0
    closed, done = repair_surface(apart)
    assert (polygons_of(closed)[0] == 4).all()
    assert closed.n_points == surface.n_points
    assert done.steps[1:] == ("keep one of several values of u at 1 welded vertex",)


def test_strips_and_loose_cells_are_reported():
    strip = pv.PolyData(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]))
    strip.verts, strip.lines = np.array([1, 3]), np.array([2, 0, 3])
    strip.strips = np.array([4, 0, 1, 2, 3])
    strip.cell_data["tag"] = np.array([5, 6, 8])
    closed, done = repair_surface(strip)
    assert done.report.is_closed
    assert_array_equal(closed.cell_data["tag"], [8, 8, 0, 0])
    for step in ("remove 1 vertex cell", "remove 1 line", "cut 1 strip into triangles"):
        assert step in done.steps


def test_the_accessor_repairs_a_copy_and_logs_each_step(caplog):
    surface = box(drop=[5])
    with caplog.at_level(logging.INFO, logger="vtk_segdeform"):
        closed = surface.segdeform.repair()
    assert closed.segdeform.check().is_closed
    assert closed.n_cells > surface.n_cells == 6 * N * N - 1
    assert "fill 1 hole of 4 edges" in caplog.text
    caplog.clear()
    left = surface.segdeform.repair(largest_hole=3)
    assert not left.segdeform.check().is_closed
    assert "largest_hole=4 (--largest-hole 4 on the command line)" in caplog.text


def test_the_command_line_fills_holes_up_to_the_given_size(tmp_path, capsys):
    path, out = tmp_path / "open.obj", tmp_path / "closed.obj"
    convert.write_mesh(path, box(drop=[5]))
    command = ["check", str(path), "--repair", "-o", str(out)]
    assert main([*command, "--largest-hole", "3"]) == 1
    text = capsys.readouterr().out
    assert "1 hole remains open, of 4 edges" in text
    assert "largest_hole=4 (--largest-hole 4" in text
    assert main([*command, "--largest-hole", "4"]) == 0
    assert "repaired: fill 1 hole of 4 edges" in capsys.readouterr().out
    closed = convert.read_polydata(out)
    counts = polygons_of(closed)[0]
    assert np.count_nonzero(counts == 4) == 6 * N * N - 1
    assert "TextureCoordinates" in closed.point_data or "TextureCorners" in closed.cell_data
    assert main([*command, "--largest-hole", "four"]) == 2
    assert "--largest-hole" in capsys.readouterr().err
