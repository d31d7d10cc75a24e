"""Goals for volumes by name: forms, contradictions, bounds, parts and several bodies."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_allclose
from open_meshes import combined
from organs import under_a_lid
from solids import icosphere, rotation

import vtk_segdeform as sd
from vtk_segdeform import sizes
from vtk_segdeform.deformer.volume_goals import VolumeGoal, checked_goals
from vtk_segdeform.errors import ConstraintError
from vtk_segdeform.solver import GaussNewton, Status

EXACT = 1e-12
pytestmark = pytest.mark.usefixtures("bound_once")


def ball(radius: float, x: float = 0.0, stretch: float = 1.0) -> sd.Mesh:
    vertices, faces = icosphere(2)
    return sd.Mesh(radius * vertices * [stretch, 1.0, 1.0] + [x, 0.0, 0.0], faces)


@functools.cache
def hollow() -> sd.Deformer:
    """Return a deformer of a long hollow body, held at one end and pulled at the other."""
    mesh = combined(ball(1.0, stretch=2.0), ball(0.6, stretch=2.0))
    return bound(mesh)


@functools.cache
def three() -> sd.Deformer:
    """Return one of three separate bodies in one cage, the first and the last of them held."""
    return bound(combined(ball(0.9), ball(0.6, 1.8), ball(0.8, 3.6)))


def bound(mesh: sd.Mesh) -> sd.Deformer:
    regions = sd.segment(mesh, 1)
    x = mesh.vertices[:, 0]
    ends = {"fixed": x < np.quantile(x, 0.03), "handle": x > np.quantile(x, 0.97)}
    return sd.Deformer(mesh, regions, sd.fit_cages(mesh, regions, 60), **ends)


def held(deformer: sd.Deformer, **options: object) -> sd.Deformer:
    return deformer.hold(fixed=deformer.fixed, handle=deformer.handle, **options)


def pulled(deformer: sd.Deformer, degrees: float = 30.0) -> np.ndarray:
    x = deformer.mesh.vertices
    return (x[deformer.handle] - x.mean(axis=0)) @ rotation([0, 0, 1], np.radians(degrees)).T + (
        x.mean(axis=0)
    )


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        ("keep", VolumeGoal()), (" Keep ", VolumeGoal()), ("free", None),
        ("40%", VolumeGoal(0.4)),
        ("+10%", VolumeGoal(1.1)), ("-40 %", VolumeGoal(0.6)),
        ("\N{MINUS SIGN}40%", VolumeGoal(0.6)),
        (2.5, VolumeGoal(None, 2.5)), ("2.5", VolumeGoal(None, 2.5)),
        ("1e-3", VolumeGoal(None, 1e-3)),
        (".5", VolumeGoal(None, 0.5)), (np.float64(2), VolumeGoal(None, 2.0)),
        (3, VolumeGoal(None, 3.0)), ("at least 2.5", VolumeGoal(None, 2.5, 1)),
        (">=2.5", VolumeGoal(None, 2.5, 1)), ("at most 110%", VolumeGoal(1.1, 0.0, -1)),
        ("<= -10%", VolumeGoal(0.9, 0.0, -1)), ("at least keep", VolumeGoal(1.0, 0.0, 1)),
    ],
)  # fmt: skip
def test_every_form_of_a_goal(goal, expected):
    found = checked_goals({"whole": goal})["whole"]
    if expected is None:
        assert found is None
        return
    assert (found.share is None, found.bound) == (expected.share is None, expected.bound)
    assert_allclose([found.target(3.0)], [expected.target(3.0)], rtol=1e-15)


@pytest.mark.parametrize(
    ("goal", "says"),
    [
        ("", "must be keep"), ("kept", "must be keep"), ("40%%", "must be keep"),
        (None, "must be keep"),
        ("at least", "must be keep"), ("at most free", "must be keep"), (True, "must be keep"),
        ("1,5", "must be keep"), ("nan", "must be keep"), (np.nan, "must be keep"),
        (np.inf, "must be keep"), ([1.0], "must be keep"), ("0", "must be positive"),
        (-2.0, "must be positive"), ("-100%", "must be positive"), ("-140%", "must be positive"),
        ("1e999", "must be positive"), ("0%", "must be positive"), ("1" * 400, "must be positive"),
    ],
)  # fmt: skip
def test_what_is_no_goal_is_named(goal, says):
    with pytest.raises(ConstraintError, match=f"'the tip'.*{says}"):
        checked_goals({"the tip": goal})


@pytest.mark.parametrize("goals", ["whole", ["whole"], {1: "keep"}, [("whole", "keep")], 3.0])
def test_goals_are_given_by_name(goals):
    with pytest.raises(ConstraintError, match="goals by the names of volumes"):
        checked_goals(goals)


def test_a_name_that_is_unknown_is_refused_with_those_that_there_are():
    says = (
        r"there is no volume 'belly'; there are whole, cavity, wall, component 0, component 1, reg"
    )
    with pytest.raises(ConstraintError, match=says):
        held(hollow(), volumes={"belly": "keep"})
    for name in (
        "body 0 ",
        "body  0",
        "body -1",
        "body 9",
        "region 7",
        "component 99",
        "cavity 1",
        "",
    ):
        with pytest.raises(ConstraintError, match="there is no volume"):
            held(hollow(), volumes={name: "keep"})


@pytest.mark.parametrize(
    ("goals", "says"),
    [
        (
            {"whole": "keep", "wall": "-10%"},
            r"'wall' follows from that of 'whole': it is then [\d.]+, so it cannot be",
        ),
        ({"component 0": "keep", "cavity": "-20%", "whole": "keep"}, "follows from that of"),
        ({"wall": "keep", "whole": "at least 101%"}, "cannot be at least"),
        ({"wall": "keep", "whole": "at most 99%"}, "cannot be at most"),
        (
            {"component 0": "keep", "cavity": "at most 90%", "wall": "at most 102%"},
            r"that of 'component 0' and 'cavity': it is then at least .*, so it cannot be at most",
        ),
    ],
)
def test_goals_that_contradict_each_other_are_named(goals, says):
    with pytest.raises(ConstraintError, match=says):
        held(hollow(), volumes=goals)


def test_the_feasible_volume_that_is_named_is_accepted():
    goals = {"component 0": "+5%", "cavity": "-20%", "whole": "keep"}
    with pytest.raises(ConstraintError) as fault:
        held(hollow(), volumes=goals)
    feasible = float(str(fault.value).split("it is then ")[1].split(",")[0])
    at_rest = hollow().volumes()
    expected = 1.05 * at_rest["component 0"] - 0.8 * at_rest["cavity"]
    assert feasible == pytest.approx(expected, rel=1e-5)  # as printed
    solution = held(hollow(), volumes={**goals, "whole": expected}).solve(pulled(hollow()))
    assert solution.volume_error < EXACT


@pytest.mark.parametrize(
    "goals",
    [
        {"cavity": "-40%", "wall": "keep"},
        {"cavity": "+25%", "component 0": "+5%"},
        {"whole": "at least 90%", "cavity": "60%"},
        {"wall": "keep", "whole": "at most 100%", "cavity": "-5%"},
        {"region 0": "keep", "cavity": "-10%"},
        {"cavity": 2.0},
        {"component 0": "+19%", "cavity": "at most 118%"},
        {"component 0": "keep", "cavity": "at most 90%", "wall": "at least 105%"},
    ],
)
def test_volumes_are_those_of_their_goals(goals):
    deformer = held(hollow(), volumes=goals)
    solution = deformer.solve(pulled(deformer))
    at_rest, now = hollow().volumes(), hollow().volumes(solution.vertices)
    for name, goal in checked_goals(goals).items():
        target, share = goal.target(at_rest[name]), now[name] / goal.target(at_rest[name])
        if not goal.bound:
            assert_allclose([now[name]], [target], rtol=EXACT)
        assert goal.bound * (1.0 - share) < EXACT
    assert solution.volume_error < EXACT
    assert str(solution.status) == "converged"
    assert not len(solution.crossings())
    finished = deformer.finish(solution)
    assert finished.volume_error < EXACT
    assert finished.handle_error < EXACT
    for name, volume in finished.volumes.items():
        assert_allclose([volume], [hollow().volumes(finished.vertices)[name]], rtol=EXACT)
        assert_allclose([finished.volume_changes[name]], [volume / at_rest[name] - 1], atol=EXACT)


@pytest.mark.parametrize("goal", ["+5%", "50%", "1e999", "high", "at most -5%", None, np.nan])
def test_a_centroid_has_coordinates_as_goals(goal):
    with pytest.raises(ConstraintError, match="'centroid x of cavity' must be keep"):
        checked_goals({"centroid x of cavity": goal})
    assert checked_goals({"centroid x": "-1.5"})["centroid x"] == VolumeGoal(None, -1.5)
    with pytest.raises(ConstraintError, match="must be positive"):
        checked_goals({"area": "-1.5"})
    with pytest.raises(ConstraintError, match="there is no volume 'centroid w'"):
        held(hollow(), volumes={"centroid w": "keep"})


def area_and_centroid(x: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the area, and the centroid of what is enclosed."""
    a, b, c = x[faces.T]
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return np.append(area, volume @ (a + b + c) / volume.sum() / 4.0)


