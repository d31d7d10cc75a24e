"""Folders of the current user."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from vtk_segdeform.files import autosave_folder, cache_folder


@pytest.mark.skipif(sys.platform != "linux", reason="variables of Linux")
def test_the_environment_moves_them(monkeypatch, tmp_path):
    for name in ("SEGDEFORM_CACHE", "XDG_CACHE_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    assert cache_folder() == Path.home() / ".cache" / "segdeform" / "bindings"
    assert autosave_folder() == Path.home() / ".local" / "share" / "segdeform" / "unsaved"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "a"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "b"))
    assert cache_folder() == tmp_path / "a" / "segdeform" / "bindings"
    assert autosave_folder() == tmp_path / "b" / "segdeform" / "unsaved"


def test_the_cache_can_be_elsewhere_or_nowhere(monkeypatch, tmp_path):
    monkeypatch.setenv("SEGDEFORM_CACHE", str(tmp_path / "mine"))
    assert cache_folder() == tmp_path / "mine"
    monkeypatch.setenv("SEGDEFORM_CACHE", "0")
    assert cache_folder() is None
