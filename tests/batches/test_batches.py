"""Batches: the same bytes whatever the workers, and nothing lost or repeated by a kill."""

from __future__ import annotations

import csv
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from limbed import crab, torso

import vtk_segdeform as sd
from vtk_segdeform.batches import run
from vtk_segdeform.batches.store import Writer
from vtk_segdeform.batches.tasks import (
    _stiffened,
    deformer_of,
    packed,
    rigid_deformer_of,
    unpacked,
)
from vtk_segdeform.cages import suggested_size
from vtk_segdeform.errors import ArgumentError, ConstraintError, SegDeformError

BEND = {"fixed": "z<10%", "handles": [{"select": "z>90%", "rotate": "y,20"}]}
RANDOM = {"random": 2, "seed": 7, "degrees": 40.0}


class Here(Executor):
    """Computes each task at once; *fails* tells which poses raise an error."""

    def __init__(self, fails=lambda pose: False):
        self.tasks, self._fails = [], fails

    def submit(self, fn, /, data, poses, settings):
        self.tasks.append(len(poses))
        future = Future()
        if any(map(self._fails, poses)):
            future.set_exception(OSError("no luck"))
        else:
            future.set_result(fn(data, poses, settings))
        return future


@pytest.fixture(scope="module")
def meshes():
    return [torso(2), crab(2)]


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SEGDEFORM_CACHE", str(tmp_path / "cache"))
    deformer_of.cache_clear()


@pytest.fixture(scope="module")
def plan(meshes):
    return {"meshes": meshes, "poses": [BEND, RANDOM], "block": 2, "n_cage_vertices": 40}


