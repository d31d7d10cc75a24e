"""What was bound once is found again, and nothing else is."""

from __future__ import annotations

import os
import re

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scenes import sausage

from vtk_segdeform import Deformer, Mesh, Regions, Session
from vtk_segdeform.deformer import binding, binding_cache
from vtk_segdeform.errors import Cancelled
from vtk_segdeform.session import pose_solver
from vtk_segdeform.solver import coarse_volume

SCENE = sausage(2)
TARGETS = SCENE.turned(20)


@pytest.fixture
def counted(monkeypatch):
    """Count how often cages are bound."""
    binding_cache = []
    whole = binding.bind

    def bind(*arguments, **options):
        binding_cache.append(1)
        return whole(*arguments, **options)

    monkeypatch.setattr(binding, "bind", bind)
    return binding_cache


@pytest.mark.parametrize("large", [500, 10**9])
def test_the_second_time_nothing_is_bound_and_the_pose_is_the_same_bit_for_bit(
    tmp_path, counted, monkeypatch, large
):
    monkeypatch.setattr(coarse_volume, "_LARGE", large)
    monkeypatch.setattr(coarse_volume, "_POINTS", 300)
    first = SCENE.deformer(cache=tmp_path).solve(TARGETS)
    assert len(counted) == 1
    again = SCENE.deformer(cache=tmp_path).solve(TARGETS)
    assert len(counted) == 1
    assert_array_equal(again.vertices, first.vertices)
    assert len(list(tmp_path.iterdir())) == 1


def without_a_vertex_moved():
    vertices = np.array(SCENE.mesh.vertices)
    vertices[5] *= 1.0 + 1e-15
    return Mesh(vertices, SCENE.mesh.faces)


OTHERS = {
    "mesh": lambda cache: Deformer(
        mesh := without_a_vertex_moved(),
        Regions.from_masks(mesh, SCENE.regions.membership),
        SCENE.cages,
        cache=cache,
    ),
    "cages": lambda cache: Deformer(
        SCENE.mesh,
        SCENE.regions,
        [type(c)(c.vertices * [1.0, 1.0, 1.0 + 1e-12], c.faces) for c in SCENE.cages],
        cache=cache,
    ),
    "regions": lambda cache: Deformer(
        SCENE.mesh, SCENE.regions.grow(1), sausage(2).cages, cache=cache
    ),
    "blend": lambda cache: SCENE.deformer(
        cache=cache, blend=SCENE.regions.membership / SCENE.regions.membership.sum(axis=0)
    ),
    "stretch": lambda cache: SCENE.deformer(cache=cache, stretch=9.0),
    "groups": lambda cache: SCENE.deformer(cache=cache, rotation_groups=50),
}


@pytest.mark.parametrize("other", OTHERS)
def test_whatever_it_depends_on_makes_another_one(tmp_path, counted, other):
    SCENE.deformer(cache=tmp_path)
    OTHERS[other](tmp_path)
    assert len(counted) == 2


def test_what_does_not_matter_to_it_finds_the_same(tmp_path, counted):
    SCENE.deformer(cache=tmp_path)
    SCENE.deformer(cache=tmp_path, preserve_volume=False, tolerance=1e-3)
    assert len(counted) == 1