PLACED = [
    {"centroid y": 0.1, "whole": "+5%"},
    {"centroid y": "at most 0.05", "wall": "keep"},
]


@pytest.mark.parametrize(
    ("goals", "offset"),
    [
        ({"area": "keep", "whole": "keep"}, 0.0),
        ({"area of component 0": "+4%", "cavity": "-10%"}, 0.0),
        ({"centroid y": "keep", "centroid z": "keep", "whole": "keep"}, 0.0),
        ({"centroid y of body 0": "at least -3"}, 0.0),
        *every(2, ((goals, offset) for goals in PLACED for offset in (0.0, 2000.0))),
    ],
)
def test_areas_and_centroids_are_those_of_their_goals(goals, offset):
    near = hollow().mesh
    mesh = near.with_vertices(near.vertices + [0.0, offset, 0.0])
    goals = {
        name: goal + offset if isinstance(goal, float) else goal.replace("0.05", f"{0.05 + offset}")
        for name, goal in goals.items()
    }
    deformer = bound(mesh).hold(fixed=hollow().fixed, handle=hollow().handle, volumes=goals)
    targets = pulled(hollow()) + [0.0, offset, 0.0]
    outer = mesh.faces[mesh.components[mesh.faces[:, 0]] == 0]
    inner = mesh.faces[mesh.components[mesh.faces[:, 0]] == 1]
    parts = {"whole": mesh.faces, "component 0": outer, "cavity": inner, "body 0": mesh.faces}
    solution = deformer.solve(targets)
    for pose in (solution, deformer.finish(solution)):
        assert pose.volume_error < (EXACT if not offset else 1e-10)
        assert str(pose.status) == "converged"
        for name, goal in checked_goals(goals).items():
            if not name.startswith(("area", "centroid")):
                continue
            faces = parts[name.partition(" of ")[2] or "whole"]
            rest, now = (
                area_and_centroid(x - [0.0, offset, 0.0], faces)
                for x in (mesh.vertices, pose.vertices)
            )
            at = 0 if name.startswith("area") else 1 + "xyz".index(name[9])
            shift = offset if at == 2 else 0.0
            assert pose.volumes[name] == pytest.approx(now[at] + shift, rel=1e-10, abs=1e-9)
            target = goal.target(rest[at] + shift) - shift
            assert goal.bound or now[at] == pytest.approx(target, rel=1e-10, abs=1e-9)
            assert goal.bound * (target - now[at]) < 1e-9


