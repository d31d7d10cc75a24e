"""A binding is computed once and then read from the cache, if its inputs are the same."""

from __future__ import annotations

import os
import re
from typing import ClassVar

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_array_equal
from scenes import sausage
from solids import icosphere, together

from vtk_segdeform import Deformer, Mesh, Regions, sizes
from vtk_segdeform.cages.cage import Cage
from vtk_segdeform.cages.fit import fit_cage
from vtk_segdeform.deformer import binding, binding_cache
from vtk_segdeform.errors import Cancelled

SCENE = sausage(2, is_coarse=True)
TARGETS = SCENE.turned(20)


@pytest.fixture
def counted(monkeypatch):
    """Count how often W~ is computed."""
    calls = []
    plain = binding.cage_subspace

    def cage_subspace(*arguments, **options):
        calls.append(1)
        return plain(*arguments, **options)

    monkeypatch.setattr(binding, "cage_subspace", cage_subspace)
    return calls


@pytest.mark.parametrize("large", [250, 10**9])  # with a coarse volume, and without
def test_a_cached_binding_gives_the_same_pose_bit_for_bit(tmp_path, counted, monkeypatch, large):
    monkeypatch.setattr(sizes, "COARSE_VOLUME", large)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 175)
    first = SCENE.deformer(cache=tmp_path).solve(TARGETS)
    assert len(counted) == 1
    again = SCENE.deformer(cache=tmp_path).solve(TARGETS)
    assert len(counted) == 1
    assert_array_equal(again.vertices, first.vertices)
    assert len(list(tmp_path.iterdir())) == 1
    coarse = SCENE.deformer(cache=tmp_path)._problem.binding.coarse_volume
    assert (coarse.cells is not None) == (large == 250)


def with_a_vertex_moved():
    vertices = np.array(SCENE.mesh.vertices)
    vertices[5] *= 1.0 + 1e-15
    return Mesh(vertices, SCENE.mesh.faces)


OTHERS = {
    "mesh": lambda cache: Deformer(
        mesh := with_a_vertex_moved(),
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
    "regions": lambda cache: Deformer(SCENE.mesh, SCENE.regions.grow(1), SCENE.cages, cache=cache),
    "stretch": lambda cache: SCENE.deformer(cache=cache, stretch=9.0),
    "groups": lambda cache: SCENE.deformer(cache=cache, rotation_groups=50),
}


@pytest.mark.parametrize("other", OTHERS)
def test_other_inputs_give_another_binding(tmp_path, counted, other):
    SCENE.deformer(cache=tmp_path)
    OTHERS[other](tmp_path)
    assert len(counted) == 2


def test_options_that_binding_does_not_depend_on_find_the_same(tmp_path, counted):
    SCENE.deformer(cache=tmp_path)
    SCENE.deformer(cache=tmp_path, preserve_volume=False, tolerance=1e-3)
    assert len(counted) == 1


@pytest.mark.parametrize(
    "damage",
    every(2, ["cut", "empty", "flipped", "other", "an array", "encrypted", "header", "compressed"]),
)
def test_a_damaged_file_is_ignored(tmp_path, counted, damage):
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


def test_a_cancelled_binding_leaves_no_file(tmp_path):
    def stop(fraction, message):
        if fraction > 0.3:
            raise Cancelled

    with pytest.raises(Cancelled):
        SCENE.deformer(cache=tmp_path, progress=stop)
    assert not list(tmp_path.iterdir())


def test_the_binding_unused_for_longest_is_deleted_first(tmp_path, monkeypatch):
    kept = {}
    for k, stretch in enumerate([1.0, 2.0, 3.0]):
        SCENE.deformer(cache=tmp_path, stretch=stretch)
        (kept[stretch],) = set(tmp_path.iterdir()) - set(kept.values())
        os.utime(kept[stretch], (1e9 + k, 1e9 + k))
    SCENE.deformer(cache=tmp_path, stretch=1.0)  # used again
    monkeypatch.setattr(binding_cache, "_MOST", int(3.5 * kept[1.0].stat().st_size))
    SCENE.deformer(cache=tmp_path, stretch=4.0)
    assert [path.exists() for path in kept.values()] == [True, False, True]


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
    assert binding_cache.read_binding(path, SCENE.mesh.vertices) is None


@posix
def test_making_room_deletes_only_our_own_bindings(tmp_path, monkeypatch):
    theirs = ["my.binding.npz", "0" * 39 + ".binding.npz", "precious.npz", ".binding.npz"]
    for name in theirs:
        (tmp_path / name).write_text("mine")
    (tmp_path / ("1" * 40 + ".binding.npz")).symlink_to("precious.npz")
    os.mkfifo(tmp_path / ("2" * 40 + ".binding.npz"))
    (tmp_path / ("3" * 40 + ".binding.npz")).mkdir()
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


def test_shares_of_clusters_follow_the_cage_vertices_of_regions_in_each_component():
    mesh = Mesh(*together(icosphere(2), (icosphere(2)[0] + 5.0, icosphere(2)[1])))
    regions = Regions.from_labels(mesh, (mesh.vertices[:, 0] > 0.5).astype(int))
    numbers = zip(regions.membership, (20, 60), strict=True)
    cages = [fit_cage(mesh, members, n) for members, n in numbers]
    inputs = binding.BindingInputs(mesh, regions, cages, np.empty((80, 3)), 1.0, 300)
    part, label = inputs.parts, regions.labels
    for k in np.unique(part):
        region = label[part == k][0]
        within = (part == k).sum() / (label == region).sum()
        assert inputs.shares[k] == pytest.approx((20, 60)[region] * within)


def test_no_rotation_cluster_spans_two_bodies_or_regions():
    mesh = Mesh(*together(icosphere(2), (icosphere(2)[0] * 0.9 + [1.2, 0.0, 2.1], icosphere(2)[1])))
    regions = Regions.from_labels(mesh, (mesh.vertices[:, 2] > 2.0).astype(int), overlap=2)
    ball, cage_faces = icosphere(1)
    cages = [
        Cage(r * ball + at, cage_faces) for r, at in ((3.5, [0.6, 0, 0.9]), (2.5, [1.2, 0, 2.4]))
    ]
    rest_cages = np.concatenate([cage.vertices for cage in cages])
    inputs = binding.BindingInputs(mesh, regions, cages, rest_cages, 1.0, 8)
    assert len(np.unique(inputs.parts)) == 3
    clusters = inputs.clusters
    assert len(np.unique(clusters)) == 8
    for k in range(8):
        assert len(np.unique(inputs.parts[clusters == k])) == 1


class Trap:
    """Its unpickling would leave a trace."""

    sprung: ClassVar[list[int]] = []

    def __reduce__(self):
        return Trap.sprung.append, (1,)


def test_no_file_of_a_binding_is_unpickled(tmp_path, counted):
    path = bound_in(tmp_path)
    with np.load(path) as file:
        arrays = dict(file)
    arrays["quadratic"] = np.array([Trap()], dtype=object)
    with open(path, "wb") as file:
        np.savez(file, allow_pickle=True, **arrays)
    counted.clear()
    SCENE.deformer(cache=tmp_path)
    assert len(counted) == 1
    assert Trap.sprung == []