@pytest.fixture(scope="module")
def reference(plan, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("reference")
        patch.setenv("SEGDEFORM_CACHE", str(folder / "cache"))
        return sd.batch(plan, folder, executor=Here())


def test_poses_start_from_rest_so_their_order_makes_no_difference(meshes, tmp_path):
    other = {**BEND, "handles": [{"select": "z>90%", "rotate": "y,-30"}]}
    poses, found = [BEND, other, {**RANDOM, "random": 1}], []
    for name in ("forward", "backward"):
        plan = {"meshes": meshes[:1], "poses": poses, "n_cage_vertices": 60}
        store = sd.batch(plan, tmp_path / name, executor=Here())
        found.append({np.concatenate(store.cage_vertices(k)).tobytes() for k in range(3)})
        poses = poses[::-1]
    assert len(found[0]) == 3
    assert found[0] == found[1]


def test_a_pose_is_that_of_a_deformer_at_rest(meshes, tmp_path):
    mesh = meshes[0]
    x = mesh.vertices
    tip = np.flatnonzero(x[:, 2] > 0.9 * np.ptp(x[:, 2]) + x[:, 2].min())
    foot = np.flatnonzero(x[:, 2] < 0.1 * np.ptp(x[:, 2]) + x[:, 2].min())
    plan = {
        "meshes": [mesh],
        "poses": [
            {"fixed": "z<10%", "handles": [{"select": "z>90%", "translate": "0.1,0,0"}]},
            {"fixed": foot, "handle": tip, "targets": x[tip] + [0.1, 0.0, 0.0]},
            {"vertex": int(tip[0]), "to": x[tip[0]] + [0.1, 0.0, 0.0], "pins": foot},
            {"fixed": foot, "volumes": {"whole": "+10%"}},
        ],
    }  # fmt: skip
    store = sd.batch(plan, tmp_path / "out", executor=Here())
    poses = [store.vertices(k) for k in range(4)]
    regions = sd.segment(mesh)
    cages = sd.fit_cages(mesh, regions, suggested_size(regions))
    deformer = sd.Deformer(mesh, regions, cages, fixed=foot, handle=tip)
    expected = deformer.solve(x[tip] + [0.1, 0.0, 0.0])
    for pose in poses[:2]:
        np.testing.assert_allclose(pose, expected.vertices, atol=1e-12)
    pulled = sd.pull(mesh, int(tip[0]), x[tip[0]] + [0.1, 0.0, 0.0], pins=foot)
    np.testing.assert_allclose(poses[2], pulled.vertices, atol=1e-12)
    changes = [deformer.volume("whole", pose)[1] for pose in poses]
    np.testing.assert_allclose(changes, [0.0, 0.0, 0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(store.table()["volume_change"], changes, atol=1e-13)


def test_a_refined_pose_is_stored_with_all_its_vertices(meshes, tmp_path):
    plan = {"meshes": meshes[:1], "poses": [BEND]}
    cages = sd.batch(plan, tmp_path / "cages", executor=Here())
    before = cages.vertices(0)
    store = sd.batch({**plan, "refine": True}, tmp_path / "cages", executor=Here())
    x = store.vertices(0)
    assert np.abs(x - before).max() > 1e-6
    assert store.cage_vertices(0) == ()
    store.write_mesh(0, tmp_path / "pose.ply")
    written = sd.read_mesh(tmp_path / "pose.ply")
    np.testing.assert_allclose(written.vertices, x, atol=1e-12)


def test_a_batch_continues_with_what_is_missing(plan, reference, tmp_path):
    def stop(fraction, text):
        if fraction > 0.3:
            raise sd.Cancelled("enough")

    first, second, third = Here(), Here(), Here()
    with pytest.raises(sd.Cancelled, match="enough"):
        sd.batch(plan, tmp_path / "out", executor=first, n_workers=1, progress=stop)
    done = sum(first.tasks)
    assert 0 < done < 6
    store = sd.batch(plan, tmp_path / "out", executor=second)
    assert sum(second.tasks) == 6 - done
    assert store.digest() == reference.digest()
    more = {**plan, "poses": [*plan["poses"], {**RANDOM, "random": 1, "seed": 8}]}
    store = sd.batch(more, tmp_path / "out", executor=third)
    assert sum(third.tasks) == 2
    assert len(store) == 8
    assert len(sd.batch(plan, tmp_path / "out", executor=Here())) == 6


def test_a_poisonous_pose_is_set_aside_after_two_tries(plan, tmp_path):
    tries = []

    def fails(pose):
        is_poison = pose.get("number") == 1
        tries.append(is_poison)
        return is_poison

    store = sd.batch(plan, tmp_path / "out", executor=Here(fails))
    table = store.table()
    bad = [k for k, status in enumerate(table["status"]) if status == "set aside"]
    assert [table["pose"][k] for k in bad] == ["random 1", "random 1"]
    assert table["message"][bad[0]] == "tried 2 times: OSError: no luck"
    assert sum(tries) == 4
    assert table["status"].count("converged") == 4
    with pytest.raises(ArgumentError, match=f"number {bad[0]} .* set aside"):
        store.vertices(bad[0])
    again, retried = Here(), Here()
    sd.batch(plan, tmp_path / "out", executor=again)
    assert again.tasks == []
    store = sd.batch(plan, tmp_path / "out", executor=retried, retry=True)
    assert sum(retried.tasks) == 2
    assert set(store.table()["status"]) == {"converged"}


def test_a_bad_mesh_or_selection_does_not_stop_the_others(meshes, tmp_path):
    path = tmp_path / "bad.ply"
    path.write_bytes(b"no mesh")
    nothing = {"fixed": "z<-9", "handles": BEND["handles"]}
    plan = {"meshes": [path, meshes[0]], "poses": [BEND, nothing]}
    table = sd.batch(plan, tmp_path / "out", executor=Here()).table()
    assert table["status"] == ["failed", "failed", "converged", "failed"]
    assert "bad.ply" in table["message"][0]
    assert "selects none" in table["message"][3]


def test_a_task_that_takes_too_long_ends_its_process_and_is_set_aside(
    meshes, tmp_path, monkeypatch
):
    monkeypatch.setattr(run, "_MOST_TRIES", 1)  # each starts a process
    plan = {"meshes": meshes[:1], "poses": [BEND], "seconds": 0.01}
    table = sd.batch(plan, tmp_path / "out", n_workers=1).table()
    assert table["status"] == ["set aside"]
    assert "process died" in table["message"][0]


def test_a_pose_that_takes_too_long_is_stopped(meshes, tmp_path):
    plan = {"meshes": meshes[:1], "poses": [BEND, RANDOM], "seconds": 1e-9}
    table = sd.batch(plan, tmp_path / "out", executor=Here()).table()
    assert set(table["status"]) == {"too long"}


@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.campaign)])
def test_a_killed_process_changes_no_byte(count, plan, reference, tmp_path):
    killed = []

    def kill(fraction, text):
        if fraction > 0.1 and not killed:
            killed.append(multiprocessing.active_children()[0])
            killed[0].kill()

    store = sd.batch(plan, tmp_path / "out", n_workers=count, progress=kill)
    assert killed
    assert set(reference.table()["status"]) == {"converged"}
    assert store.digest() == reference.digest()


