"""The help card: it fits into every window and is legible on every background."""

from __future__ import annotations

from itertools import pairwise

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
    if not background:  # light text on a dark card
        inside = 255 - inside
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


def test_in_a_small_window_the_keys_fill_pages_through_which_the_key_turns():
    keys = keys_of("pyvista")
    view = plain_view((300, 220))
    card = HelpCard(view, keys.sections(), keys.sections(Mode.PULL), "F1")
    blank, pages = picture(view), []
    card.toggle()
    while card.is_shown:
        pages.append(picture(view))
        changed = (pages[-1] != blank).any(axis=2)
        assert not changed[[0, -1]].any()
        assert not changed[:, [0, -1]].any()
        card.toggle()
    assert 2 < len(pages) < 7
    assert all((one != other).any() for one, other in pairwise(pages))
    card.toggle()
    assert (picture(view) == pages[0]).all()
    view.window.SetSize(900, 700)
    picture(view)
    card.toggle()
    assert not card.is_shown  # all of them are on one page
    card.remove()
    view.remove_foreground()


def texts(view):
    """Return all texts over the view and their heights in pixels."""
    actors = [each for each in view.foreground.GetViewProps() if each.IsA("vtkTextActor")]
    return {each.GetInput(): each.GetTextProperty().GetFontSize() for each in actors}


def test_where_all_keys_would_be_too_small_those_of_the_mode_are_listed():
    keys = keys_of("pyvista")
    view = plain_view((1400, 1000))
    editor = DeformEditor(view, Mesh(*OCTAHEDRON))
    editor.On()
    try:
        editor.run("help")
        everything = {name for name, _ in keys.sections()}
        view.render()
        large = texts(view)
        assert everything <= set(large)
        assert min(large[name] for name in everything) >= 12
        for size in ((900, 650), (330, 260)):  # on one page, and on several
            view.window.SetSize(*size)
            seen = []
            for mode in (Mode.HANDLES, Mode.PULL):
                editor.mode = mode
                view.render()
                own, found = keys.sections(mode), texts(view)
                headings = {name for name, _ in own}
                assert headings & set(found)
                assert not (everything - headings) & set(found)
                seen.append({label for _, rows in own for _, label in rows} & set(found))
            assert seen[0] != seen[1]
        view.window.SetSize(1400, 1000)
        view.render()
        assert everything <= set(texts(view))
    finally:
        editor.remove()


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_columns_have_all_rows_in_order_under_their_headings(count):
    sections = keys_of("pyvista").sections()
    columns = help_card._broken(sections, count)
    assert 1 <= len(columns) <= count
    broken = [(heading, row) for column in columns for heading, rows in column for row in rows]
    assert broken == [(heading, row) for heading, rows in sections for row in rows]
    lengths = [help_card._n_lines(column) for column in columns]
    assert max(lengths) - sum(lengths) / count < 6
