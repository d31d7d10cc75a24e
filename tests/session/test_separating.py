"""Followers in a session: they are dragged along until they have handles of their own."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import Scene, ball, bent, rod, tube
from campaign import every
from numpy.testing import assert_allclose, assert_array_equal
from open_meshes import combined
from solids import icosphere

from vtk_segdeform.errors import SessionError
from vtk_segdeform.mesh import Mesh
from vtk_segdeform.regions import Regions
from vtk_segdeform.session import Session, load_session, save_session


@pytest.fixture
def scene() -> Scene:
    return bent(rod(0.5, 0.0, 4.0, n=20, step=0.16), tube(0.55, 0.62, 1.0, 3.0, n=24, step=0.16))


@pytest.fixture
def session(scene: Scene) -> Session:
    """Return a session of an arm in a sleeve with a handle on the arm, segmented before that."""
    made = Session(scene.mesh)
    made.segment()
    made.fit_cages()
    made.set_fixed(scene.fixed)
    made.handles.add(scene.handle, "hand")
    return made


def ends_of_sleeve(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    z, own = scene.mesh.vertices[:, 2], scene.mesh.components == 1
    return np.flatnonzero(own & (z < 1.2)), np.flatnonzero(own & (z > 2.8))


def test_a_sleeve_with_handles_of_its_own_is_separated_in_the_same_step(scene, session):
    low, high = ends_of_sleeve(scene)
    session.set_fixed(np.append(scene.fixed, low))
    assert session.regions.n_regions == len(session.cages) == 2
    assert_array_equal(session.regions.components, np.eye(2, dtype=bool))
    session.handles.add(high, "cuff")
    session.drag({"cuff": scene.mesh.vertices[high] + [0.2, 0.0, 0.0]})
    session.commit()
    moved = np.linalg.norm(session.vertices - scene.mesh.vertices, axis=1)
    assert moved[scene.mesh.components == 0].max() < 1e-4 * scene.mesh.diagonal
    assert moved[high].min() > 0.19
    for _ in range(3):
        session.undo()
    assert session.regions.n_regions == len(session.cages) == 1


def test_a_pose_remains_when_a_sleeve_is_separated(scene, session):
    session.drag({"hand": scene.targets(40.0)})
    session.commit()
    before, (_, high) = session.vertices, ends_of_sleeve(scene)
    session.handles.add(high, "cuff")
    assert session.regions.n_regions == 2
    away = np.linalg.norm(session.vertices - before, axis=1)
    assert away.max() < 0.03 * scene.mesh.diagonal
    assert_allclose(session.targets["hand"], scene.targets(40.0))
    session.undo()
    assert_array_equal(session.vertices, before)


def test_attachments_are_an_option_that_is_undone_and_kept_in_files(scene, session, tmp_path):
    session.change_options(attach={1: "free"})
    assert session.history.labels[-1] == "change attached components"
    session.segment()
    assert session.regions.n_regions == 2
    session.fit_cages()
    save_session(tmp_path / "free.segdeform", session)
    loaded = load_session(tmp_path / "free.segdeform")
    assert loaded.options == session.options
    assert loaded.options.attach == ((1, "free"),)
    for _ in range(3):
        session.undo()
    assert session.options.attach == ()
    save_session(tmp_path / "follows.segdeform", session)
    loaded = load_session(tmp_path / "follows.segdeform")
    assert_array_equal(loaded.regions.carrier, [0, 0])
    assert_array_equal(loaded.regions.weights, session.regions.weights)


@pytest.mark.parametrize("pulled", every(2, [True, False]))
def test_a_change_of_what_follows_is_one_step_and_moves_nothing_that_is_held(pulled):
    scene = bent(rod(0.5, 0.0, 4.0, n=12, step=0.4), tube(0.6, 0.7, 1.0, 3.0, n=12, step=0.4))
    session = Session(scene.mesh)
    session.change_options(n_cage_vertices=60)
    session.segment()
    session.fit_cages()
    if pulled:
        tip = int(scene.handle[0])
        session.pull(tip, scene.mesh.vertices[tip] + [0.3, 0.0, -0.2])
    else:
        session.set_fixed(scene.fixed)
        session.handles.add(scene.handle, "hand")
        session.drag({"hand": scene.targets(30.0)})
    session.commit()
    before, steps = session.vertices, len(session.history.labels)
    for attach, carrier, count in (
        ({1: "free"}, [0, 1], 2), ({0: 1}, [1, 1], 1), ({}, [0, 0], 1),
    ):  # fmt: skip
        session.attach(attach)
        found = session.regions.carrier
        assert_array_equal(found, carrier)
        assert len(session.cages) == session.regions.n_regions >= count
        if attach != {0: 1}:  # a sleeve is too short for the pose of the arm
            should, is_sleeve = before.copy(), scene.mesh.components == 1
            if attach and not pulled:  # nothing but the handle of the arm has moved it
                should[is_sleeve] = scene.mesh.vertices[is_sleeve]
            away = np.linalg.norm(session.vertices - should, axis=1)
            assert away.max() < 0.05 * scene.mesh.diagonal
        for name in ("body 0", "body 1"):
            assert abs(session.volume(name)[1]) < 1e-12
        assert session.options.attach == tuple(attach.items())
    assert session.history.labels[steps:] == ("change attached components",) * 3
    for _ in range(3):
        session.undo()
    assert_array_equal(session.vertices, before)


def test_what_is_attached_follows_at_once_and_other_regions_remain():
    scene = bent(rod(0.4, 0.0, 3.0, n=10, step=0.3), ball(0.3, (1.5, 0.0, 2.5), 1))
    session, x = Session(scene.mesh), scene.mesh.vertices
    session.change_options(n_cage_vertices=50)
    low = x[:, 2] < 1.5
    session.set_regions(Regions.from_masks(scene.mesh, [low, ~low]).grow(2))
    session.painting.rename(0, "low")
    session.fit_cages()
    masks = session.regions.membership[:, scene.mesh.components == 0]
    session.attach({1: 0})
    assert_array_equal(session.regions.membership[:, scene.mesh.components == 0], masks)
    assert session.painting.name(0) == "low"
    session.set_fixed(scene.fixed)
    session.handles.add(scene.handle, "hand")
    session.drag({"hand": scene.targets(40.0)})
    session.commit()
    moved = np.linalg.norm(session.vertices - x, axis=1)
    assert moved[scene.mesh.components == 1].min() > 0.1
    with pytest.raises(SessionError, match="lead back to a component"):
        session.attach({1: 0, 0: 1})
    with pytest.raises(SessionError, match="attach must map components"):
        session.attach({1: 7})
    session.attach({1: "free"})
    assert session.regions.n_regions == 3


@pytest.mark.parametrize("attach", [{1: "loose"}, {1: 1}, {-1: 0}, 7, [[1, 2, 3]]])
def test_attachments_of_a_session_are_checked(session, attach):
    with pytest.raises(SessionError, match="attach must map"):
        session.change_options(attach=attach)


def test_a_slider_for_a_cavity_gives_it_regions_of_its_own_in_the_same_step(tmp_path):
    x, faces = icosphere(2)
    session = Session(combined(Mesh(1.2 * x, faces), Mesh(0.9 * x, faces)))
    session.segment()
    session.fit_cages()
    before = session.state
    assert before.regions.n_regions == 1
    for share in (95, 90, 85):
        session.set_volume("cavity", f"{share}%", max_steps=8)
        session.commit("set the volume of cavity", join=True)
    assert session.history.labels[-2:] == ("fit cages", "set the volume of cavity")
    assert_array_equal(session.regions.leader, [0, 0])
    assert_array_equal(session.regions.components, np.eye(2, dtype=bool))
    assert not len(session.solution.crossings())
    assert session.volume("cavity")[1] == pytest.approx(-0.15, abs=1e-12)
    save_session(tmp_path / "hollow.segdeform", session)
    other = load_session(tmp_path / "hollow.segdeform")
    assert_array_equal(other.vertices, session.vertices)
    assert_array_equal(other.regions.leader, [0, 0])
    session.finish()  # without handles
    session.undo()
    assert session.state is before
    again = Session(session.mesh)
    again.change_options(volumes={"cavity": "85%"})
    again.segment()
    assert_array_equal(again.regions.leader, [0, 0])
