"""Films: the files contain the pictures drawn, and are written atomically."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hands import Hand, picture, plain_view
from PIL import Image
from scenes import sausage

from vtk_segdeform import Session, models
from vtk_segdeform.errors import (
    CageError,
    Cancelled,
    MissingDependencyError,
    SessionError,
)
from vtk_segdeform.pictures.canvas import require_offscreen
from vtk_segdeform.widgets.films.film import Film, film
from vtk_segdeform.widgets.films.film_files import require_film
from vtk_segdeform.widgets.scene.surface_display import SurfaceDisplay

pytestmark = pytest.mark.usefixtures("bound_once")
SCENE = sausage(is_coarse=True)
SIZE = (120, 90)
TURNS = [SCENE.turned(angle) for angle in (0.0, 10.0, 20.0)]


@pytest.fixture(scope="module", autouse=True)
def renderer():
    try:
        require_offscreen()
    except MissingDependencyError as error:
        pytest.skip(str(error))


@pytest.fixture
def session():
    return SCENE.session()


@pytest.fixture
def ball():
    view = plain_view(SIZE)
    SurfaceDisplay(view, Session(models.sphere(200)))
    view.renderer.ResetCamera()
    view.render()
    return view


def read(path) -> list[np.ndarray]:
    """Return the pictures of a GIF, (h, w, 3) int."""
    found = []
    with Image.open(path) as image:
        for k in range(image.n_frames):
            image.seek(k)
            found.append(np.asarray(image.convert("RGB"), int))
    return found


def red(image: np.ndarray) -> np.ndarray:
    return (image[..., 0] > 120) & (image[..., 1] < 100) & (image[..., 2] < 100)


def test_a_drag_becomes_a_picture_for_each_target_and_one_step(tmp_path, session):
    path = tmp_path / "bend.gif"
    film(path, session, TURNS, size=SIZE, fps=10)
    pictures = read(path)
    assert [p.shape for p in pictures] == [(90, 120, 3)] * 3
    heights = [np.nonzero(red(p))[0].mean() for p in pictures]
    assert heights[0] + 5 < heights[1] < heights[2] - 5  # the handle moves down
    with Image.open(path) as image:
        assert image.info["duration"] == 100
        assert image.info["loop"] == 0
    assert np.array_equal(session.targets["handle 1"], TURNS[-1])
    assert session.undo() == "drag handle 1"
    assert np.array_equal(session.vertices, SCENE.mesh.vertices)
    assert list(tmp_path.iterdir()) == [path]


def test_targets_may_be_named_or_come_one_by_one(tmp_path, session):
    film(tmp_path / "a.gif", session, [{"handle 1": t} for t in TURNS], size=SIZE)
    film(tmp_path / "b.gif", session, iter(TURNS), size=SIZE)
    assert len(read(tmp_path / "a.gif")) == len(read(tmp_path / "b.gif")) == 3


def test_pictures_are_those_of_the_view(ball):
    shots = Film(ball)
    for angle in (0.0, 20.0):
        ball.camera.Roll(angle)
        shots.snap()
    assert np.array_equal(shots[1], picture(ball))
    assert (shots[0] != shots[1]).any()


def test_a_gif_has_accurate_colours_and_a_white_background(tmp_path, ball):
    film(tmp_path / "a.gif", ball, [None, lambda: ball.camera.Azimuth(40)])
    shots = Film(ball)
    for angle in (-40, 40):
        ball.camera.Azimuth(angle)
        shots.snap()
    for shown, seen in zip(read(tmp_path / "a.gif"), map(shots.__getitem__, range(2)), strict=True):
        assert np.abs(shown - seen).max() <= 16
        assert (shown[0] == 255).all()


def test_watch_takes_what_the_hand_draws(tmp_path, ball):
    made = Film(ball)
    stop = made.watch()
    Hand(ball).drag([(40, 40), (50, 45), (60, 60)])
    stop()
    ball.render()
    assert len(made) >= 2
    assert np.array_equal(made[-1], picture(ball))
    made.save(tmp_path / "work.gif")
    assert (tmp_path / "work.gif").exists()


def test_a_film_has_one_even_size_even_if_the_window_is_resized(tmp_path):
    view = plain_view((61, 41))
    made = Film(view)
    for size in ((61, 41), (30, 80)):
        view.window.SetSize(*size)
        made.snap()
    assert [made[k].shape for k in range(2)] == [(40, 60, 3)] * 2
    assert (made[1] == 255).all()


def test_a_failure_leaves_no_file_and_the_session_as_it_was(tmp_path, session):
    before = session.state
    with pytest.raises(ValueError, match="targets"):
        film(tmp_path / "a.gif", session, iter([*TURNS[:2], np.zeros((2, 3))]), size=SIZE)
    assert session.state is before
    assert not session.is_dragging
    with pytest.raises(ValueError, match="targets require a session"):
        film(tmp_path / "a.gif", plain_view(SIZE), TURNS)
    empty = Session(SCENE.mesh)
    empty.handles.add(SCENE.handle)
    with pytest.raises(CageError):
        film(tmp_path / "a.gif", empty, TURNS, size=SIZE)
    with pytest.raises(SessionError, match="without pictures"):
        film(tmp_path / "a.gif", session, [], size=SIZE)
    assert list(tmp_path.iterdir()) == []


def test_a_film_that_is_cancelled_leaves_no_file(tmp_path, ball):
    made, reported = Film(ball), []
    for _ in range(3):
        made.snap()

    def progress(fraction, text):
        reported.append((fraction, text))
        if len(reported) == 3:
            raise Cancelled("enough")

    with pytest.raises(Cancelled, match="enough"):
        made.save(tmp_path / "ball.gif", progress=progress)
    assert reported[0] == (0.0, "picture 1")
    assert list(tmp_path.iterdir()) == []
    made.save(tmp_path / "ball.gif", progress=lambda *said: reported.append(said))
    assert max(fraction for fraction, _ in reported) <= 1.0


def test_a_path_that_cannot_be_written_is_refused_before_the_first_frame(tmp_path, ball):
    (tmp_path / "there.gif").mkdir()
    done = []
    for path, says in [
        ("a.avi", "a film is a .gif or an .mp4"),
        ("there.gif", "a folder"),
        ("no/a.gif", "there is no folder"),
    ]:
        with pytest.raises(SessionError, match=says):
            film(tmp_path / path, ball, [lambda: done.append("work")])
    with pytest.raises(SessionError, match="fps must be"):
        film(tmp_path / "a.gif", ball, [lambda: done.append("work")], fps=0)
    assert done == []


@pytest.mark.parametrize(("suffix", "module"), [("mp4", "imageio_ffmpeg"), ("gif", "PIL.Image")])
def test_a_missing_library_is_reported_with_its_pip_command(tmp_path, monkeypatch, suffix, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingDependencyError, match="pip install") as error:
        require_film(tmp_path / f"a.{suffix}")
    assert {"mp4": "'imageio[ffmpeg]'", "gif": "pillow"}[suffix] in str(error.value)


def test_a_video_is_written_picture_by_picture_and_closed(tmp_path, monkeypatch, ball):
    fed = []

    def write_frames(path, size, *, fps, macro_block_size):
        assert size[0] % macro_block_size == size[1] % macro_block_size == 0
        with open(path, "wb") as file:
            try:
                while True:
                    frame = yield
                    fed.append((fps, size, len(frame)))
            finally:
                file.write(b"video")

    fake = SimpleNamespace(write_frames=write_frames)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", fake)
    film(tmp_path / "a.mp4", ball, [None, None], fps=25)
    assert fed == [(25, SIZE, 3 * SIZE[0] * SIZE[1])] * 2
    assert (tmp_path / "a.mp4").read_bytes() == b"video"


def test_a_real_video_is_written_if_ffmpeg_is_installed(tmp_path, ball):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    film(tmp_path / "a.mp4", ball, [lambda: ball.camera.Roll(5)] * 4)
    about, *frames = ffmpeg.read_frames(str(tmp_path / "a.mp4"))
    assert about["size"] == SIZE
    assert len(frames) == 4
