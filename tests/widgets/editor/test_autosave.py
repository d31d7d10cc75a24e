"""Autosaves: their owner, recovery after a crash, and complete files."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from given_surfaces import holed, require_only_moved, tube
from numpy.testing import assert_array_equal

import vtk_segdeform as sd
from vtk_segdeform import Session, Surface, models
from vtk_segdeform.errors import SessionError
from vtk_segdeform.files import lock
from vtk_segdeform.files.lock import hold
from vtk_segdeform.widgets.editor import autosave
from vtk_segdeform.widgets.editor.autosave import About, Autosaves

BALL = models.sphere(300)
ABOUT = About("ball.ply", "/saved/ball.segdeform", "/meshes/ball.ply")


def no_progress(fraction, text):
    """Ignore progress."""


def work(top=0.8):
    """Return a session with unsaved changes."""
    session = Session(BALL)
    session.handles.add(BALL.vertices[:, 2] > top)
    return session


@pytest.fixture
def folder(tmp_path) -> Path:
    return tmp_path / "there" / "unsaved"


def crash(folder, session=None, about=ABOUT):
    """Leave an autosave as a killed program does; return its folder."""
    slot = Autosaves(folder).new(about)
    slot.write(session or work())
    slot.release()
    return slot.path.parent


def test_the_autosave_of_a_crashed_program_is_found_unchanged(folder):
    crash(folder)
    (slot,) = Autosaves(folder).abandoned()
    assert slot.about == ABOUT
    assert abs((slot.when - datetime.now()).total_seconds()) < 100
    session = slot.read(no_progress)
    assert_array_equal(session.mesh.vertices, BALL.vertices)
    assert_array_equal(session.handles["handle 1"], work().handles["handle 1"])


def test_the_given_surface_is_autosaved_once_and_recovered(folder, monkeypatch):
    session = Session(Surface(tube()))
    session.handles.add([0, 1, 2])
    slot = Autosaves(folder).new(ABOUT)
    slot.write(session)
    given = slot.path.with_name("surface.segdeform")
    before = given.stat()
    session.handles.add([5, 6], "other")
    slot.write(session)
    assert given.stat() == before  # neither replaced nor written
    assert sd.load_session(slot.path).surface is None
    slot.release()
    (slot,) = Autosaves(folder).abandoned()
    found = slot.read(no_progress)
    require_only_moved(tube(), found.deformed)
    assert list(found.handles) == ["handle 1", "other"]
    found.set_fixed([8])
    before = given.stat()
    slot.write(found)
    assert given.stat() == before
    slot.remove()
    assert list(folder.iterdir()) == []


def test_work_is_recovered_over_the_mesh_if_the_file_of_its_surface_is_damaged(folder):
    for spoil in (
        lambda path: path.write_bytes(path.read_bytes()[:-9]),
        lambda path: path.unlink(),
        lambda path: sd.save_session(path, Session(Surface(holed()))),
    ):
        session = Session(Surface(tube()))
        session.handles.add([0, 1, 2])
        place = crash(folder, session)
        spoil(place / "surface.segdeform")
        (slot,) = Autosaves(folder).abandoned()
        found = slot.read(no_progress)
        assert found.surface is None
        assert_array_equal(found.mesh.vertices, session.mesh.vertices)
        assert list(found.handles) == ["handle 1"]
        slot.remove()


def test_the_autosave_of_a_running_program_is_offered_once_it_is_killed(folder):
    theirs = crash(folder)
    mine = Autosaves(folder).new(ABOUT)
    mine.write(work())
    paths = [each / "lock" for each in (mine.path.parent, theirs)]
    program = subprocess.Popen(
        [sys.executable, "-c", _HOLD, lock.__file__, *paths], stdout=subprocess.PIPE, text=True
    )
    try:
        held = program.stdout.readline().split()
        assert held[0] == "None"  # mine is locked
        assert held[1] != "None"
        assert Autosaves(folder).abandoned() == []  # nor for another window of the same program
    finally:
        program.kill()
        program.communicate()
    (slot,) = Autosaves(folder).abandoned()
    assert slot.path.parent == theirs
    handles = slot.read(no_progress).handles
    assert_array_equal(handles["handle 1"], work().handles["handle 1"])
    slot.release()
    mine.release()
    assert len(Autosaves(folder).abandoned()) == 2


_HOLD = """
import pathlib, runpy, sys, time
hold = runpy.run_path(sys.argv[1])["hold"]
print(*(hold(pathlib.Path(path)) for path in sys.argv[2:]), flush=True)
time.sleep(1000)
"""


def test_of_two_simultaneous_programs_one_gets_the_autosave(folder):
    for _ in range(5):
        crash(folder)
    found, ready = [], threading.Barrier(4)

    def ask():
        ready.wait()
        found.extend(Autosaves(folder).abandoned())

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == len({slot.path for slot in found}) == 5


def test_abandoned_autosaves_are_offered_until_removed_the_latest_first(folder):
    for name, seconds in (("old", 1000.0), ("new", 3000.0), ("older", 2000.0)):
        path = crash(folder, about=About(name)) / "session.segdeform"
        os.utime(path, (seconds, seconds))
    autosaves = Autosaves(folder)
    for _ in range(2):
        left = autosaves.abandoned()
        assert [slot.about.name for slot in left] == ["new", "older", "old"]
        for slot in left:
            slot.release()
    left = autosaves.abandoned()
    left[0].remove()
    left[0].remove()  # a second call changes nothing
    for slot in left[1:]:
        slot.release()
    assert [slot.about.name for slot in autosaves.abandoned()] == ["older", "old"]


def test_removing_a_slot_also_removes_the_draft_of_a_killed_write(folder):
    slot = Autosaves(folder).new(ABOUT)
    slot.write(work())
    (slot.path.parent / ".segdeform-0123456789abcdef.part").write_bytes(b"half")
    slot.remove()
    assert list(folder.iterdir()) == []


def test_an_empty_slot_is_deleted_unless_it_is_locked(folder):
    autosaves = Autosaves(folder)
    begun, gone = autosaves.new(ABOUT), autosaves.new(ABOUT)
    gone.release()
    assert autosaves.abandoned() == []
    assert list(folder.iterdir()) == [begun.path.parent]
    begun.write(work())


def test_work_without_a_description_is_recovered_too(folder):
    for damage in (None, "", "{", "[]", '{"name": 3}', json.dumps({"name": "x"})):
        about = crash(folder) / "about.json"
        if damage is None:
            about.unlink()
        else:
            about.write_text(damage)
    assert {slot.about for slot in Autosaves(folder).abandoned()} == {About()}


def test_damaged_work_is_reported_and_kept(folder):
    path = crash(folder) / "session.segdeform"
    path.write_bytes(path.read_bytes()[:-100])
    (slot,) = Autosaves(folder).abandoned()
    with pytest.raises(SessionError, match="readable"):
        slot.read(no_progress)
    slot.release()
    assert len(Autosaves(folder).abandoned()) == 1


def test_a_failed_write_leaves_the_previous_autosave(folder, monkeypatch):
    slot = Autosaves(folder).new(ABOUT)
    slot.write(work(0.8))
    monkeypatch.setattr("os.replace", _full)
    with pytest.raises(SessionError, match="No space"):
        slot.write(work(0.3))
    monkeypatch.undo()
    kept = slot.read(no_progress).handles["handle 1"]
    assert_array_equal(kept, work(0.8).handles["handle 1"])
    assert not list(slot.path.parent.glob("*.part"))


def _full(*_):
    raise OSError(28, "No space left on device")


def test_an_unwritable_folder_is_reported(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    with pytest.raises(SessionError, match="file"):
        Autosaves(tmp_path / "file" / "unsaved").new(ABOUT)
    assert Autosaves(tmp_path / "nowhere").abandoned() == []
    monkeypatch.setattr(autosave, "hold", lambda _: None)
    with pytest.raises(SessionError, match="locked"):
        Autosaves(tmp_path).new(ABOUT)


def test_a_lock_is_acquired_once_and_not_on_a_deleted_file(tmp_path):
    path = tmp_path / "lock"
    first = hold(path)
    assert first is not None
    assert hold(path) is None
    if os.name == "posix":
        path.unlink()
        second = hold(path)  # another file of the same name
        assert second is not None
        os.close(second)
    os.close(first)
    third = hold(path)
    assert third is not None
    os.close(third)


def test_another_thread_can_save_a_session_while_it_changes(folder):
    session, slot = work(), Autosaves(folder).new(ABOUT)
    done = threading.Event()
    kept = []

    def keep():
        while not done.is_set():
            slot.write(session)
            kept.append(slot.read(no_progress).handles["handle 1"])

    thread = threading.Thread(target=keep)
    thread.start()
    tops = np.linspace(0.1, 0.9, 9)
    known = [tuple(np.flatnonzero(BALL.vertices[:, 2] > top)) for top in (*tops, 0.8)]
    while len(kept) < 10:
        for top in tops:
            session.handles.add(BALL.vertices[:, 2] > top, "handle 1")
    done.set()
    thread.join()
    assert {tuple(ids) for ids in kept} <= set(known)


SLOT = "0123456789abcdef"
posix = pytest.mark.skipif(os.name != "posix", reason="links, pipes and owners of files")


def tree_of(folder):
    """Return all files below a folder with their content, links not followed."""
    return {
        str(path.relative_to(folder)): (
            os.readlink(path) if path.is_symlink() else path.is_file() and path.read_bytes()
        )
        for path in sorted(folder.rglob("*"))
    }


def ask(folder):
    """List the remaining slots twice, and release all of them."""
    for _ in range(2):
        for slot in Autosaves(folder).abandoned():
            slot.release()


@pytest.mark.parametrize(
    ("name", "inside"),
    [("photos", ["a.txt", "lock"]), ("8f31", ["lock", "about.json"]), (SLOT, ["a.txt", "x/y"]),
     (SLOT, [])],
)  # fmt: skip
def test_a_foreign_folder_is_unchanged(folder, name, inside):
    for each in inside:
        path = folder / name / each
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("mine")
    (folder / name).mkdir(parents=True, exist_ok=True)
    before = tree_of(folder)
    ask(folder)
    assert tree_of(folder) == before


@posix
def test_links_are_never_followed(folder, tmp_path):
    outside = tmp_path / "outside"
    slot = crash(folder)
    (folder / "copy").mkdir()
    slot.rename(outside)  # a valid slot in another folder
    (folder / SLOT).symlink_to(outside)
    (folder / "fedcba9876543210").symlink_to("nowhere")
    (folder / "circle").symlink_to("circle")
    linked = crash(folder)
    (linked / "session.segdeform").unlink()
    (linked / "session.segdeform").symlink_to(outside / "session.segdeform")
    empty = Autosaves(folder).new(ABOUT)
    empty.release()
    lock = empty.path.with_name("lock")
    lock.unlink()
    lock.symlink_to(outside / "lock")
    before = tree_of(tmp_path)
    assert Autosaves(folder).abandoned() == []
    ask(folder)
    assert tree_of(tmp_path) == before


@posix
def test_unsaved_work_is_not_written_through_a_link(folder, tmp_path):
    slot = Autosaves(folder).new(ABOUT)
    (tmp_path / "precious").write_text("mine")
    slot.path.symlink_to(tmp_path / "precious")
    with pytest.raises(SessionError, match="is a symbolic link"):
        slot.write(work())
    slot.remove()
    assert (tmp_path / "precious").read_text() == "mine"
    assert slot.path.is_symlink()


@posix
def test_pipes_and_folders_with_our_names_neither_block_nor_are_deleted(folder):
    for number, name in enumerate(("lock", "about.json", "session.segdeform")):
        for make, digit in ((os.mkfifo, "a"), (os.mkdir, "b")):
            slot = Autosaves(folder).new(ABOUT)
            slot.release()
            path = slot.path.with_name(name)
            path.unlink(missing_ok=True)
            make(path)
            slot.path.parent.rename(folder / f"{digit}{number:015d}")
    ask(folder)
    left = {path for path in tree_of(folder) if path.count("/")}
    for number, name in enumerate(("lock", "about.json", "session.segdeform")):
        assert {f"{digit}{number:015d}/{name}" for digit in "ab"} <= left


def test_a_foreign_file_in_a_slot_and_the_folder_are_kept(folder):
    slot = Autosaves(folder).new(ABOUT)
    slot.write(work())
    mine = slot.path.with_name("precious.ply")
    mine.write_text("mine")
    deeper = slot.path.parent / "more" / "precious.ply"
    deeper.parent.mkdir()
    deeper.write_text("mine")
    slot.remove()
    assert tree_of(slot.path.parent) == {
        "more": False, "more/precious.ply": b"mine", "precious.ply": b"mine",
    }  # fmt: skip
    ask(folder)
    assert mine.read_text() == deeper.read_text() == "mine"


def test_slots_of_earlier_versions_are_found_and_removed_too(folder):
    path = crash(folder)
    begun = Autosaves(folder).new(ABOUT)
    begun.release()
    for each in (path, begun.path.parent):  # an empty lock
        (each / "lock").write_bytes(b"")
    (slot,) = Autosaves(folder).abandoned()
    assert slot.about == ABOUT
    slot.remove()
    assert list(folder.iterdir()) == []


@posix
@pytest.mark.skipif(os.name == "posix" and os.geteuid() != 0, reason="only root gives files away")
def test_files_of_another_user_are_unchanged(folder):
    path = crash(folder)
    os.chown(path, 12345, 12345)
    assert Autosaves(folder).abandoned() == []
    os.chown(path, 0, 0)
    os.chown(path / "session.segdeform", 12345, 12345)
    assert Autosaves(folder).abandoned() == []
    assert (path / "session.segdeform").exists()
