"""Colours of handles: each handle keeps its own."""

from __future__ import annotations

from solids import icosphere

from vtk_segdeform import Session
from vtk_segdeform.mesh.mesh import Mesh
from vtk_segdeform.widgets.scene import handle_colour


def test_a_handle_keeps_its_colour_when_others_go_come_and_get_names():
    session = Session(Mesh(*icosphere(1)))
    for vertex in range(3):
        session.handles.pin(vertex)

    def colours():
        return {name: handle_colour(session, name).tobytes() for name in session.handles}

    first = colours()
    assert len({*first.values()}) == 3
    session.handles.remove("pin 2")
    assert colours() == {name: first[name] for name in ("pin 1", "pin 3")}
    assert handle_colour(session, None).tobytes() == first["pin 2"]  # of the next one
    session.undo()
    assert colours() == first
    session.handles.rename("pin 1", "foot")
    assert colours() == {"foot": first["pin 1"], "pin 2": first["pin 2"], "pin 3": first["pin 3"]}
    session.handles.remove("pin 3")
    session.handles.pin(3)  # "pin 1" again, beside its former self
    assert len({*colours().values()}) == 3