PROGRAM = """
import signal
import sys
import time
import vtk_segdeform as sd
from limbed import crab, torso

def tell(fraction, text):
    print(f"{fraction:.3f}", flush=True)
    if fraction > 0.1:
        time.sleep(1.0)  # so that it has not ended when the signal comes

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a shell's background
    random = {"random": 2, "seed": 7, "degrees": 40.0}
    bend = {"fixed": "z<10%", "handles": [{"select": "z>90%", "rotate": "y,20"}]}
    meshes = [torso(2), crab(2)]
    plan = {"meshes": meshes, "poses": [bend, random], "block": 2, "n_cage_vertices": 40}
    sd.batch(plan, sys.argv[1], n_workers=1, progress=tell)
"""


@pytest.mark.campaign  # two processes; what is left by a killed one is the same
@pytest.mark.skipif(sys.platform != "linux", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_killed_client_continues(number, plan, reference, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    command = [sys.executable, str(program), str(tmp_path / "out")]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "start_new_session": True}
    paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, **pipes, env={**os.environ, **paths}) as client:
        for line in client.stdout:
            if float(line) > 0.1:
                if number == signal.SIGINT:  # as a terminal sends it, to all processes
                    os.killpg(client.pid, number)
                else:
                    client.kill()
                break
        _, errors = client.communicate(timeout=60)
    assert errors.count(b"Traceback") == (number == signal.SIGINT), errors.decode()
    assert client.returncode != 0
    left = Here()
    store = sd.batch(plan, tmp_path / "out", executor=left)
    assert 0 < sum(left.tasks) < 6
    assert store.digest() == reference.digest()


@pytest.mark.campaign  # which starts five processes; what continues after it is the same
def test_a_killed_worker_of_a_cluster_costs_no_pose(plan, reference, tmp_path):
    distributed = pytest.importorskip("distributed")
    log = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):

        def kill(fraction, text):
            if fraction > 0.1 and not log:
                log.append(next(each.pid for each in cluster.workers.values()))
                os.kill(log[0], signal.SIGKILL)
            log.append(text)

        executor = client.get_executor()
        store = sd.batch(plan, tmp_path / "out", executor=executor, n_workers=2, progress=kill)
    print("\n".join(map(str, log)))
    assert log[-1] == "6 of 6 poses"
    assert store.digest() == reference.digest()


def test_an_executor_has_few_tasks_at_a_time(plan, tmp_path):
    class Slow(Here):
        waiting = most = 0

        def submit(self, fn, /, *task):
            future = Future()
            type(self).waiting += 1
            type(self).most = max(self.most, self.waiting)

            def work():
                time.sleep(0.05)
                type(self).waiting -= 1
                future.set_result(fn(*task))

            threading.Thread(target=work).start()
            return future

    few = {**plan, "poses": [BEND, {**RANDOM, "random": 1}], "block": 1}
    sd.batch(few, tmp_path / "out", executor=Slow(), n_workers=1)
    assert Slow.most == run._AHEAD


