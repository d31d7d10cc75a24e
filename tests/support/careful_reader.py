"""Reads files, each in a separate process with limits on memory and time.

    python careful_reader.py < list        one "reader<TAB>path" a line

For each file it prints "answer<TAB>message".  The answer is "read", "refused" for one of our errors
that names the file, "refused without a name", "other" for other exceptions, or the end of the
process: "crashed", "hung", "memory".
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
from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.geometry.motion import read_matrix
from vtk_segdeform.io.convert import read_polydata
from vtk_segdeform.io.meshlab_project import read_project
from vtk_segdeform.mesh.selection import parse_selection

SECONDS, MEMORY = 60, 2 << 30  # for each file, in addition to the memory in use
MESH = sd.Mesh(*OCTAHEDRON)
READERS = {
    "mesh": sd.read_mesh,
    "surface": read_polydata,
    "session": sd.load_session,
    "project": read_project,
    "matrix": read_matrix,
    "selection": lambda path: parse_selection(path, MESH.vertices, role="handle"),
}
CODES = {0: "read", 3: "refused", 4: "other", 5: "memory", 6: "refused without a name"}


def read(reader: str, path: str) -> tuple[int, str]:
    """Return a code of `CODES`, and the message of the error."""
    try:
        READERS[reader](path)
    except SegDeformError as error:
        named = re.search(re.escape(Path(path).name), str(error))
        return (3 if named else 6), f"{type(error).__name__}: {error}"
    except MemoryError as error:
        return 5, str(error)
    except BaseException as error:  # noqa: BLE001 - reports any exception
        return 4, f"{type(error).__name__}: {error}"
    return 0, ""


def one(reader: str, path: str) -> tuple[str, str]:
    """Return the answer and the message of a process that reads one file."""
    with tempfile.TemporaryFile() as output:
        child = os.fork()
        if child == 0:
            for number in (1, 2):
                os.dup2(output.fileno(), number)
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY,) * 2)
            resource.setrlimit(resource.RLIMIT_CPU, (SECONDS,) * 2)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            signal.alarm(SECONDS)  # not handled, so it ends the process
            code, text = read(reader, path)
            output.seek(0)
            output.truncate()
            output.write(text.encode(errors="replace")[-4000:])
            output.flush()
            os._exit(code)
        _, status = os.waitpid(child, 0)
        output.seek(0)
        text = output.read().decode(errors="replace")
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        hung = number in (signal.SIGALRM, signal.SIGXCPU)
        return ("hung" if hung else "crashed"), f"signal {number}: {text[-300:]}"
    return CODES.get(os.WEXITSTATUS(status), "crashed"), text


def main() -> None:
    """Read all listed files."""
    np.seterr(all="ignore")
    pv.Sphere()  # imports pyvista once, before the forks
    for line in sys.stdin:
        reader, path = line.rstrip("\n").split("\t")
        answer, text = one(reader, path)
        print(answer, " ".join(text.split()), sep="\t", flush=True)


if __name__ == "__main__":
    main()