@pytest.mark.campaign  # takes 2 to 4 s each
@pytest.mark.parametrize("goals", [{"area": "2%"}, {"area": "30%", "whole": "keep"}])
def test_an_area_that_cannot_be_reached_is_told_and_leads_nowhere_far(goals):
    mesh = ball(1.0, stretch=2.0)
    deformer = bound(mesh)
    solution = held(deformer, volumes=goals).solve(pulled(deformer))
    assert solution.volume_error > 0.1
    assert solution.status is Status.VOLUME_MISSED
    assert np.abs(solution.vertices).max() < 2.0 * mesh.diagonal


def test_a_bound_holds_exactly_if_it_is_active_and_changes_nothing_if_not():
    free = held(hollow(), volumes={"whole": "free"})
    targets = pulled(free)
    targets[:, 0] += 0.4
    at_rest = free.volumes()["wall"]
    share = free.volumes(free.solve(targets).vertices)["wall"] / at_rest
    assert abs(share - 1.0) > 1e-3
    loose, tight = 100.0 * np.array([share * 0.98, (share + 0.005)])
    slack = held(hollow(), volumes={"wall": f"at least {loose}%"})
    slack = slack.solve(targets)
    assert_allclose(slack.vertices, free.solve(targets).vertices, atol=1e-4)  # both converged
    active = held(hollow(), volumes={"wall": f"at least {tight}%"}).solve(targets)
    assert active.volume_changes["wall"] == pytest.approx(tight / 100.0 - 1.0, abs=EXACT)
    equal = held(hollow(), volumes={"wall": f"{tight}%"}).solve(targets)
    assert active.volume_error < EXACT
    assert_allclose(equal.volumes["wall"], active.volumes["wall"], rtol=EXACT)


