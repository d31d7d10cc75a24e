"""The history says what each step did, where, and by how much."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import sausage
from scipy.spatial.transform import Rotation

from vtk_segdeform.widgets.editor.session_history import step_texts

pytestmark = pytest.mark.usefixtures("bound_once")


def test_steps_are_named_by_what_moved_where_and_how_far():
    scene = sausage(is_coarse=True)
    session, x = scene.session(), scene.mesh.vertices
    session.painting.rename(0, "left hand")
    (name,) = session.handles
    up, turn = np.eye(4), np.eye(4)
    up[2, 3] = 0.25
    session.move_handle(name, up)
    session.commit()
    centre = session.targets[name].mean(axis=0)
    turn[:3, :3] = Rotation.from_euler("y", 30, degrees=True).as_matrix()
    turn[:3, 3] = centre - turn[:3, :3] @ centre
    session.move_handle(name, turn)
    session.commit(f"rotate {name}")
    vertex = int(np.abs(x - [-1.0, -0.8, 0.0]).max(axis=1).argmin())
    region = session.painting.name(session.regions.label_at(vertex))
    session.handles.pin(vertex)
    other = int(np.abs(x - [0.5, -0.8, 0.0]).max(axis=1).argmin())
    session.pull(other, session.vertices[other] + [0.0, -0.3, 0.4])
    session.commit("pull")
    session.handles.rename("pull 1", "belly")
    session.pull(other, session.vertices[other] + [0.0, 0.0, -0.1])
    session.commit("pull")
    session.set_volume("region 1", "+10%")
    there = session.painting.name(session.regions.label_at(other))
    assert step_texts(session)[-7:] == (
        f"drag {name}, 0.25",
        f"rotate {name}, 30°",
        f"pin {region}",
        f"pull {there}, 0.5",
        "rename pull 1",
        "pull belly, 0.1",
        "drag the volume of region 2",  # not committed yet
    )
    assert "left hand" in (region, there)
    session.commit("set the volume of region 2")
    assert step_texts(session)[-1] == "set the volume of region 2, +10%"
