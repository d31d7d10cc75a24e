"""The help card: it fits into every window and is legible on every background."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import every
from hands import picture, plain_view
from solids import OCTAHEDRON

from vtk_segdeform import Mesh
from vtk_segdeform.widgets import DeformEditor, Mode
from vtk_segdeform.widgets.editor import help_card, keys_of
from vtk_segdeform.widgets.editor.help_card import HelpCard

SECTIONS = [
    ("Everywhere", [("Ctrl+Z", "undo"), ("H", "this card"), ("Esc", "cancel")]),
    ("Painting", [("B", "brush"), ("L", "lasso"), ("[  ]", "smaller, larger brush")]),
]


@pytest.mark.parametrize(
    ("size", "background"),
    every(
        2,
        [
            ((300, 220), 0.0), ((300, 220), 1.0), ((800, 600), 1.0), ((800, 600), 0.0),
            ((600, 1000), 0.0), ((600, 1000), 1.0),
        ],
    ),
)  # fmt: skip
def test_the_card_fits_into_the_window_and_is_legible_on_any_background(size, background):
    view = plain_view(size)
    view.renderer.SetBackground(background, background, background)
    blank = picture(view)
    card = HelpCard(view, SECTIONS)
    assert (picture(view) == blank).all()
    card.show()
    seen = picture(view)
    rows = np.flatnonzero((seen != blank).any(axis=(1, 2)))
    columns = np.flatnonzero((seen != blank).any(axis=(0, 2)))
    assert 0 < rows[0] < rows[-1] < size[1] - 1
    assert 0 < columns[0] < columns[-1] < size[0] - 1
    inside = seen[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(int).sum(axis=2) / 3
    inside = 255 - inside  # light text on a dark card
    assert (inside > 190).mean() > 0.5  # background of the card
    assert (inside < 100).mean() > 0.01  # text
    # The text keeps clear of the border: nothing is clipped.
    edge = inside[4:-4, 4:-4]
    assert (edge[:, [0, -1]] > 190).all()
    assert (edge[[0, -1]] > 190).all()
    card.hide()
    assert (picture(view) == blank).all()
    view.remove_foreground()


def test_the_card_is_laid_out_again_when_the_window_grows():
    view = plain_view((300, 220))
    card = HelpCard(view, SECTIONS)
    card.toggle()
    assert card.is_shown
    view.render()
    view.window.SetSize(900, 700)
    view.render()
    seen = picture(view)
    wide = np.flatnonzero((seen != 255).any(axis=(0, 2)))
    assert abs((wide[0] + wide[-1]) / 2 - 450) < 3  # centred again
    assert wide[-1] - wide[0] > 300
    card.toggle()
    assert not card.is_shown
    card.remove()
    view.remove_foreground()


def listed(view):
    """Return what is listed over the view, and the height of its letters in pixels."""
    actors = [each for each in view.foreground.GetViewProps() if each.IsA("vtkTextActor")]
    (text, size), *_ = sorted(
        ((each.GetInput() or "", each.GetTextProperty().GetFontSize()) for each in actors),
        key=lambda found: -len(found[0]),
    )
    return text, size


def test_where_all_keys_would_be_too_small_those_of_the_mode_are_listed():
    keys = keys_of("pyvista")
    view = plain_view((1400, 1000))
    editor = DeformEditor(view, Mesh(*OCTAHEDRON))
    editor.On()
    try:
        editor.run("help")
        everything = {label for _, rows in keys.sections() for _, label in rows}
        view.render()
        text, size = listed(view)
        assert all(label in text for label in everything)
        assert size >= 12
        for size in ((1000, 680), (801, 555), (613, 430)):
            view.window.SetSize(*size)
            view.renderer.SetBackground(1.0, 1.0, 1.0)
            view.render()
            edge = picture(view)[:, [0, -1]], picture(view)[:3]
            assert all((each > 200).all() for each in (edge[0][: size[1] // 2], edge[1]))
        view.window.SetSize(600, 420)
        seen = []
        for mode in (Mode.HANDLES, Mode.PULL):
            editor.mode = mode
            view.render()
            text, _ = listed(view)
            own = {label for _, rows in keys.sections(mode) for _, label in rows}
            assert all(label in text for label in own)
            assert sum(label in text for label in everything) < len(everything)
            seen.append(text)
        assert seen[0] != seen[1]
    finally:
        editor.remove()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_columns_have_all_rows_under_their_headings_and_each_key_beside_its_action(count):
    sections = keys_of("pyvista").sections()
    labels, keys = (text.split("\n") for text in help_card._texts(sections, count))
    shown = [line.ljust(len(other)) for line, other in zip(labels, keys, strict=True)]
    places = {}
    for heading, rows in sections:
        for key, label in [("", heading), *rows]:
            found = {(row, line.index(label)) for row, line in enumerate(shown) if label in line}
            assert found, label
            places.setdefault((heading, label), found)
            assert not key or any(key in keys[row] for row, _ in found), (key, label)
    for row, line in enumerate(keys):  # no key is written over a word
        for place, letter in enumerate(line):
            assert letter == " " or labels[row].ljust(place + 1)[place] == " "