@pytest.mark.parametrize(
    "damage", ["cut", "empty", "other", "flipped", "an array", "encrypted", "compressed", "header"]
)
def test_a_damaged_file_is_as_good_as_none(tmp_path, counted, damage):
    sound = SCENE.deformer(cache=tmp_path).solve(TARGETS)
    (path,) = tmp_path.iterdir()
    content = bytearray(path.read_bytes())
    if damage == "flipped":
        content[len(content) // 2] ^= 255
    directory = content.index(b"PK\x01\x02")
    if damage == "encrypted":
        content[directory + 8] |= 1
    if damage == "compressed":
        content[directory + 10] = 99
    if damage == "header":
        content[content.index(b"{'descr'")] = ord("(")
    made = {"cut": content[: len(content) // 2], "empty": b"", "other": b"PK nothing"}
    path.write_bytes(made.get(damage, bytes(content)))
    if damage == "an array":
        with open(path, "wb") as file:
            np.save(file, np.eye(3))
    again = SCENE.deformer(cache=tmp_path).solve(TARGETS)
    assert len(counted) == 2
    assert_array_equal(again.vertices, sound.vertices)


def test_a_folder_that_cannot_be_made_is_done_without(tmp_path):
    (tmp_path / "file").write_text("in the way")
    solution = SCENE.deformer(cache=tmp_path / "file" / "folder").solve(TARGETS)
    assert abs(solution.volume_change) < 1e-12


def test_cancelled_leaves_nothing_behind(tmp_path):
    def stop(fraction, message):
        if fraction > 0.3:
            raise Cancelled

    with pytest.raises(Cancelled):
        SCENE.deformer(cache=tmp_path, progress=stop)
    assert not list(tmp_path.iterdir())


def test_what_was_not_used_for_longest_goes_first(tmp_path, monkeypatch):
    kept = {}
    for k, stretch in enumerate([1.0, 2.0, 3.0]):
        SCENE.deformer(cache=tmp_path, stretch=stretch)
        (kept[stretch],) = set(tmp_path.iterdir()) - set(kept.values())
        os.utime(kept[stretch], (1e9 + k, 1e9 + k))
    SCENE.deformer(cache=tmp_path, stretch=1.0)  # used again
    monkeypatch.setattr(binding_cache, "_MOST", int(3.5 * kept[1.0].stat().st_size))
    SCENE.deformer(cache=tmp_path, stretch=4.0)
    assert [path.exists() for path in kept.values()] == [True, False, True]


def test_a_session_over_a_large_mesh_keeps_its_binding(tmp_path, counted, monkeypatch):
    monkeypatch.setenv("SEGDEFORM_CACHE", str(tmp_path))
    monkeypatch.setattr(pose_solver, "_CACHED_SIZE", 100)
    for _ in range(2):
        session = Session(SCENE.mesh)
        session.set_regions(SCENE.regions)
        session.set_cages(SCENE.cages)
        session.bind()
    assert len(counted) == 1


posix = pytest.mark.skipif(os.name != "posix", reason="links, pipes and owners of files")


def bound_in(folder, **options):
    """Return the only file that a deformer writes to an empty folder."""
    before = set(folder.iterdir())
    SCENE.deformer(cache=folder, **options)
    (path,) = set(folder.iterdir()) - before
    return path


def exchanged(path):
    """Replace the file by the binding of another mesh, or of other options."""
    bound_in(path.parent, stretch=9.0).replace(path)


def linked(path):
    """Replace the file by a link to the same content."""
    path.rename(path.with_name("elsewhere"))
    path.symlink_to("elsewhere")


def piped(path):
    """Replace the file by a pipe that is never written to."""
    path.unlink()
    os.mkfifo(path)


def in_a_folder(path):
    """Replace the file by a folder."""
    path.unlink()
    path.mkdir()


def given_away(path):
    """Change the owner of the file."""
    if os.geteuid() != 0:
        pytest.skip("only root gives files away")
    os.chown(path, 12345, 12345)


@posix
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (exchanged, "was renamed"), (linked, "a link|symbolic links"),
        (piped, "a device or a pipe"), (in_a_folder, "a folder"), (given_away, "another user's"),
    ],
)  # fmt: skip
def test_a_binding_that_does_not_match_its_name_is_ignored_with_one_warning(
    tmp_path, counted, caplog, change, says
):
    path = bound_in(tmp_path)
    sound = SCENE.deformer().solve(TARGETS)
    change(path)
    before = os.lstat(path)
    counted.clear()
    caplog.clear()
    again = SCENE.deformer(cache=tmp_path).solve(TARGETS)
    assert len(counted) == 1
    assert_array_equal(again.vertices, sound.vertices)
    said = [record.getMessage() for record in caplog.records]
    assert re.search(says, said[0])
    assert path.name in said[0]
    if change is exchanged:  # the own file, written again under its name by now
        SCENE.deformer(cache=tmp_path)
        assert len(counted) == 1
    else:
        assert os.path.samestat(os.lstat(path), before)
    caplog.clear()
    SCENE.deformer(cache=tmp_path)
    assert caplog.records == []


def test_a_file_that_is_replaced_while_it_is_read_is_ignored(tmp_path, counted, monkeypatch):
    path = bound_in(tmp_path)
    other = bound_in(tmp_path, stretch=9.0)
    whole = binding_cache.in_parallel

    def parallel(*arguments):
        os.replace(other, path)
        whole(*arguments)

    monkeypatch.setattr(binding_cache, "in_parallel", parallel)
    assert binding_cache.Binding.read(path, SCENE.mesh.n_vertices) is None


@posix
def test_making_room_deletes_only_our_own_bindings(tmp_path, monkeypatch):
    theirs = ["my.bound.npz", "0" * 39 + ".bound.npz", "precious.npz", ".bound.npz"]
    for name in theirs:
        (tmp_path / name).write_text("mine")
    (tmp_path / ("1" * 40 + ".bound.npz")).symlink_to("precious.npz")
    os.mkfifo(tmp_path / ("2" * 40 + ".bound.npz"))
    (tmp_path / ("3" * 40 + ".bound.npz")).mkdir()
    before = set(os.listdir(tmp_path))
    monkeypatch.setattr(binding_cache, "_MOST", 0)
    SCENE.deformer(cache=tmp_path)
    assert set(os.listdir(tmp_path)) == before


@posix
def test_a_binding_that_cannot_be_written_is_logged_and_not_required(tmp_path, caplog):
    (tmp_path / "file").write_text("in the way")
    for _ in range(2):
        SCENE.deformer(cache=tmp_path / "file" / "folder")
    (said,) = [record.getMessage() for record in caplog.records if "written" in record.getMessage()]
    assert "not written, " in said
