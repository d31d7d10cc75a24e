"""When unsaved work is autosaved, and when that is deleted: real files, and a clock by hand."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hands import Hand, draw_seldom, plain_view
from scenes import sausage

from vtk_segdeform import Session, load_session, models, save_session
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.editor import (
    About,
    Autosaver,
    Autosaves,
    Controller,
    SessionFile,
    autosaver,
    queue,
)

pytestmark = pytest.mark.usefixtures("unprepared", "bound_once")
UP = np.eye(4)
UP[2, 3] = 0.3


class Bench:
    """An editor, its autosaver, and the files that are there."""

    def __init__(self, folder, monkeypatch):
        self.folder, self.now, self.name = folder / "unsaved", 0.0, "arm"
        for module in (queue, autosaver):
            monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now))
        view = plain_view((200, 150))
        draw_seldom(view)
        self.editor = DeformEditor(view, sausage(is_coarse=True).session())
        self.editor.mode = Mode.HANDLES
        self.editor.On()
        self.hand = Hand(view)
        self.autosaver = Autosaver(
            self.editor.controller, Autosaves(self.folder), lambda: About(self.name)
        )

    @property
    def session(self) -> Session:
        return self.editor.session

    @property
    def files(self):
        return [*self.folder.glob("*/session.segdeform")]

    def wait(self, seconds):
        """Let time pass, and what began in it end."""
        self.now += seconds
        self.hand.tick()
        end = time.monotonic() + 20.0
        while (task := self.editor.controller.queue.task(queue.Kind.AUTOSAVE)) and task.future:
            assert time.monotonic() < end
            self.hand.tick()


@pytest.fixture
def bench(tmp_path, monkeypatch):
    made = Bench(tmp_path, monkeypatch)
    yield made
    made.autosaver.discard()
    assert made.files == []
    made.editor.remove()


def test_a_step_is_saved_after_a_rest_and_deleted_when_it_is_undone_or_saved(bench, tmp_path):
    assert bench.autosaver.is_idle
    for remove in (bench.session.undo, lambda: bench.editor.save(tmp_path / "work.segdeform")):
        bench.session.handles.add([40, 41], "knob")
        assert not bench.autosaver.is_idle
        bench.wait(0.2)
        bench.session.handles.add([50], "other")  # and the rest begins again
        bench.wait(0.2)
        assert bench.files == []
        bench.wait(0.2)
        (file,) = bench.files
        assert {"knob", "other"} <= {*load_session(file).handles}
        assert bench.autosaver.is_idle
        bench.session.undo()
        remove()
        assert bench.files == []  # at once: a crash must not offer what is older than the file
        bench.session.redo()  # the state that was written before
        bench.wait(0.3)
        assert len(bench.files) == 1
        bench.session.undo()
        assert bench.files == []


def test_a_drag_is_saved_every_few_seconds(bench):
    bench.session.move_handle("handle 1", UP, max_steps=1)
    bench.wait(9.0)
    assert bench.files == []
    for _ in range(2):
        bench.session.move_handle("handle 1", UP @ UP, max_steps=1)
        bench.wait(1.5)
        bench.wait(0.3)
        (file,) = bench.files
        assert bench.session.is_dragging
        np.testing.assert_allclose(load_session(file).vertices, bench.session.vertices, atol=1e-9)
        bench.session.move_handle("handle 1", UP, max_steps=1)
        bench.wait(5.0)
        bench.wait(4.0)
    bench.session.commit()


def test_a_failure_is_said_once_and_tried_again(bench):
    bench.folder.write_text("in the way")
    said, say = [], bench.editor.controller.say
    bench.editor.controller.say = lambda text: said.append(text) or say(text)
    bench.session.handles.add([40], "knob")
    for _ in range(3):
        bench.wait(0.3)
        bench.wait(10.0)
    assert len(said) == 1
    assert said[0].startswith("Could not autosave: ")
    bench.folder.unlink()
    bench.wait(10.0)
    assert len(bench.files) == 1


def test_saving_now_waits_and_another_file_has_a_slot_of_its_own(bench, tmp_path):
    bench.session.handles.add([40], "knob")
    bench.autosaver.save()
    (first,) = bench.files
    save_session(tmp_path / "other.segdeform", Session(bench.session.mesh))
    bench.editor.load(tmp_path / "other.segdeform")
    assert bench.files == []
    bench.name = "other"
    bench.session.set_fixed([1, 2])
    bench.autosaver.save()
    (second,) = bench.files
    assert second != first
    assert '"other"' in second.with_name("about.json").read_text()
    second.parent.rename(bench.folder / "gone")  # deleted by hand
    bench.session.set_fixed([3])
    bench.autosaver.save()
    bench.wait(10.0)
    bench.wait(0.3)
    assert [each.parent.name for each in bench.files if each.parent.name != "gone"]
    (bench.folder / "gone" / "session.segdeform").unlink()


def test_a_repaired_copy_and_its_original_are_each_saved_while_they_are_open(bench):
    bench.session.handles.add([40], "knob")
    bench.autosaver.save()
    (first,) = bench.files
    copy = Session(models.sphere(300))
    file = SessionFile(Path("copy.segdeform"), copy)
    file.is_new, bench.name = True, "copy"
    bench.editor.do(partial(Controller.open_repaired, session=copy, file=file))
    bench.wait(0.3)
    (second,) = bench.files
    assert second != first
    assert '"copy"' in second.with_name("about.json").read_text()
    assert load_session(second).mesh.n_vertices == copy.mesh.n_vertices
    bench.editor.run("undo")
    bench.wait(0.3)
    (third,) = bench.files
    assert "knob" in load_session(third).handles
    bench.session.undo()
    assert bench.files == []
