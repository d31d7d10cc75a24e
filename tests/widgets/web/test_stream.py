"""A page is sent what it lacks, and nothing twice."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hands import plain_view
from posed_scenes import random_cages, sausage_session
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkFiltersCore import vtkStripper
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from vtk_segdeform.session import Change
from vtk_segdeform.widgets.web.drawing import Look, Mark, SurfaceStream, marks_of
from vtk_segdeform.widgets.web.drawing.marks import Shape
from vtk_segdeform.widgets.web.drawing.messages import Kind

pytestmark = pytest.mark.usefixtures("bound_once")
LOOK = Look(
    np.eye(4), np.eye(4), np.ones(3), 0.2, 0.8,
    np.array([[0.0, 0.0, 1.0, 1.0, 1.0, 1.0]]),
)  # fmt: skip


def kinds(messages) -> list[Kind]:
    return [Kind(struct.unpack_from("<6xH", data)[0]) for data in messages]


@pytest.fixture
def stream():
    """Return a stream whose page has everything, in a pose."""
    session = sausage_session()
    session.move_cage(0, random_cages(session, 4, 0.05)[0])
    session.commit()
    stream = SurfaceStream(session)
    stream.encode()
    assert kinds(stream.due(LOOK)) == [Kind.SURFACE, Kind.LOOK, Kind.CAGES]
    assert not stream.due(LOOK)
    return stream


def test_before_it_is_encoded_nothing_is_due():
    stream = SurfaceStream(sausage_session())
    assert stream.is_possible
    assert not stream.is_encoded
    assert not stream.due(LOOK)


def test_a_drag_sends_twelve_bytes_for_each_cage_vertex(stream):
    session = stream.session
    for k in range(3):
        session.move_cage(1, random_cages(session, k, 0.05)[1])
        (data,) = stream.due(LOOK)
        assert kinds([data]) == [Kind.CAGES]
        assert len(data) == 20 + 12 * sum(cage.n_vertices for cage in session.cages)
    session.undo()
    assert kinds(stream.due(LOOK)) == [Kind.CAGES]


def test_colours_look_and_marks_are_sent_when_they_change(stream):
    colours = np.zeros((stream.session.mesh.n_vertices, 3), np.uint8)
    assert kinds(stream.due(LOOK, colours=colours)) == [Kind.COLOURS]
    assert not stream.due(LOOK, colours=colours)
    assert kinds(stream.due(LOOK)) == [Kind.COLOURS]
    turned = Look(**{**vars(LOOK), "view": np.diag([1.0, -1.0, -1.0, 1.0])})
    assert kinds(stream.due(turned)) == [Kind.LOOK]
    dot = Mark(Shape.POINTS, np.zeros((1, 3)), np.ones(4), 8.0, True)
    assert kinds(stream.due(turned, marks=[dot])) == [Kind.MARKS]
    assert not stream.due(turned, marks=[dot])
    assert kinds(stream.due(turned)) == [Kind.MARKS]


def test_a_finished_pose_is_sent_with_its_offsets_and_dragged_on_without(stream):
    session = stream.session
    session.undo()
    session.move_handle("end", session.targets["end"] + [-0.5, 0.8, 0.0])
    session.commit()
    assert kinds(stream.due(LOOK)) == [Kind.CAGES]
    session.finish()
    (data,) = stream.due(LOOK)
    assert kinds([data]) == [Kind.OFFSETS]
    step = np.frombuffer(data, "<f4", 1, 16)
    n = session.mesh.n_vertices
    offsets = step * np.frombuffer(data, "<i2", 3 * n, 20).reshape(-1, 3)
    surface = stream.surface
    at_cages = session.deformer.surface(session.cage_vertices)[surface.order]
    shown = at_cages + surface.scale * offsets
    np.testing.assert_allclose(
        shown, session.vertices[surface.order], atol=0.51 * surface.scale * float(step[0])
    )
    session.move_handle("end", session.targets["end"] + [0.0, 0.01, 0.0])
    assert kinds(stream.due(LOOK)) == [Kind.CAGES]
    session.undo()
    session.undo()
    assert kinds(stream.due(LOOK)) == [Kind.OFFSETS, Kind.CAGES]  # none any more


class Page:
    """What a page draws after all messages so far: W p, and the offsets."""

    def __init__(self, stream: SurfaceStream) -> None:
        self.stream = stream
        self.reload()

    def reload(self) -> None:
        """Forget everything."""
        self.stream.reset()
        self.moves, self.offsets = None, 0.0

    def error(self) -> float:
        """Receive what is due; return the largest distance from the session's pose, in diagonals.

        W~ is exact here; `test_encoding` tests what is sent of it.
        """
        for data in self.stream.due(LOOK):
            (kind,) = kinds([data])
            if kind is Kind.CAGES:
                self.moves = np.frombuffer(data, "<f4", offset=20).reshape(-1, 3)
            elif kind is Kind.OFFSETS:
                rest = np.frombuffer(data, "<i2", offset=20).reshape(-1, 3)  # padded
                self.offsets = np.frombuffer(data, "<f4", 1, 16) * rest if len(rest) else 0.0
        surface, session = self.stream.surface, self.stream.session
        p = surface.cages + surface.scale * self.moves
        ends = np.cumsum([cage.n_vertices for cage in session.cages])[:-1]
        at_cages = session.deformer.surface(np.split(p, ends))[surface.order]
        x = at_cages + surface.scale * self.offsets
        return float(np.abs(x - session.vertices[surface.order]).max() / surface.scale)


def test_the_page_follows_poses_that_were_finished_and_dragged_on(stream):
    session, errors, largest = stream.session, [], 0.0
    page = Page(stream)
    end = session.targets["end"]
    steps = [
        session.undo,
        lambda: session.move_handle("end", end + [-2.0, 1.5, 0.8]),
        session.commit,
        session.finish,
        page.reload,
        *(lambda k=k: session.move_handle("end", end + [-2.0, 1.5 + 0.2 * k, 0.8]) for k in (1, 2)),
        session.commit,
        session.finish,  # with other offsets
        session.undo,
        session.undo,
        session.redo,
        session.redo,
        session.reset_pose,
    ]
    for step in steps:
        step()
        errors.append(page.error())
        largest = max(largest, float(np.abs(page.offsets).max()))
    assert max(errors) <= 1.1e-4, errors  # which is not seen
    assert largest > 0.015


def test_a_new_page_is_sent_everything(stream):
    stream.reset()
    assert kinds(stream.due(LOOK)) == [Kind.SURFACE, Kind.LOOK, Kind.CAGES]


def test_after_new_cages_nothing_is_due_until_they_are_encoded(stream):
    session = stream.session
    seen = []
    session.on_change(seen.append)
    first = session.cages[0]
    session.set_cages([type(first)(1.01 * first.vertices, first.faces), *session.cages[1:]])
    assert any(change & Change.CAGES for change in seen)
    assert not stream.due(LOOK)
    session.bind()
    assert not stream.due(LOOK)
    stream.encode()
    messages = stream.due(LOOK)
    assert kinds(messages) == [Kind.SURFACE, Kind.LOOK, Kind.CAGES]
    assert struct.unpack_from("<12xI", messages[0]) == (2,)


def solid(*, strips: bool):
    """Return a small ball as an actor, and its mapper."""
    actor, mapper, source = vtkActor(), vtkPolyDataMapper(), vtkSphereSource()
    source.SetThetaResolution(24)
    source.SetPhiResolution(24)
    last = source
    if strips:
        last = vtkStripper()
        last.SetInputConnection(source.GetOutputPort())
    mapper.SetInputConnection(last.GetOutputPort())
    actor.SetMapper(mapper)
    return actor, mapper


@pytest.mark.parametrize("strips", [False, True])
def test_a_solid_is_marked_with_what_vtk_culls_clips_and_moves(strips):
    view = plain_view((100, 100))
    actor, mapper = solid(strips=strips)
    view.renderer.AddActor(actor)
    (mark,) = marks_of(view, [])
    a, b, c = mark.points.reshape(-1, 3, 3).transpose(1, 0, 2)
    assert len(a) == 2 * 24 * 21 + 2 * 24
    assert (np.cross(b - a, c - a) * a).sum(axis=1).min() > 0.0  # no triangle is turned over
    assert (mark.matrix, mark.shows_backs, mark.plane.tolist()) == (None, False, [0, 0, 0, 1])
    actor.GetProperty().SetFrontfaceCulling(True)
    actor.SetPosition(1.0, 2.0, 3.0)
    plane = vtkPlane()
    plane.SetOrigin(1.0, 0.0, 0.0)
    plane.SetNormal(0.6, 0.8, 0.0)
    mapper.AddClippingPlane(plane)
    (moved,) = marks_of(view, [])
    np.testing.assert_array_equal(moved.points, mark.points)
    np.testing.assert_allclose(moved.matrix[:3, 3], [1.0, 2.0, 3.0])
    assert moved.shows_backs
    np.testing.assert_allclose(moved.plane, [0.6, 0.8, 0.0, -0.6])


def test_a_mark_that_moves_is_sent_without_its_points(stream):
    view = plain_view((100, 100))
    actor, _ = solid(strips=False)
    view.renderer.AddActor(actor)
    sizes = []
    for place in (1.0, 2.0, 3.0):
        actor.SetPosition(place, 0.0, 0.0)
        (data,) = stream.due(LOOK, marks=marks_of(view, []))
        sizes.append(len(data))
    assert sizes == [16 + 120 + 12 * 3 * 1056, 16 + 120, 16 + 120]
    assert not stream.due(LOOK, marks=marks_of(view, []))
    (both,) = stream.due(LOOK, marks=2 * marks_of(view, []))
    assert len(both) == 16 + 2 * 120
    assert kinds(stream.due(LOOK)) == [Kind.MARKS]
    (again,) = stream.due(LOOK, marks=marks_of(view, []))  # the page has forgotten it
    assert len(again) == sizes[0]
    stream.reset()
    assert len(stream.due(LOOK, marks=marks_of(view, []))[-1]) == sizes[0]
