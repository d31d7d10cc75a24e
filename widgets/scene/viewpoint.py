"""Movements of the camera: orbit, pan, zoom, named views, framing, and the projection.

The camera orbits like a turntable about the up axis, so it is never upside down.  It stays within
a distance of the model at which both projections are accurate.  `Viewpoint.home` is the initial
view: three-quarter front, with the up axis vertical on the screen.

A named view is reached in a short animation, except off-screen.  What was framed is framed again
when the window takes another size, until the camera is moved.

Long because views, movements by the mouse and saved settings all end in the placement of one
camera, with the same limits.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from vtk_segdeform.arrays import FloatArray, bounds_of, is_number
from vtk_segdeform.checks import shown
from vtk_segdeform.errors import ArgumentError

from .gestures import Pointer
from .view import Stop, View

_MOST_FRAMED = 50_000  # points that are framed, about, with those farthest out along the axes
_NEAREST, _FARTHEST = 3e-3, 100.0  # distances of the camera, in diagonals of the model
_MARGIN = 0.86  # share of the view that a framed model fills
_SMALLEST_RADIUS = 1e-6  # the smallest framed radius, in diagonals
_TURN = math.pi  # radians, by a drag across the height of the view
_LEVEL = 0.35  # sine of the roll above which the camera orbits about its own view-up
_DURATION = 0.15  # seconds of an animation
_FRAME = 10  # milliseconds
_AXES = np.eye(3)
# Each view as components of the direction from the model to the camera: right, towards the front
# and up; and the same of the direction that is up on the screen.
_VIEWS = {
    "front": ((0, 1, 0), (0, 0, 1)),
    "back": ((0, -1, 0), (0, 0, 1)),
    "right": ((1, 0, 0), (0, 0, 1)),
    "left": ((-1, 0, 0), (0, 0, 1)),
    "top": ((0, 0, 1), (0, -1, 0)),
    "bottom": ((0, 0, -1), (0, 1, 0)),
    "iso": ((1, 1, 1), (0, 0, 1)),
    "home": ((0.5, 1, 0.4), (0, 0, 1)),
}
VIEWS = tuple(_VIEWS)
"""The names of the views for `Viewpoint.look_from`."""


class _Framed(NamedTuple):
    """What was framed: the direction to the camera, that up on the screen, and the points."""

    away: FloatArray
    up: FloatArray
    points: FloatArray
    size: tuple[int, int]
    """Of the view, in pixels."""
    place: tuple[Any, ...] | None = None
    """The camera there; None while it still moves."""


class Viewpoint:
    """The camera of a view over a model.

    Parameters
    ----------
    view : View
        The view with the camera.
    points : callable
        Returns the current vertices of the model, (n, 3) float.
    diagonal : callable
        Returns the diagonal of the model at rest.
    """

    def __init__(
        self, view: View, points: Callable[[], FloatArray], diagonal: Callable[[], float]
    ) -> None:
        self.view = view
        self._points, self._diagonal = points, diagonal
        self._up = _AXES[2]
        self._stop_animation: Stop | None = None
        self._framed: _Framed | None = None
        self._stop_fitting = view.before_render(self._fit)

    # Axes.

    @property
    def up(self) -> FloatArray:
        """(3,) float: the up axis, of length 1."""
        return np.array(self._up)

    @up.setter
    def up(self, up: ArrayLike) -> None:
        vector = np.asarray(up, dtype=float)
        if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
            raise ArgumentError(f"up must be a direction (3,); got {shown(up)}")
        self._up = vector / np.linalg.norm(vector)

    def follow_camera(self) -> None:
        """Set `up` to the axis nearest to the camera's view-up."""
        now = np.array(self.view.camera.GetViewUp())
        axis = int(np.abs(now).argmax())
        self.up = math.copysign(1.0, now[axis]) * _AXES[axis]

    @property
    def axes(self) -> FloatArray:
        """(3, 3) float: the directions right, front and up of the model, one in each row."""
        front = -_AXES[1] if abs(self._up[2]) > 0.5 else _AXES[2]
        front = front - (front @ self._up) * self._up
        front /= np.linalg.norm(front)
        return np.asarray(np.stack([np.cross(self._up, front), front, self._up]))

    # Views.

    def directions(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return for one of `VIEWS` the direction to the camera, and that up on the screen."""
        away, up = (np.array(each, dtype=float) @ self.axes for each in _VIEWS[name])
        return away, up

    def look_from(self, name: str, *, animate: bool = True) -> None:
        """Show all of the model from one of `VIEWS`."""
        if name not in _VIEWS:
            raise ArgumentError(f"view must be one of {', '.join(VIEWS)}; got {shown(name)}")
        away, up = self.directions(name)
        self._aim(away, up, self._points(), animate=animate)

    def look_along(self, away: ArrayLike) -> None:
        """Show all of the model from a direction (3,), that of the camera from the model."""
        direction = np.asarray(away, dtype=float)
        direction = direction / np.linalg.norm(direction)
        if abs(direction @ self._up) > 0.999:
            self.look_from("top" if direction @ self._up > 0.0 else "bottom")
        else:
            self._aim(direction, self._up, self._points(), animate=True)

    def home(self) -> None:
        """Show everything that is visible in three-quarter front view."""
        points = self._points()
        bounds = np.array(self.view.renderer.ComputeVisiblePropBounds()).reshape(3, 2).T
        low, high = bounds_of(points)
        reach = 1e-3 * self._diagonal()
        if (bounds[0] <= bounds[1]).all() and (
            (bounds[0] < low - reach).any() or (bounds[1] > high + reach).any()
        ):  # other actors of the host
            low, high = np.minimum(low, bounds[0]), np.maximum(high, bounds[1])
            points = np.stack([low, high])[np.indices((2, 2, 2)).reshape(3, -1).T, np.arange(3)]
        away, up = self.directions("home")
        self._aim(away, up, points, animate=False)

    def frame(self, points: FloatArray | None = None, *, animate: bool = True) -> None:
        """Show *points* (k, 3), by default the model, from the current direction."""
        camera = self.view.camera
        away = np.subtract(camera.GetPosition(), camera.GetFocalPoint())
        up = np.array(camera.GetViewUp())
        if _axes_of(away, up) is None:
            away, up = self.axes[1:]
        points = self._points() if points is None else points
        self._aim(away, up, points, animate=animate)

    def toggle_projection(self) -> bool:
        """Switch between perspective and orthographic; return whether it is orthographic now."""
        self.finish()
        camera = self.view.camera
        slope = math.tan(0.5 * math.radians(camera.GetViewAngle()))
        focus, away = np.array(camera.GetFocalPoint()), -self.view.view_direction
        if camera.GetParallelProjection():
            distance = camera.GetParallelScale() / slope
        else:
            camera.SetParallelScale(slope * camera.GetDistance())
            distance = max(camera.GetDistance(), 2.0 * self._diagonal())  # outside of the model
        camera.SetPosition(*(focus + distance * away))
        camera.SetParallelProjection(not camera.GetParallelProjection())
        self._drawn()
        return bool(camera.GetParallelProjection())

    # Movements by the mouse; lengths are pixels.

    def turning_axis(self) -> FloatArray:
        """Return the axis (3,) to orbit about: `up`, or the view-up of a tilted camera."""
        camera = self.view.camera
        view_up = np.array(camera.GetViewUp())
        right = np.cross(self.view.view_direction, view_up)
        if abs(right @ self._up) > _LEVEL * np.linalg.norm(right):
            return np.asarray(view_up / np.linalg.norm(view_up))
        return np.asarray(-self._up if view_up @ self._up < -1e-6 else self._up)

    def orbit(self, dx: float, dy: float, pivot: FloatArray, axis: FloatArray) -> None:
        """Turn about *axis* through *pivot* by *dx*, and tilt by *dy* up to the poles."""
        camera = self.view.camera
        step = _TURN / max(1, self.view.renderer.GetSize()[1])
        axes = self._camera_axes
        if axes is None:
            self.home()
            return
        right, upwards, away = axes
        height = math.asin(float(np.clip(away @ axis, -1.0, 1.0)))
        tilted = float(np.clip(height - dy * step, -0.5 * math.pi, 0.5 * math.pi))
        turn = _rotation(-dx * step * axis) @ _rotation((height - tilted) * right)
        position, focus = np.array(camera.GetPosition()), np.array(camera.GetFocalPoint())
        self._place(
            pivot + turn @ (position - pivot),
            pivot + turn @ (focus - pivot),
            turn @ upwards,
        )

    def pan(self, dx: float, dy: float, pivot: FloatArray) -> None:
        """Move so that *pivot* (3,) follows the pointer."""
        camera, axes = self.view.camera, self._camera_axes
        if axes is not None:
            shift = -self.view.pixel_at(pivot) * (dx * axes[0] + dy * axes[1])
            self._place(
                camera.GetPosition() + shift, camera.GetFocalPoint() + shift, camera.GetViewUp()
            )

    def zoom(self, factor: float, pivot: FloatArray) -> None:
        """Enlarge by *factor*; *pivot* (3,) stays at its place on the screen."""
        camera = self.view.camera
        position, focus = np.array(camera.GetPosition()), np.array(camera.GetFocalPoint())
        diagonal = self._diagonal()
        if camera.GetParallelProjection():
            scale = camera.GetParallelScale()
            wanted = float(
                np.clip(scale / factor, 1e-3 * _NEAREST * diagonal, _FARTHEST * diagonal)
            )
            direction = self.view.view_direction
            shift = (1.0 - wanted / scale) * (pivot - focus)
            shift -= (shift @ direction) * direction
            camera.SetParallelScale(wanted)
            self._place(position + shift, focus + shift, camera.GetViewUp())
            return
        distance = float(min(np.linalg.norm(position - focus), np.linalg.norm(position - pivot)))
        limits = _NEAREST * diagonal, _FARTHEST * diagonal
        share = float(np.clip(distance / factor, *limits)) / max(distance, 1e-300)
        if (share - 1.0) * (1.0 / factor - 1.0) < 0.0:  # beyond a limit already
            return
        place = pivot + share * (position - pivot)
        self._place(place, pivot + share * (focus - pivot), camera.GetViewUp())

    def pivot_at(self, pointer: Pointer) -> FloatArray:
        """Return the point (3,) below *pointer* at the distance of the focal point."""
        near, far = self.view.ray(pointer)
        focus = np.array(self.view.camera.GetFocalPoint())
        direction = self.view.view_direction
        along = (far - near) @ direction
        if not (np.isfinite(near).all() and np.isfinite(far).all() and along > 0.0):
            return focus
        return np.asarray(near + (far - near) * (((focus - near) @ direction) / along))

    # State.

    def settings(self) -> dict[str, Any]:
        """Return camera, projection and up axis as numbers, for `restore`."""
        camera = self.view.camera
        return {
            "up": self._up.tolist(),
            "position": list(camera.GetPosition()),
            "focus": list(camera.GetFocalPoint()),
            "view_up": list(camera.GetViewUp()),
            "angle": camera.GetViewAngle(),
            "scale": camera.GetParallelScale(),
            "parallel": bool(camera.GetParallelProjection()),
        }

    def restore(self, settings: Mapping[str, Any]) -> bool:
        """Restore `settings`; return False, and change nothing, if they are damaged."""
        names = ("up", 3), ("position", 3), ("focus", 3), ("view_up", 3), ("angle", 1), ("scale", 1)
        found = [_numbers(settings.get(name), count) for name, count in names]
        given = [each for each in found if each is not None]
        if len(given) < len(names):
            return False
        values = np.concatenate(given)
        up, position, focus, view_up = values[:12].reshape(4, 3)
        angle, scale = map(float, values[12:])
        away, middle = position - focus, self._points().mean(axis=0)
        farthest = 1e3 * _FARTHEST * self._diagonal()
        if not (
            isinstance(settings.get("parallel"), bool)
            and 1.0 <= angle <= 150.0
            and 0.0 < scale <= farthest
            and np.linalg.norm(away) <= farthest
            and np.linalg.norm(focus - middle) <= farthest
            and _axes_of(away, view_up) is not None
            and up.any()
        ):
            return False
        self.finish()
        self.up = up
        camera = self.view.camera
        camera.SetViewAngle(angle)
        camera.SetParallelScale(scale)
        camera.SetParallelProjection(settings["parallel"])
        self._place(position, focus, view_up)
        return True

    def finish(self) -> None:
        """Stop an animation where it is."""
        if self._stop_animation is not None:
            self._stop_animation()
            self._stop_animation = None

    # Pieces.

    def _aim(self, away: FloatArray, up: FloatArray, points: FloatArray, *, animate: bool) -> None:
        """Look at *points* from the direction *away*."""
        framed = _Framed(away, up, points, self.view.renderer.GetSize())
        axes = _axes_of(away, up)
        assert axes is not None
        camera, (width, height) = self.view.camera, self.view.renderer.GetSize()
        slope = _MARGIN * math.tan(0.5 * math.radians(camera.GetViewAngle()))
        slopes = slope * np.array([max(width, 1) / max(height, 1), 1.0])
        points = _outermost(points)
        low, high = bounds_of(points)
        origin = 0.5 * (low + high)
        local = (points - origin) @ axes.T
        low, high = bounds_of(local)
        middle = 0.5 * (low + high)
        local -= middle
        smallest = _SMALLEST_RADIUS * self._diagonal()
        half = np.maximum(0.5 * (high - low)[:2], smallest)
        distance = float((np.abs(local[:, :2]) / slopes + local[:, 2:]).max())
        distance = max(distance, _NEAREST * self._diagonal())
        scale = float(max(half[1], half[0] * slopes[1] / slopes[0])) / _MARGIN
        focus = origin + middle @ axes
        self._move_to(focus, axes, distance, scale, animate=animate)
        if self._stop_animation is None:
            framed = framed._replace(place=self._place_now)
        self._framed = framed

    def _fit(self) -> None:
        """Frame the same again if the size of the view has changed and the camera has not."""
        framed = self._framed
        if framed is None or self._stop_animation is not None:
            return
        place = self._place_now
        if framed.place not in (None, place):
            self._framed = None
        elif framed.size != self.view.renderer.GetSize():
            self._aim(framed.away, framed.up, framed.points, animate=False)
        else:
            self._framed = framed._replace(place=place)

    def remove(self) -> None:
        """Leave the camera alone from now on."""
        self.finish()
        self._stop_fitting()

    def _move_to(
        self, focus: FloatArray, axes: FloatArray, distance: float, scale: float, *, animate: bool
    ) -> None:
        self.finish()
        window = self.view.window
        is_seen = window is not None and not window.GetNeverRendered()
        if not (animate and is_seen) or window.GetOffScreenRendering():
            self._set(focus, axes, distance, scale)
            return
        camera, start = self.view.camera, self._camera_axes
        if start is None:
            self._set(focus, axes, distance, scale)
            return
        first_focus, first = np.array(camera.GetFocalPoint()), camera.GetDistance()
        first_scale, began = camera.GetParallelScale(), time.monotonic()
        turn = Rotation.from_matrix(axes.T @ start).as_rotvec()

        def advance() -> None:
            t = min(1.0, (time.monotonic() - began) / _DURATION)
            if t >= 1.0:
                self.finish()
                self._set(focus, axes, distance, scale)
                return
            s = t * t * (3.0 - 2.0 * t)
            self._set(
                first_focus + s * (focus - first_focus),
                start @ _rotation(s * turn).T,
                first ** (1.0 - s) * distance**s,
                first_scale ** (1.0 - s) * scale**s,
            )

        self._stop_animation = self.view.every(_FRAME, advance)

    def _set(self, focus: FloatArray, axes: FloatArray, distance: float, scale: float) -> None:
        self.view.camera.SetParallelScale(scale)
        self._place(focus + distance * axes[2], focus, axes[1])

    def _place(self, position: FloatArray, focus: FloatArray, up: ArrayLike) -> None:
        """Set the camera, unless that would be invalid."""
        up = np.asarray(up, dtype=float)
        if _axes_of(position - focus, up) is None:
            return
        camera = self.view.camera
        camera.SetPosition(*position)
        camera.SetFocalPoint(*focus)
        camera.SetViewUp(*up)
        self._drawn()

    @property
    def _place_now(self) -> tuple[Any, ...]:
        camera = self.view.camera
        return camera.GetPosition(), camera.GetFocalPoint(), camera.GetParallelScale()

    @property
    def _camera_axes(self) -> FloatArray | None:
        """(3, 3) float: right, up and away of the camera as rows."""
        return _axes_of(-self.view.view_direction, np.array(self.view.camera.GetViewUp()))

    def _drawn(self) -> None:
        self.view.renderer.ResetCameraClippingRange()
        self.view.request_render()


def _outermost(points: FloatArray) -> FloatArray:
    """Return a subset of *points* (n, 3) that includes the extremes along each axis."""
    step = len(points) // _MOST_FRAMED
    if step < 2:
        return points
    ends = [end for axis in points.T for end in (axis.argmin(), axis.argmax())]
    return np.concatenate([points[::step], points[ends]])


def _numbers(value: object, count: int) -> FloatArray | None:
    """Return *count* numbers of a file, (count,) float; None if *value* is anything else."""
    values = value if isinstance(value, list) else [value]
    is_sound = len(values) == count and all(map(is_number, values))
    return np.array(values, dtype=float) if is_sound else None


def _axes_of(away: FloatArray, up: FloatArray) -> FloatArray | None:
    """Return right, up and away (3, 3) as orthonormal rows; None if a camera cannot look so."""
    right = np.cross(up, away)
    length, least = np.linalg.norm(right), 1e-9 * np.linalg.norm(away) * np.linalg.norm(up)
    if not np.isfinite(length) or not length > least:
        return None
    right, away = right / length, away / np.linalg.norm(away)
    return np.stack([right, np.cross(away, right), away])


def _rotation(vector: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) about a *vector* (3,) by its length in radians."""
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())