def test_a_bound_is_released_when_the_pose_returns():
    deformer = held(hollow(), volumes={"wall": "at most keep"})
    there = pulled(deformer)
    there[:, 0] += 0.5
    x = deformer.mesh.vertices
    bent = deformer.solve(there)
    assert bent.volume_error < EXACT
    back = deformer.solve(x[deformer.handle])
    assert back.volume_error < EXACT
    assert np.abs(back.vertices - x).max() < 1e-3


def test_a_bound_holds_in_the_finish_that_would_pass_it():
    free = held(hollow(), volumes={"whole": "free"})
    solution = free.solve(pulled(free, 60.0))
    at_rest = free.volumes()["wall"]
    poses = solution.vertices, free.finish(solution).vertices
    before, after = (free.volumes(x)["wall"] / at_rest for x in poses)
    assert abs(after - before) > 1e-3
    between = f"{50.0 * (before + after)}%"
    bound = f"at {'most' if after > before else 'least'} {between}"
    deformer = held(hollow(), volumes={"wall": bound})
    solution = deformer.solve(pulled(deformer, 60.0))
    assert_allclose(solution.vertices, poses[0], atol=1e-4)  # both converged
    finished = deformer.finish(solution)
    assert finished.is_finished
    assert finished.volume_error < EXACT
    share = 1.0 + finished.volume_changes["wall"]
    assert_allclose(share, (before + after) / 2.0, rtol=EXACT)


def test_parts_have_volumes_under_lids():
    """Half of the outer shell, under a lid, and one that is no set of vertices."""
    mesh = hollow().mesh
    half = (mesh.vertices[:, 0] > 0.3) & (mesh.components == 0)
    regions, cages = hollow().regions, hollow().cages
    end = (mesh.vertices[:, 0] < -0.3) & (mesh.components == 0)
    deformer = sd.Deformer(
        mesh, regions, cages, fixed=hollow().fixed, handle=hollow().handle,
        parts={"tip": half, "end": np.flatnonzero(end)},
        volumes={"tip": "+15%", "whole": "keep", "end": "-5%"},
    )  # fmt: skip
    assert deformer.volume_names[-2:] == ("tip", "end")
    solution = deformer.solve(pulled(deformer))
    assert solution.volume_error < EXACT
    for name, mask, share in [("tip", half, 1.15), ("end", end, 0.95)]:
        volumes = [under_a_lid(mesh, mask, x) for x in (mesh.vertices, solution.vertices)]
        assert_allclose(volumes[1] / volumes[0], share, rtol=EXACT)
        assert_allclose(deformer.volumes()[name], volumes[0], rtol=EXACT)
    for ids in ([mesh.n_vertices], np.ones(3, dtype=bool), "tip"):
        with pytest.raises(ConstraintError, match="parts\\['tip'\\]"):
            sd.Deformer(mesh, regions, cages, parts={"tip": ids})


def test_the_whole_of_several_bodies_leaves_each_of_them_free():
    """By default every body keeps its volume; with a goal for the whole only their sum."""
    names = three().volume_names
    assert names[:4] == ("whole", "body 0", "body 1", "body 2")
    at_rest = np.array([three().volumes()[name] for name in names[1:4]])
    each = three().solve(pulled(three()))
    now = np.array([three().volumes(each.vertices)[name] for name in names[1:4]])
    assert_allclose(now, at_rest, rtol=EXACT)
    assert each.volumes == {}
    whole = held(three(), volumes={"whole": "keep"}).solve(pulled(three()))
    now = np.array([three().volumes(whole.vertices)[name] for name in names[1:4]])
    assert_allclose(now.sum(), at_rest.sum(), rtol=EXACT)
    assert np.abs(now / at_rest - 1.0).max() > 1e-6
    one = held(three(), volumes={"body 1": "+20%", "whole": "keep"}).solve(pulled(three()))
    now = np.array([three().volumes(one.vertices)[name] for name in names[1:4]])
    assert_allclose([now[1], now.sum()], [1.2 * at_rest[1], at_rest.sum()], rtol=EXACT)
    alone = held(three(), volumes={"body 1": "+20%"}).solve(pulled(three()))
    now = np.array([three().volumes(alone.vertices)[name] for name in names[1:4]])
    assert_allclose(now, at_rest * [1.0, 1.2, 1.0], rtol=EXACT)


