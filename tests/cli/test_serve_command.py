"""``segdeform serve``: what is refused before anything is served."""

from __future__ import annotations

import configparser
import re
import socket
from pathlib import Path

import pytest

from vtk_segdeform.cli import main, serving

LIBRARIES = serving._LIBRARIES


@pytest.fixture(autouse=True)
def with_all_libraries(monkeypatch):
    monkeypatch.setattr(serving, "_LIBRARIES", ())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["missing.ply"], "missing.ply: there is no such file"),
        (["."], ".: is a folder, not a file"),
        (["--port", "99999"], "--port must be at most 65535; got 99999"),
        (["--upload-limit", "0"], "--upload-limit must be at least 1"),
    ],
)
def test_what_cannot_be_served_is_refused(capsys, words, message):
    assert main(["serve", *words]) == (2 if message.startswith("--") else 1)
    assert capsys.readouterr().err == f"segdeform serve: {message}\n"


def test_a_port_in_use_is_refused(capsys):
    pytest.importorskip("aiohttp")
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        assert main(["serve", "--port", str(port)]) == 1
    assert "already in use" in capsys.readouterr().err


def test_a_missing_library_is_named_with_its_cure(capsys, monkeypatch):
    monkeypatch.setattr(serving, "_LIBRARIES", ("no_such_library",))
    assert main(["serve"]) == 1
    assert "no_such_library; install it with pip install 'vtk-segdeform[web]'" in (
        capsys.readouterr().err
    )


def test_the_required_libraries_are_those_that_the_extra_installs():
    setup = configparser.ConfigParser()
    setup.read(Path(__file__).parents[2] / "setup.cfg", encoding="utf-8")
    extra = setup["options.extras_require"]["web"].split("\n")
    installed = {re.split("[<>=!;]", line)[0].strip().replace("-", "_") for line in extra}
    assert set(LIBRARIES) <= installed
