"""What objects say of themselves: a line of numbers, and a table in a notebook."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scenes import sausage

import vtk_segdeform as sd
from vtk_segdeform.checks import Described

SCENE = sausage()


@pytest.fixture(scope="module")
def posed() -> sd.Session:
    session = sd.Session(SCENE.mesh)
    session.set_regions(SCENE.regions)
    session.set_cages(SCENE.cages)
    session.set_fixed(SCENE.fixed)
    session.handles.add(SCENE.handle, "tip")
    session.drag(session.targets["tip"] + [0.0, 0.0, 0.1])
    session.commit()
    return session


N = f"{SCENE.mesh.n_vertices:,}"


@pytest.mark.parametrize(
    ("thing", "numbers"),
    [
        (lambda _: SCENE.mesh, [f"vertices: {N};", "borders: none"]),
        (lambda _: sd.Surface(pv.Cube(clean=False)), ["points: 24;", "cells: 6;", "vertices: 8;"]),
        (lambda _: SCENE.regions, ["regions: 2;", f"vertices: {N}"]),
        (lambda _: SCENE.cages[0], [f"faces: {SCENE.cages[0].n_faces:,}"]),
        (lambda session: session.solution, ["status: converged", "volume change: "]),
        (lambda session: session.state, ["pose: deformed", "handles: 1"]),
        (
            lambda session: session,
            [f"vertices: {N};", "handles: 1", "step: 5 of 5", "next: drag a handle"],
        ),
    ],
)
def test_a_line_of_numbers_and_a_table(posed, thing, numbers):
    thing = thing(posed)
    line, table = repr(thing), thing._repr_html_()
    assert line.startswith(f"<{type(thing).__name__} ")
    assert "\n" not in line
    assert len(line) < 240
    for each in numbers:
        assert each in line
    for name, text in thing.facts().items():
        assert f"<th>{name}</th><td>{text}</td>" in table


def test_an_open_mesh_has_borders_and_a_session_without_anything_has_a_line():
    mesh = sd.Mesh(*np.split(SCENE.mesh.vertices, []), SCENE.mesh.faces[1:])
    assert "borders: 1;" in repr(mesh)
    assert "next: create regions" in repr(sd.Session(mesh))


def test_objects_with_large_arrays_have_short_texts(posed):
    deformer = posed.deformer
    for each in (
        sd.Slide(np.arange(1000)), posed.state.pose, deformer.subspace, deformer.bodies,
        deformer.passengers(SCENE.mesh.vertices), posed.lids,
    ):  # fmt: skip
        assert repr(each).startswith(f"{type(each).__name__}(")
        assert len(repr(each)) < 400
    assert "an array of int64 and shape" in repr(posed.lids)


def test_text_in_a_table_is_escaped():
    class Odd(Described):
        def facts(self):
            return {"<b>": "a & b"}

    assert "<th>&lt;b&gt;</th><td>a &amp; b</td>" in Odd()._repr_html_()