def test_a_volume_that_cannot_be_reached_is_told():
    """Rounding of the coordinates changes so small a cavity by more than the error allowed."""
    deformer = hollow().hold(volumes={"cavity": 1e-11})
    solution = deformer.solve(np.empty((0, 3)))
    assert solution.volume_error > 1e-9
    assert solution.status is Status.VOLUME_MISSED
    assert "a volume cannot be reached" in str(solution.status)


def test_a_volume_in_another_unit_is_told_soon(monkeypatch):
    """Where cages can no longer follow, the legs of 5 % that are left are not gone through."""
    legs, minimise = [], GaussNewton.minimise
    counted = lambda *given: legs.append(None) or minimise(*given)  # noqa: E731
    monkeypatch.setattr(GaussNewton, "minimise", counted)
    solution = hollow().hold(volumes={"cavity": 1e9}).solve(np.empty((0, 3)))
    assert solution.status is Status.VOLUME_MISSED
    assert len(legs) < 100  # of 400
    assert np.isfinite(solution.vertices).all()


@pytest.mark.parametrize("goals", [{"cavity": "-20%", "wall": "keep"}, {"whole": "+30%"}])
def test_a_pull_reaches_its_target_while_volumes_change(goals):
    mesh = hollow().mesh
    tip = int(mesh.vertices[:, 0].argmax())
    to = mesh.vertices[tip] + [0.1, 0.3, 0.0]
    solution = sd.pull(mesh, tip, to, volumes=goals, n_regions=1, n_cage_vertices=60)
    assert solution.handle_error < 1e-4
    assert solution.volume_error < EXACT
    assert solution.status is Status.CONVERGED


def test_a_part_that_grows_leaves_the_rest_in_its_place_and_with_its_volume():
    scene = hollow()
    outer = scene.mesh.components == 0
    half = outer & (scene.mesh.vertices[:, 0] > 0.3)
    free = sd.Deformer(scene.mesh, scene.regions, scene.cages, parts={"tip": half})
    far = scene.mesh.vertices[:, 0] < -0.3
    moved, size = {}, scene.mesh.diagonal
    for kept in ({}, {"whole": "keep"}):
        solution = free.hold(volumes={"tip": "+20%", **kept}).solve(np.empty((0, 3)))
        assert solution.volume_error < EXACT
        moved[len(kept)] = np.linalg.norm(solution.vertices - scene.mesh.vertices, axis=1)
        before, after = (free.volumes(x) for x in (None, solution.vertices))
        gain = 0.0 if kept else 0.2 * before["tip"]
        assert_allclose(after["whole"], before["whole"] + gain, rtol=EXACT)
    assert moved[0][far].max() < 1e-3 * size < 1e-2 * size < moved[0][half].max()
    assert moved[1][far].max() > 5e-3 * size


def test_only_the_body_of_a_part_gains_what_the_part_does():
    mesh = three().mesh
    tip = (mesh.vertices[:, 0] > 3.6) & (mesh.components == mesh.components.max())
    deformer = sd.Deformer(mesh, three().regions, three().cages, parts={"tip": tip})
    solution = deformer.hold(volumes={"tip": "+20%"}).solve(np.empty((0, 3)))
    before, after = (deformer.volumes(x) for x in (None, solution.vertices))
    gains = {name: after[name] - before[name] for name in ("tip", "body 0", "body 1", "body 2")}
    far = int(np.argmax([abs(gains[f"body {k}"]) for k in range(3)]))
    assert_allclose([gains.pop(f"body {far}"), gains.pop("tip")], 0.2 * before["tip"], rtol=1e-9)
    assert_allclose(list(gains.values()), 0.0, atol=EXACT)


def test_a_grown_shape_has_the_exact_volumes_also_if_steps_preserve_coarse_ones(monkeypatch):
    monkeypatch.setattr(sizes, "COARSE_VOLUME", 200)
    monkeypatch.setattr(sizes, "COARSE_VOLUME_POINTS", 100)
    vertices, faces = icosphere(3)
    mesh = sd.Mesh(vertices * [2.0, 1.0, 1.0], faces)
    regions, part = sd.segment(mesh, 1), {"tip": mesh.vertices[:, 0] > 0.3}
    free = sd.Deformer(mesh, regions, sd.fit_cages(mesh, regions, 60), parts=part)
    constraints = free.hold(volumes={"tip": "+20%"})._constraints
    x = constraints.problem.map(constraints.rest_cages)
    assert np.abs(constraints.preserved.constraints.relative(x)).max() < 1e-5
