"""The list of recent files, for any file names and any content of the settings."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from app_hands import settings_in

from vtk_segdeform.widgets.app.recent import Recent


def test_names_are_stored_unchanged(tmp_path):
    paths = [tmp_path / name for name in ("a.ply", "Körper 身体.ply", 'a,b;"c\n.ply', "n" * 255)]
    for path in paths:
        Recent(settings_in(tmp_path)).add(path)
    assert Recent(settings_in(tmp_path)).paths == paths[::-1]


@pytest.mark.skipif(os.name != "posix", reason="names of any bytes")
def test_a_name_that_is_not_text_is_left_out(tmp_path):
    recent = Recent(settings_in(tmp_path))
    recent.add(tmp_path / "a.ply")
    recent.add(tmp_path / os.fsdecode(b"\xff\xfe.ply"))
    assert Recent(settings_in(tmp_path)).paths == [tmp_path / "a.ply"]


@pytest.mark.parametrize("value", [3, [1, 2], b"abc", [None, "x"], 4.5, "", {"a": 1}])
def test_invalid_settings_yield_no_files(tmp_path, value):
    settings = settings_in(tmp_path)
    settings.setValue("recent files", value)
    settings.sync()
    assert Recent(settings_in(tmp_path)).paths in ([], [Path("x")])
    assert Recent(settings).paths in ([], [Path("x")])
