"""Folders of the current user, by platform and environment."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from vtk_segdeform.files import autosave_folder, cache_folder


@pytest.fixture(autouse=True)
def home(monkeypatch, tmp_path):
    for name in ("SEGDEFORM_CACHE", "XDG_CACHE_HOME", "XDG_DATA_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("platform", "cache", "autosave"),
    [
        ("linux", ".cache", ".local/share"),
        ("darwin", "Library/Caches", "Library/Application Support"),
        ("win32", "AppData/Local", "AppData/Local"),
    ],
)
def test_each_platform_has_its_folders(monkeypatch, home, platform, cache, autosave):
    monkeypatch.setattr(sys, "platform", platform)
    assert cache_folder() == home / cache / "segdeform" / "bindings"
    assert autosave_folder() == home / autosave / "segdeform" / "unsaved"


@pytest.mark.parametrize(
    ("platform", "cache", "autosave"),
    [
        ("linux", "XDG_CACHE_HOME", "XDG_DATA_HOME"),
        ("win32", "LOCALAPPDATA", "LOCALAPPDATA"),
    ],
)
def test_the_environment_can_move_them(monkeypatch, home, platform, cache, autosave):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setenv(cache, str(home / "a"))
    assert cache_folder() == home / "a" / "segdeform" / "bindings"
    monkeypatch.setenv(autosave, str(home / "b"))
    assert autosave_folder() == home / "b" / "segdeform" / "unsaved"


def test_the_cache_can_be_elsewhere_or_nowhere(monkeypatch, home):
    monkeypatch.setenv("SEGDEFORM_CACHE", str(home / "mine"))
    assert cache_folder() == home / "mine"
    monkeypatch.setenv("SEGDEFORM_CACHE", "0")
    assert cache_folder() is None