def test_what_is_under_way_is_stored_when_the_batch_is_cancelled(plan, tmp_path):
    with ThreadPoolExecutor(1) as pool:

        class Threads(Here):
            def submit(self, fn, /, *task):
                self.tasks.append(len(task[1]))
                return pool.submit(fn, *task)

        def stop(fraction, text):
            if fraction > 0.0:
                raise sd.Cancelled("enough")

        first, left = Threads(), Here()
        with pytest.raises(sd.Cancelled):
            sd.batch(plan, tmp_path, executor=first, n_workers=2, progress=stop)
    sd.batch(plan, tmp_path, executor=left)
    assert sum(first.tasks) > 2
    assert sum(left.tasks) == 6 - sum(first.tasks)


def test_one_batch_at_a_time_writes_a_store(plan, tmp_path):
    writer = Writer(tmp_path)
    writer.name([(0, "a", "b", "c", "d")])
    with pytest.raises(ArgumentError, match="written by another"):
        sd.batch(plan, tmp_path, executor=Here())
    writer.close()
    (tmp_path / "poses.segposes").write_bytes(b"no poses" * 100)
    for call in (lambda: sd.PoseStore(tmp_path), lambda: sd.batch(plan, tmp_path, executor=Here())):
        with pytest.raises(ArgumentError, match=r"poses\.segposes"):
            call()
    with pytest.raises(ArgumentError, match="no file"):
        sd.PoseStore(tmp_path / "elsewhere")


def test_the_table_is_written_with_and_without_pyarrow(reference, monkeypatch):
    columns = reference.table()
    assert columns["number"] == list(range(6))
    assert max(map(abs, columns["volume_change"])) < 1e-12
    assert columns["crossings"] == columns["folds"] == [0] * 6
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    path = reference.write_table()
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["pose"] for row in rows] == columns["pose"]
    assert [float(row["seconds"]) for row in rows] == columns["seconds"]
    monkeypatch.undo()
    pyarrow = pytest.importorskip("pyarrow.parquet")
    table = pyarrow.read_table(reference.write_table())
    assert table.to_pydict() == columns


def test_a_packed_mesh_is_the_same_to_the_bit(meshes):
    mesh = meshes[0]
    regions = sd.segment(mesh)
    cages = sd.fit_cages(mesh, regions)
    again, same, boxes = unpacked(packed(mesh, regions, cages))
    assert same is not None
    for a, b in [(again.vertices, mesh.vertices), (again.faces, mesh.faces)]:
        assert a.tobytes() == b.tobytes()
    assert same.weights.tobytes() == regions.weights.tobytes()
    assert [b.vertices.tobytes() for b in boxes] == [c.vertices.tobytes() for c in cages]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"meshes": []}, "at least one mesh"),
        ({"meshes": ["nothing*.ply"]}, "none called"),
        ({"poses": [{}]}, "must have handles"),
        ({"poses": [{"handel": [1]}]}, "handel"),
        ({"poses": [{"handle": [1]}]}, "'targets' together"),
        ({"poses": [{"vertex": 1}]}, "'to' together"),
        ({"poses": [{"random": 0}]}, "1 to 1,000,000 random"),
        ({"poses": [{"handles": [{"rotate": "y,3"}]}]}, "must have 'select'"),
        ({"seconds": 0.0}, "seconds"),
        ({"block": 0}, "block"),
        ({"memory": "much"}, "memory"),
        ({"pose": []}, "it may have"),
    ],
)
def test_a_bad_plan_is_refused_before_anything_is_computed(plan, change, text, tmp_path):
    with pytest.raises((ArgumentError, ConstraintError), match=text):
        sd.batch({**plan, **change}, tmp_path / "out", executor=Here())
    assert not (tmp_path / "out").exists()


def test_a_bad_plan_file_names_itself(tmp_path):
    path = tmp_path / "plan.json"
    for text in ("{", "[]"):
        path.write_text(text)
        with pytest.raises(SegDeformError, match=r"plan\.json"):
            sd.batch(path, tmp_path / "out")
    assert not Path(tmp_path / "out").exists()


