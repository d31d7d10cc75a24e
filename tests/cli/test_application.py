"""Before Qt starts: what it would end the process for is an error that says what to do."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from vtk_segdeform.cli import application

plugins = application._platform_plugins()
pytestmark = pytest.mark.skipif(not plugins, reason="no Qt with plugins of its own")


@pytest.fixture
def broken(tmp_path):
    """Return the environment where two libraries of Qt's plugin for X11 are not there."""
    code = plugins[-1].read_bytes()
    for there, gone in ((b"libxcb-icccm.so.4", b"libxcb-icccm.so.9"),
                        (b"libxcb-keysyms.so.1", b"libxcb-keysyms.so.9")):  # fmt: skip
        assert code.count(there + b"\0") == 1
        code = code.replace(there, gone)
    (tmp_path / plugins[-1].name).write_bytes(code)
    return {
        "QT_QPA_PLATFORM": "xcb",
        "QT_QPA_PLATFORM_PLUGIN_PATH": str(tmp_path),
        "LD_LIBRARY_PATH": str(plugins[-1].parents[2] / "lib"),
    }


def test_the_missing_libraries_of_qt_are_named_with_their_packages(broken):
    command = [sys.executable, "-m", "vtk_segdeform", "app"]
    done = subprocess.run(command, env={**os.environ, **broken}, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert "Qt needs libxcb-icccm.so.9, libxcb-keysyms.so.9; on Debian or Ubuntu: apt-get" in line
    assert line.endswith(" libxcb-icccm9 libxcb-keysyms9")
