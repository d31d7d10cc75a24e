"""Saves a session repeatedly in a child process, which is killed at random moments.

    python killed_saver.py FOLDER COUNT SEED

Prints how often the file contained the old and the new session; any other content is an error.
"""

from __future__ import annotations

import itertools
import os
import signal
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from solids import OCTAHEDRON, icosphere

import vtk_segdeform as sd


def main() -> None:
    """Kill a child that saves, COUNT times."""
    folder, count, seed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    rng = np.random.default_rng(seed)
    path = folder / "work.segdeform"
    sessions = [sd.Session(sd.Mesh(*OCTAHEDRON)), sd.Session(sd.Mesh(*icosphere(3)))]
    whole = []
    for session in sessions:
        session.handles.add([0], "h")
        sd.save_session(path, session)
        whole.append(path.read_bytes())
    found: Counter[str] = Counter()
    n_drafts, lasts = 0, 0.01  # seconds that a save takes now, on a busy machine as well
    for number in range(count):
        before = whole.index(path.read_bytes())
        ready, begin = os.pipe()
        child = os.fork()
        if child == 0:
            for turn in itertools.count(number):
                os.write(begin, b".")
                sd.save_session(path, sessions[turn % 2])
        os.read(ready, 1)
        time.sleep(rng.uniform(0.0, 2.0 * lasts))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(ready)
        os.close(begin)
        after = whole.index(path.read_bytes())  # ValueError for any other content
        sd.load_session(path)
        found["old" if after == before else "new"] += 1
        found["killed while writing"] += len([*folder.glob(".segdeform-*")]) > n_drafts
        n_drafts = len([*folder.glob(".segdeform-*")])
        began = time.perf_counter()
        sd.save_session(path, sessions[number % 2])
        lasts = time.perf_counter() - began
    print(*(f"{number} {what}" for what, number in sorted(found.items())), sep=", ")


if __name__ == "__main__":
    main()
