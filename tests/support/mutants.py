"""Mutation testing: change one thing in a copy of the source, and see whether a test fails.

    python tests/support/mutants.py mesh -n 60 --seed 1     60 mutants of vtk_segdeform/mesh
    python tests/support/mutants.py --base origin/main      mutants of the lines changed since then

A sample of the mutants of each folder (`mutations`) is tested by the tests of that folder, first
those of the module itself, until one fails.  mutmut leaves out decorated functions, such as cached
properties, and constants of modules; cosmic-ray has no dropped statements and starts Python for
every mutant.  Here each one is tested in a fork of a process that has imported the libraries.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterable
from pathlib import Path

from mutations import ROOT, Mutant, mutants_of

EQUIVALENT = Path(__file__).with_name("equivalent_mutants.txt")
_MEMORY = 8 << 30  # bytes of address space for one mutant
_LIBRARIES = (
    "numba", "scipy.optimize", "scipy.sparse.linalg", "scipy.spatial", "pyvista", "hypothesis",
)  # fmt: skip


def folder_of(path: Path) -> str:
    """Return the folder of the tests of a module, below tests/; "" for modules at the top."""
    parts = path.relative_to(ROOT).parts[:-1]
    return "/".join(parts if parts[0] == "widgets" else parts[1:])


def chosen_tests(path: Path, left_out: Iterable[str] = ()) -> list[str]:
    """Return the tests of a module: its own file first, its examples, and those of its folder."""
    folder = folder_of(path)
    files = (ROOT / "tests" / folder).glob("**/test_*.py" if folder else "test_*.py")
    tests = [str(file.relative_to(ROOT)) for file in files if file.name not in left_out]
    tests.sort(key=lambda test: (not test.endswith(f"/test_{path.stem}.py"), test))
    if ">>> " in path.read_text("utf-8"):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        name = name if name.startswith("vtk_segdeform") else f"vtk_segdeform.{name}"
        example = "test_the_examples_of_a_module_are_right"
        tests.insert(1, f"tests/whole/test_doctests.py::{example}[{name}]")
    return tests


class Bench:
    """Copies of the tree in which mutants are tested, each in a fork of this process."""

    def __init__(self, folder: Path, n_copies: int) -> None:
        ignored = shutil.ignore_patterns(".git", ".venv", "build", "*_cache", "*-output")
        self._free = [folder / str(i) for i in range(n_copies)]
        for tree in self._free:
            shutil.copytree(ROOT, tree, ignore=ignored)  # with times: kernels stay compiled
        self._running: dict[int, tuple[Path, float, Mutant | None]] = {}

    def start(self, mutant: Mutant | None, tests: list[str], seconds: int) -> None:
        """Start *tests* of a mutant, or of the code as it is, with a limit of processor time."""
        tree = self._free.pop()
        if mutant is not None:
            (tree / mutant.path.relative_to(ROOT)).write_text(mutant.source(), "utf-8")
        sys.stdout.flush()
        if child := os.fork():
            self._running[child] = tree, time.monotonic() + 10 * seconds, mutant
            return
        code = 70
        try:
            code = _tested(tree, tests, seconds)
        except BaseException:  # noqa: BLE001 - nothing may reach the caller, who removes the copies
            traceback.print_exc()
        finally:
            os._exit(code)

    def wait(self) -> tuple[Mutant | None, int, float, Path]:
        """Return a mutant whose tests have ended, how, their processor time, and the copy."""
        while True:
            for child, (tree, until, mutant) in self._running.items():
                if time.monotonic() > until:
                    os.kill(child, signal.SIGKILL)
                ended, status, usage = os.wait4(child, os.WNOHANG)
                if not ended:
                    continue
                del self._running[child]
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(child, signal.SIGKILL)  # its own children
                if mutant is not None:
                    place = mutant.path.relative_to(ROOT)
                    (tree / place).unlink()
                    shutil.copy2(ROOT / place, tree / place)
                self._free.append(tree)
                return mutant, status, usage.ru_utime + usage.ru_stime, tree
            time.sleep(0.02)


def _tested(tree: Path, tests: list[str], seconds: int) -> int:
    """Run *tests* in a copy of the tree until one fails; return the exit code of pytest."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    os.chdir(tree)
    os.environ.update(PYTHONPATH=str(tree), PYTHONDONTWRITEBYTECODE="1")
    sys.dont_write_bytecode = True
    sys.path.remove(str(Path(__file__).parent))
    log = os.open(tree / "pytest.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)
    import pytest

    quiet = ["-q", "-x", "--tb=short", "-pno:cacheprovider", "-pno:xdist"]
    loaded = "ignore::pytest.PytestAssertRewriteWarning"  # hypothesis is, already
    code = 0
    for some in tests[:1], tests[1:]:  # the first file kills most mutants, and is soon collected
        if some and not code:
            code = int(pytest.main([*quiet, "-W", loaded, *some]))
    ours = [module for name, module in sys.modules.items() if name.startswith("vtk_segdeform")]
    files = [file for module in ours if (file := getattr(module, "__file__", None))]
    return code if all(Path(file).is_relative_to(tree) for file in files) else 70


def results_of(chosen: list[Mutant], n_processes: int, left_out: Iterable[str] = ()) -> list[str]:
    """Return "killed", "timeout" or "survived" for each of the mutants of a folder."""
    results = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as place:
        bench = Bench(Path(place), n_processes)
        every = [test for mutant in chosen for test in chosen_tests(mutant.path, left_out)]
        bench.start(None, list(dict.fromkeys(every)), 3600)
        _, status, usual, tree = bench.wait()
        if status:
            sys.exit(f"The tests fail without any mutant:\n{(tree / 'pytest.log').read_text()}")
        waiting = list(chosen)
        while len(results) < len(chosen):
            while waiting and len(chosen) - len(waiting) - len(results) < n_processes:
                mutant = waiting.pop()
                bench.start(mutant, chosen_tests(mutant.path, left_out), int(2 * usual) + 5)
            mutant, status, _, _ = bench.wait()
            was_stopped = os.WIFSIGNALED(status) and os.WTERMSIG(status) != signal.SIGSEGV
            results.append("timeout" if was_stopped else "killed" if status else "survived")
            if results[-1] != "killed":
                print(f"{results[-1]}  {mutant.line}  {mutant}", flush=True)
    return results


def _changed_lines(base: str) -> dict[Path, set[int]]:
    """Return the lines of each Python file of the source that were changed since *base*."""
    command = ["git", "diff", "-U0", "--merge-base", base, "--", "vtk_segdeform", "widgets"]
    text = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    lines: dict[Path, set[int]] = {}
    for row in text.splitlines():
        if row.startswith("+++ "):
            at = lines.setdefault(ROOT / row[len("+++ b/") :], set())
        elif hunk := re.match(r"@@ \S+ \+(\d+)(?:,(\d+))? @@", row):
            at |= set(range(int(hunk[1]), int(hunk[1]) + int(hunk[2] or 1)))
    return lines


def main() -> int:
    """Print how many mutants of each folder were killed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="*", help="mesh, io, widgets/editor ...; all by default")
    parser.add_argument("-n", type=int, default=30, help="mutants of each folder")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--base", help="only lines changed since this revision")
    parser.add_argument(
        "--without", nargs="*", default=(), help="files of code or tests to leave out"
    )
    parser.add_argument("--least", type=float, default=0.0, help="per cent to be killed, or fail")
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    files = [path for top in ("vtk_segdeform", "widgets") for path in (ROOT / top).rglob("*.py")]
    lines = _changed_lines(given.base) if given.base else None
    known = {row.rpartition(" :: ")[0] for row in EQUIVALENT.read_text("utf-8").splitlines()}
    by_folder: dict[str, list[Mutant]] = {}
    for path in sorted(path for path in files if path.name not in given.without):
        folder = folder_of(path)
        if (lines is None or path in lines) and (not given.folders or folder in given.folders):
            by_folder.setdefault(folder, []).extend(
                mutant
                for mutant in mutants_of(path)
                if (lines is None or mutant.line in lines[path])
                and not known & {mutant.place, str(mutant)}
            )
    for name in _LIBRARIES:  # imported once, not by every fork
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    table = []
    for folder, mutants in by_folder.items():
        chosen = random.Random(given.seed).sample(mutants, min(given.n, len(mutants)))
        results = results_of(chosen, given.processes, given.without) if chosen else []
        table.append((folder or "(top)", len(mutants), results))
    table.append(("all", sum(n for _, n, _ in table), [r for _, _, rs in table for r in rs]))
    print(f"\n{'folder':24}  mutants  tested  killed  timeout  survived  kill rate")
    for folder, n, results in table:
        killed, timeout, survived = map(results.count, ("killed", "timeout", "survived"))
        rate = 100.0 * (killed + timeout) / max(len(results), 1)
        counts = f"{n:7}  {len(results):6}  {killed:6}  {timeout:7}  {survived:8}"
        print(f"{folder:24}  {counts}  {rate:7.0f} %")
    return int(bool(results) and rate < given.least)


if __name__ == "__main__":
    sys.exit(main())
