"""Reads files, each in a process of its own, with little memory and little time; nothing survives.

    python careful_reader.py < list        one "reader<TAB>path" a line

For each comes a line "answer<TAB>what": "read", "refused" by an error of ours that names the file,
"other" exception, or what became of the process: "crashed", "hung", "memory".
"""

from __future__ import annotations

import os
import re
import resource
import signal
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from solids import OCTAHEDRON

import vtk_segdeform as sd
from vtk_segdeform.cli.motion import read_matrix
from vtk_segdeform.cli.selection import parse_selection
from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.io.convert import read_polydata
from vtk_segdeform.io.meshlab_project import read_project
from vtk_segdeform.widgets.recording.reading import read_recording

SECONDS, MEMORY = 60, 2 << 30  # for each file, in addition to the memory in use
MESH = sd.Mesh(*OCTAHEDRON)
READERS = {
    "mesh": sd.read_mesh,
    "surface": read_polydata,
    "session": sd.load_session,
    "project": read_project,
    "recording": read_recording,
    "matrix": read_matrix,
    "selection": lambda path: parse_selection(path, MESH, role="handle"),
}
CODES = {0: "read", 3: "refused", 4: "other", 5: "memory", 6: "refused without a name"}


def read(reader: str, path: str) -> tuple[int, str]:
    """Return a code of `CODES`, and what was said."""
    try:
        READERS[reader](path)
    except SegDeformError as error:
        named = re.search(re.escape(Path(path).name), str(error))
        return (3 if named else 6), f"{type(error).__name__}: {error}"
    except MemoryError as error:
        return 5, str(error)
    except BaseException as error:  # noqa: BLE001 - whatever it is, it is to be told
        return 4, f"{type(error).__name__}: {error}"
    return 0, ""


def one(reader: str, path: str) -> tuple[str, str]:
    """Return what became of a process that reads one file."""
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            for number in (1, 2):
                os.dup2(said.fileno(), number)
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY,) * 2)
            resource.setrlimit(resource.RLIMIT_CPU, (SECONDS,) * 2)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            signal.alarm(SECONDS)  # ends the process: nobody handles it
            code, text = read(reader, path)
            said.seek(0)
            said.truncate()
            said.write(text.encode(errors="replace")[-4000:])
            said.flush()
            os._exit(code)
        _, status = os.waitpid(child, 0)
        said.seek(0)
        text = said.read().decode(errors="replace")
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        hung = number in (signal.SIGALRM, signal.SIGXCPU)
        return ("hung" if hung else "crashed"), f"signal {number}: {text[-300:]}"
    return CODES.get(os.WEXITSTATUS(status), "crashed"), text


def main() -> None:
    """Read all that is listed."""
    np.seterr(all="ignore")
    pv.Sphere()  # so that nothing is imported in every process anew
    for line in sys.stdin:
        reader, path = line.rstrip("\n").split("\t")
        answer, text = one(reader, path)
        print(answer, " ".join(text.split()), sep="\t", flush=True)


if __name__ == "__main__":
    main()
