"""Bodies fitted to landmarks are grown where they grow and bent where they bend."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vtk_segdeform import models
from vtk_segdeform.errors import ArgumentError, Cancelled, ConstraintError
from vtk_segdeform.landmarks import Spline, fit_landmarks
from vtk_segdeform.landmarks import fit as fitting
from vtk_segdeform.mesh import Mesh

BAR = models.bar(divisions=(3, 3, 16))
X = BAR.vertices
SPREAD = np.random.default_rng(3).permutation(len(X))
OPTIONS = {"n_regions": 1, "n_cage_vertices": 40}
LENGTH = np.ptp(X[:, 2])
pytestmark = pytest.mark.usefixtures("bound_once")


def bent(degrees: float, x=X) -> np.ndarray:
    """Return the bar bent to an arc, its middle line as long as before."""
    t = np.deg2rad(degrees) * (x[:, 2] - X[:, 2].min()) / LENGTH
    radius = LENGTH / np.deg2rad(degrees)
    inward = radius - x[:, 0]
    return np.stack([radius - inward * np.cos(t), x[:, 1], inward * np.sin(t)], axis=1)


def grown(x=X) -> np.ndarray:
    """Return the bar after a smooth growth, which differs along it and across it."""
    t = (x[:, 2:] - X[:, 2].min()) / LENGTH
    return x * [1.3, 0.9, 1.2] + 0.3 * t**2 * [0.0, 0.0, LENGTH] + 0.2 * t * x * [1.0, 1.0, 0.0]


def off(fit, truth) -> float:
    return float(np.sqrt(((fit.vertices - truth) ** 2).sum(axis=1).mean()))


def off_spline(ids, truth) -> float:
    found = Spline(X[ids], np.zeros(len(ids))).at(X, truth[ids])
    return float(np.sqrt(((found - truth) ** 2).sum(axis=1).mean()))


def test_a_bar_that_bends_is_nearer_to_the_truth_than_by_a_spline():
    truth, ids = bent(120.0), SPREAD[:16]
    fit = fit_landmarks(BAR, X[ids], truth[ids], **OPTIONS)
    assert fit.stiffness > 0.0
    assert off(fit, truth) < 0.5 * off_spline(ids, truth)
    assert np.nanmean(fit.left_out) < np.nanmean(fit.left_out_spline)
    assert_allclose(fit.residuals, 0.0, atol=1e-9)


def test_a_bar_that_grows_is_as_near_to_the_truth_as_by_a_spline():
    truth, ids = grown(), SPREAD[:16]
    fit = fit_landmarks(BAR, X[ids], truth[ids], **OPTIONS)
    assert off(fit, truth) < 1.02 * off_spline(ids, truth)


def test_a_bar_that_grows_and_bends_is_nearer_than_either_explanation():
    truth, ids = bent(120.0, X * [1.2, 1.2, 1.0]), SPREAD[:16]
    fit = fit_landmarks(BAR, X[ids], truth[ids], **OPTIONS)
    assert off(fit, truth) < 0.6 * off_spline(ids, truth)


def test_the_unit_and_the_place_of_targets_do_not_matter():
    truth, ids = bent(60.0), SPREAD[:12]
    one = fit_landmarks(BAR, X[ids], truth[ids], **OPTIONS)
    turn = Rotation.from_euler("zyx", [130, 40, -70], degrees=True)

    def there(x):
        return 1000.0 * turn.apply(x) + [50.0, 60.0, -7e3]

    other = fit_landmarks(BAR, X[ids], there(truth[ids]), **OPTIONS)
    assert other.stiffness == one.stiffness
    assert_allclose(other.vertices, there(one.vertices), atol=1e-6 * 1000.0 * LENGTH)
    assert_allclose(other.left_out, 1000.0 * one.left_out, rtol=1e-6)


def test_what_is_carried_moves_with_the_vertices_and_stays_inside():
    truth, ids = bent(90.0), SPREAD[:16]
    for volume in ("free", "keep"):
        fit = fit_landmarks(BAR, X[ids], truth[ids], volume=volume, **OPTIONS)
        assert_allclose(fit.moved(X[::9]), fit.vertices[::9], atol=1e-9)
    line = np.zeros((5, 3))
    line[:, 2] = np.linspace(0.2, 0.8, 5) * LENGTH + X[:, 2].min()
    assert_allclose(fit.moved(line), bent(90.0, line), atol=0.03 * LENGTH)


@pytest.mark.parametrize(("volume", "share"), [("keep", 0.0), ("-15%", -0.15)])
def test_a_volume_that_is_set_is_exact_and_landmarks_are_met(volume, share):
    truth, ids = grown(), SPREAD[:16]
    fit = fit_landmarks(BAR, X[ids], truth[ids], volume=volume, **OPTIONS)
    assert fit.volume_change == pytest.approx(share, abs=1e-9)
    assert np.abs(fit.residuals).max() < 1e-3 * LENGTH


def test_uncertain_landmarks_are_followed_as_far_as_they_are_known():
    truth, ids = grown(), SPREAD[:80]
    sigma = 0.02 * LENGTH
    noisy = truth[ids] + np.random.default_rng(0).normal(0.0, sigma, (len(ids), 3))
    known = fit_landmarks(BAR, X[ids], noisy, uncertainty=sigma, **OPTIONS)
    trusted = fit_landmarks(BAR, X[ids], noisy, **OPTIONS)
    assert off(known, truth) < 0.6 * off(trusted, truth)
    assert np.sqrt(np.mean(known.residuals**2)) == pytest.approx(sigma, rel=0.15)
    some = np.where(np.arange(len(ids)) < 10, 0.0, sigma)
    mixed = fit_landmarks(BAR, X[ids], noisy, uncertainty=some, **OPTIONS)
    assert np.abs(mixed.residuals[:10]).max() < 1e-9 < np.abs(mixed.residuals[10:]).max()


@pytest.fixture
def few_centres(monkeypatch):
    """Let splines have at most 40 centres; as many landmarks as their 200 take seconds."""
    monkeypatch.setattr(fitting, "CENTRES", 40)


@pytest.mark.usefixtures("few_centres")
def test_more_landmarks_than_centres_are_met_too():
    truth, ids = bent(90.0), SPREAD[:60]
    fit = fit_landmarks(BAR, X[ids], truth[ids], **OPTIONS)
    assert_allclose(fit.residuals, 0.0, atol=1e-7)
    assert np.isnan(fit.left_out).sum() == 20
    some = fit_landmarks(BAR, X[ids[:40]], truth[ids[:40]], **OPTIONS)
    assert off(fit, truth) < off(some, truth)


@pytest.mark.usefixtures("few_centres")
def test_many_uncertain_landmarks_are_followed_no_further_either():
    truth, ids = grown(), SPREAD[:100]
    sigma = 0.02 * LENGTH
    noisy = truth[ids] + np.random.default_rng(0).normal(0.0, sigma, (len(ids), 3))

    def error(unit, sigma):
        fit = fit_landmarks(BAR, X[ids], unit * noisy, uncertainty=unit * sigma, **OPTIONS)
        return off(fit, unit * truth) / unit

    followed = error(1.0, sigma)
    assert followed < 0.5 * error(1.0, 0.0)
    assert error(1000.0, sigma) == pytest.approx(followed, rel=1e-6)


def test_landmarks_in_a_plane_at_one_place_or_few_are_enough():
    plane = SPREAD[X[SPREAD, 1] == X[:, 1].max()][:8]
    fit = fit_landmarks(BAR, X[plane], 2.0 * X[plane], **OPTIONS)
    assert_allclose(fit.vertices, 2.0 * X, atol=1e-6)
    twice = np.concatenate([SPREAD[:6], SPREAD[:1]])
    targets = X[twice] + np.where(np.arange(7) == 6, 0.02, 0.0)[:, None]
    fit = fit_landmarks(BAR, X[twice], targets, **OPTIONS)
    assert_allclose(fit.residuals[[0, 6]], [[-0.01] * 3, [0.01] * 3], atol=1e-6)
    shift = np.array([1.0, 2.0, 3.0])
    fit = fit_landmarks(BAR, X[SPREAD[:3]], X[SPREAD[:3]] + shift, **OPTIONS)
    assert_allclose(fit.vertices, X + shift, atol=1e-6)


def test_a_part_without_landmarks_goes_along():
    ball = models.sphere(200, radius=0.1)
    beside = ball.vertices + X.mean(axis=0) + [0.5 * LENGTH, 0.0, 0.0]
    both = Mesh(np.concatenate([X, beside]), np.concatenate([BAR.faces, ball.faces + len(X)]))
    fit = fit_landmarks(
        both, X[SPREAD[:12]], bent(40.0)[SPREAD[:12]], n_regions=2, n_cage_vertices=60
    )
    size = np.ptp(fit.vertices[len(X) :], axis=0)
    assert (size < 3.0 * np.ptp(beside, axis=0)).all()
    assert np.isfinite(fit.vertices).all()


@pytest.mark.parametrize(("gap", "bowed", "volume"), [(0.3, 0.72, "free"), (0.15, 0.0, "+50%")])
def test_two_bars_that_would_meet_between_their_landmarks_are_kept_apart(gap, bowed, volume):
    width = np.ptp(X[:, 0]) * np.array([1.0, 0.0, 0.0])
    x = np.concatenate([X, X + (1.0 + gap) * width])
    both = Mesh(x, np.concatenate([BAR.faces, BAR.faces + len(X)]))
    t = (X[:, 2:] - X[:, 2].min()) / LENGTH
    bow = bowed * t * (1.0 - t) * width
    targets = x + np.concatenate([bow, -bow])
    ids = np.flatnonzero(np.isin(x[:, 0], [x[:, 0].min(), x[:, 0].max()]))[::5]
    given = both, x[ids], targets[ids]
    options = {"volume": volume, "n_regions": 2, "n_cage_vertices": 60}
    assert len(fit_landmarks(*given, **options).crossings())
    fit = fit_landmarks(*given, avoid_contact=True, **options)
    assert not len(fit.crossings())
    assert_allclose(fit.residuals, 0.0, atol=1e-3 * LENGTH)
    assert_allclose(fit.moved(x[::7]), fit.vertices[::7], atol=1e-9)
    if volume != "free":
        assert fit.volume_change == pytest.approx(0.5, abs=1e-9)


def test_a_landmark_that_nothing_predicts_does_not_decide_on_the_stiffness(monkeypatch):
    errors = np.full((1 + len(fitting.STIFFNESS), 9), 5.0)
    errors[0], errors[0, 0], errors[1] = 1.0, 9.0, 1.6  # a larger sum, a smaller one of roots
    monkeypatch.setattr(fitting._Fitting, "left_out", lambda *_: errors)
    assert fit_landmarks(BAR, X[SPREAD[:9]], bent(60.0)[SPREAD[:9]], **OPTIONS).stiffness == 0.0


def test_faults_are_told_before_anything_is_computed():
    with pytest.raises(ArgumentError, match="source must have 3 landmarks or more; got 2"):
        fit_landmarks(BAR, X[:2], X[:2])
    with pytest.raises(ArgumentError, match="target must have shape"):
        fit_landmarks(BAR, X[:4], X[:5])
    for sigma in (-1.0, np.inf, [0.1, 0.2]):
        with pytest.raises(ArgumentError, match="uncertainty must be one or 4 numbers"):
            fit_landmarks(BAR, X[:4], X[:4], uncertainty=sigma)
    with pytest.raises(ConstraintError, match="goal of the volume 'whole'"):
        fit_landmarks(BAR, X[:4], X[:4], volume="some")
    sheet = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.2]]), [[0, 1, 2], [0, 2, 3]])
    with pytest.raises(ConstraintError, match="volume must be 'free': the mesh encloses none"):
        fit_landmarks(sheet, sheet.vertices, sheet.vertices, volume="keep")


def test_what_turns_the_body_inside_out_is_refused_and_a_plate_may_bend_the_other_way():
    ids = SPREAD[:12]
    for truth in (X, grown()):
        with pytest.raises(ArgumentError, match="the targets turn the body inside out"):
            fit_landmarks(BAR, X[ids], truth[ids] * [1.0, -1.0, 1.0], **OPTIONS)
    with pytest.raises(ArgumentError, match="the targets are all at one place"):
        fit_landmarks(BAR, X[ids], np.ones((12, 3)))
    flat = [0.1, 1.0, 1.0]
    plate = BAR.with_vertices(bent(60.0, X * flat))
    other = bent(-60.0, X * flat)  # nearly the mirror image of the plate
    fit = fit_landmarks(plate, plate.vertices[ids], other[ids], **OPTIONS)
    assert off(fit, other) < 0.02 * LENGTH
    fit = fit_landmarks(BAR, X[ids], 1e-9 * X[ids], **OPTIONS)  # whose volume is 0 to rounding
    assert_allclose(fit.vertices, 1e-9 * X, atol=1e-12)


def test_progress_rises_and_cancels():
    told = []
    fit_landmarks(
        BAR, X[SPREAD[:6]], X[SPREAD[:6]], progress=lambda share, _: told.append(share), **OPTIONS
    )
    assert told == sorted(told)
    assert told[-1] == 1.0

    def stop(share, _):
        if share > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        fit_landmarks(BAR, X[SPREAD[:6]], X[SPREAD[:6]], progress=stop, **OPTIONS)