def test_stiffness_slides_and_symmetry_of_a_pose_are_those_of_a_deformer(tmp_path):
    mesh = sd.models.bar(divisions=(2, 2, 10))
    x = mesh.vertices
    z = (x[:, 2] - x[:, 2].min()) / np.ptp(x[:, 2])
    foot, tip = np.flatnonzero(z < 0.1), np.flatnonzero(z > 0.9)
    stiffness = np.where(z > 0.9, np.inf, np.where(z < 0.3, 5.0, 1.0))
    bend = {"handles": [{"select": "z>90%", "translate": "0.2,0,0"}]}
    poses = [
        {**bend, "fixed": "z<10%", "stiffness": {"z<30%": 5, "z>90%": "inf"}, "symmetry": "y"},
        {**bend, "slides": [{"select": "z<10%", "along": "plane", "direction": [0, 0, 1]}]},
        {"vertex": int(tip[0]), "to": x[tip[0]] + [0.2, 0, 0], "stiffness": stiffness},
        {**bend, "fixed": "z<10%"},
    ]
    plan = {"meshes": [mesh], "poses": poses, "n_regions": 2, "block": 1}
    store = sd.batch(plan, tmp_path / "one", executor=Here())
    regions = sd.segment(mesh, 2)
    cages = sd.fit_cages(mesh, regions, suggested_size(regions))
    targets = x[tip] + [0.2, 0.0, 0.0]
    slides = [sd.Slide(foot, "plane", [0, 0, 1])]
    first = sd.Deformer(
        mesh, regions, cages, fixed=foot, handle=tip, stiffness=stiffness, symmetry="y"
    ).solve(targets)
    second = sd.Deformer(mesh, regions, cages, handle=tip, slides=slides).solve(targets)
    third = sd.pull(mesh, int(tip[0]), x[tip[0]] + [0.2, 0, 0], stiffness=stiffness, n_regions=2,
                    refine=False)  # fmt: skip
    for k, expected in enumerate((first, second, third)):
        np.testing.assert_allclose(store.vertices(k), expected.vertices, atol=1e-12)
    assert len(np.concatenate(store.cage_vertices(0))) == len(np.concatenate(first.cage_vertices))
    assert np.abs(store.vertices(0) - store.vertices(3)).max() > 1e-3
    read = [store.vertices(k).tobytes() for k in range(4)]
    for cached in (deformer_of, rigid_deformer_of, _stiffened):
        cached.cache_clear()
    with ThreadPoolExecutor(2) as executor:
        other = sd.batch(plan, tmp_path / "two", executor=executor)
    assert other.digest() == store.digest()
    assert [other.vertices(k).tobytes() for k in reversed(range(4))] == read[::-1]
    refined = sd.batch({**plan, "poses": poses[:1], "refine": True}, tmp_path, executor=Here())
    assert len(refined.vertices(0)) == mesh.n_vertices


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ({"stiffness": {"z<10%": "hard"}}, r"stiffness of .*\[0\].*'hard' for 'z<10%'"),
        ({"stiffness": {"z<10%": -1}}, "-1 for 'z<10%'"),
        ({"slides": [{"along": "plane"}]}, "a slide of .* must have 'select'"),
        ({"slides": [{"select": "z<1", "on": 1}]}, "a slide of .* has 'on'"),
    ],
)
def test_shapes_of_a_plan_that_are_none_are_refused(pose, message, meshes, tmp_path):
    with pytest.raises(SegDeformError, match=message):
        sd.batch({"meshes": meshes, "poses": [{**BEND, **pose}]}, tmp_path, executor=Here())


def test_a_pose_that_asks_for_another_symmetry_or_shape_fails_by_itself(meshes, tmp_path):
    slide = {"select": "z<10%", "along": "path"}
    wrong = {"symmetry": "y"}, {"symmetry": "w"}, {"stiffness": [1.0, 2.0]}
    wrong = *wrong, {"stiffness": {"z>200%": 2}}, {"slides": [slide]}
    poses = [{**BEND, **each} for each in wrong]
    store = sd.batch({"meshes": meshes[:1], "poses": poses}, tmp_path, executor=Here())
    assert store.table()["status"] == ["failed"] * 5
    words = ["not symmetric", "symmetry must be", "stiffness must be", "z>200%", "along a"]
    for text, word in zip(store.table()["message"], words, strict=True):
        assert word in text, text
