"""A session keeps the turns of its handles: by steps, by undo and in files."""

from __future__ import annotations

import numpy as np
import pytest
from bars import BAR, HEIGHT, twist
from solids import rotation

from vtk_segdeform.regions.regions import Regions
from vtk_segdeform.session import Session, load_session, save_session


def turned(degrees: float) -> np.ndarray:
    """Return the (4, 4) matrix of a rotation about z."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation([0.0, 0.0, 1.0], np.radians(degrees))
    return matrix


def test_a_handle_that_is_turned_in_steps_winds_the_body_and_it_stays_wound(tmp_path):
    session, z = Session(BAR), BAR.vertices[:, 2]
    session.set_regions(Regions.single(BAR))
    session.change_options(n_cage_vertices=80)
    session.fit_cages()
    session.set_fixed(z < 0.5)
    name = session.handles.add(z > HEIGHT - 0.5)
    for degrees in (-90.0, -180.0, -270.0):
        session.move_handle(name, turned(degrees))
    session.commit()
    save_session(tmp_path / "wound.segdeform", session)
    session.undo()
    assert twist(session.vertices)[-1] == pytest.approx(0.0, abs=1e-9)
    session.redo()
    for each in (session, load_session(tmp_path / "wound.segdeform")):
        each.refine()
        assert twist(each.vertices)[-1] == pytest.approx(-270.0, abs=1.0)
        assert abs(each.volume_change) < 1e-12
    session.finish()
    assert twist(session.vertices)[-1] == pytest.approx(-270.0, abs=1e-6)
