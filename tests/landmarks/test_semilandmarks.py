"""Landmarks that slide find their targets along curves and surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vtk_segdeform import models
from vtk_segdeform.errors import ArgumentError
from vtk_segdeform.landmarks import fit_landmarks
from vtk_segdeform.landmarks.semilandmarks import Curve, checked_slides, slid

BALL = models.sphere(700)
X = BALL.vertices
RNG = np.random.default_rng(0)
IDS = RNG.choice(len(X), 40, replace=False)
FREE = np.arange(10, 40)
OPTIONS = {"n_regions": 1, "n_cage_vertices": 40}
STRETCH = np.array([1.5, 1.0, 0.8])


def swollen(x: np.ndarray) -> np.ndarray:
    """Return a smooth map of space."""
    return x * STRETCH + 0.15 * np.sin(2.0 * x[:, [1, 2, 0]])


def moved_along(truth: np.ndarray, by: float) -> np.ndarray:
    """Return targets, those that slide off by a random motion."""
    return truth + np.where(
        np.isin(np.arange(len(truth)), FREE)[:, None],
        by * np.random.default_rng(1).normal(size=truth.shape),
        0.0,
    )


def test_along_a_surface_they_find_where_an_affine_map_has_moved_them():
    truth = X[IDS] * STRETCH
    slides = checked_slides([(FREE, BALL.with_vertices(X * STRETCH))], len(IDS))
    found = slid(X[IDS], moved_along(truth, 0.1), slides)
    assert_allclose(found, truth, atol=1e-7)
    assert_array_equal(found[:10], truth[:10])


def test_along_a_closed_curve_too():
    t = np.linspace(0.0, 2.0 * np.pi, 400)
    ring = np.stack([np.cos(t), np.sin(t), np.zeros_like(t)], axis=1)
    ring[-1] = ring[0]
    a = np.concatenate([ring[5:395:10], [[0.0, 0.0, 1.0], [0.3, 0.2, -1.0]]])[-40:]
    slides = checked_slides([(FREE[:-2], ring * STRETCH)], len(a))
    given = a * STRETCH
    given[FREE[:-2]] += 0.1 * np.random.default_rng(2).normal(size=(len(FREE) - 2, 3))
    assert_allclose(slid(a, given, slides), a * STRETCH, atol=1e-3)


def test_targets_that_are_unknown_begin_where_the_others_lead():
    truth = swollen(X[IDS])
    slides = checked_slides([(FREE, BALL.with_vertices(swollen(X)))], len(IDS))
    unknown = truth.copy()
    unknown[FREE] = np.nan
    one, other = (slid(X[IDS], each, slides) for each in (unknown, moved_along(truth, 0.05)))
    assert_allclose(one, other, atol=2e-3)


def test_a_body_is_nearer_to_the_truth_with_landmarks_that_slide():
    truth = swollen(X[IDS])
    unknown = truth.copy()
    unknown[FREE] = np.nan
    surface = BALL.with_vertices(swollen(X))
    fits = (
        fit_landmarks(BALL, X[IDS], unknown, slides=[(FREE, surface)], **OPTIONS),
        fit_landmarks(BALL, X[IDS][:10], truth[:10], **OPTIONS),
    )
    one, other = (np.linalg.norm(fit.vertices - swollen(X), axis=1).mean() for fit in fits)
    assert one < 0.8 * other
    assert np.abs(fits[0].residuals).max() < 1e-9
    assert_array_equal(fits[0].targets[:10], truth[:10])
    on_surface, _ = checked_slides([(FREE, surface)], len(IDS))[0][1](fits[0].targets[FREE])
    assert_allclose(on_surface, fits[0].targets[FREE], atol=1e-12)


def test_a_curve_has_the_tangents_of_its_points_without_jumps():
    t = np.linspace(0.0, np.pi, 50)
    arc = Curve(np.stack([np.cos(t), np.sin(t), np.zeros_like(t)], axis=1))
    angles = np.linspace(0.1, 3.0, 500)
    at = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    nearest, normals = arc(at)
    assert_allclose(nearest, at, atol=1e-3)
    tangents = np.stack([-np.sin(angles), np.cos(angles), np.zeros_like(angles)], axis=1)
    assert np.abs(np.einsum("sij,sj->si", normals, tangents)).max() < 2e-3
    assert_allclose(np.trace(normals, axis1=1, axis2=2), 2.0, atol=1e-12)
    beyond, _ = arc(np.array([[2.0, -1.0, 0.0]]))
    assert_allclose(beyond, [[1.0, 0.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("slides", "words"),
    [
        ([(FREE, "ridge")], "the curve of slides"),
        ([(FREE, X[:1])], "two points or more"),
        ([FREE], "pairs of landmarks"),
        ([([40], BALL)], "slides"),
        ([([3], BALL), ([3], X)], "one curve or surface only"),
        (3, "slides must be a sequence"),
    ],
)
def test_what_is_no_slide_is_told(slides, words):
    with pytest.raises(ArgumentError, match=words):
        fit_landmarks(BALL, X[IDS], X[IDS], slides=slides)


def test_unknown_targets_of_landmarks_that_do_not_slide_are_told():
    unknown = X[IDS].copy()
    unknown[[3, 20]] = np.nan
    with pytest.raises(ArgumentError, match="target must be finite"):
        fit_landmarks(BALL, X[IDS], unknown)
    unknown[2:] = np.nan
    with pytest.raises(ArgumentError, match="3 landmarks or more that are not NaN"):
        fit_landmarks(BALL, X[IDS], unknown, slides=[(np.arange(2, 40), BALL)])
