"""Mutation testing: change one thing in a copy of the source, and see whether a test fails.

    python tests/support/mutants.py mesh -n 60 --seed 1     60 mutants of vtk_segdeform/mesh
    python tests/support/mutants.py --base origin/main      mutants of the lines changed since then

Mutants are drawn at random from all that these operators make of the code of a folder:

    comparison    ``<`` to ``<=`` and to ``>=``, and so on; ``==`` to ``!=``, ``is``, ``in`` likewise
    arithmetic    + and -, * and /, // to *, % to //, ** to *, << and >>, & and |, ^ to |
    constant      an integer by one more and by one less, a float by one more, True and False
    string        another one
    unary         ``not``, ``~`` or ``-`` left out
    logic         ``and`` to ``or`` and back; the condition of ``if`` negated, unless a comparison
    return        None instead of a value
    statement     a call, a raise, ``+=`` and an assignment to an item or attribute left out
    arguments     the first two positional arguments exchanged

Left out because nothing but speed or text depends on it: docstrings, annotations, messages (text in
``raise``, f-strings and strings with blanks), calls of progress functions, sizes of pieces of work
(`_SPEED`), the choice between compiled kernels and numpy (`_CHOICE`), ``__all__``, and exchanged
arguments of symmetric functions.

mutmut skips decorated functions, such as cached properties and kernels, and module constants;
cosmic-ray has neither samples nor dropped statements, and starts Python for every mutant.  Here each
mutant is tested in a fork of a process that has imported the libraries.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
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
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
_SPEED = {"_PIECE", "_LARGE_PIECE", "_BLOCK", "_BAND", "_LARGE", "_HUGE", "_FEW_PAIRS"}
_CHOICE = {"compiled_checks", "compiled_kernels", "load_for", "load_early"}
_SYMMETRIC = {"minimum", "maximum", "min", "max", "hypot", "array_equal", "isclose", "allclose"}
_COMPARISONS = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt), ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
_ARITHMETIC = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.FloorDiv, ast.Pow: ast.Mult, ast.LShift: ast.RShift,
    ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitOr,
}  # fmt: skip
# Tests beyond tests/FOLDER that are about a folder.
_MORE = {"mesh": ["tests/mesh_repair"]}
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.txt")
_MEMORY = 8 << 30  # bytes of address space for one mutant


class Mutant(NamedTuple):
    """One change of the code of a module: the node of its tree, and the node in its place."""

    path: Path
    tree: ast.Module
    node: ast.AST
    operator: str
    changed: ast.AST

    @property
    def line(self) -> int:
        """The line at which the change begins."""
        return int(getattr(self.node, "lineno", 0))

    def __str__(self) -> str:
        """Return the file, the line of code and the change: the same if lines are moved."""
        code = self.path.read_text("utf-8").splitlines()[self.line - 1].strip()
        texts = (" ".join(ast.unparse(node).split())[:80] for node in (self.node, self.changed))
        return f"{self.path.relative_to(ROOT)} | {code} | {'  ->  '.join(texts)}"

    def source(self) -> str:
        """Return the source of the changed module."""
        node, kind, was = self.node, self.node.__class__, self.node.__dict__
        node.__class__, node.__dict__ = self.changed.__class__, {**was, **self.changed.__dict__}
        try:
            return ast.unparse(self.tree)
        finally:
            node.__class__, node.__dict__ = kind, was


def mutants_of(path: Path) -> list[Mutant]:
    """Return all mutants of a module."""
    tree = ast.parse(path.read_text("utf-8"))
    nodes = list(_relevant(tree))
    return [Mutant(path, tree, node, *change) for node in nodes for change in _changes(node)]


def _relevant(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes on which more than speed and text depends."""
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list", "type_params", "bases"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or _is_irrelevant(child):
                continue
            if isinstance(child, ast.stmt | ast.expr):
                yield child
            if isinstance(child, ast.Call) and _name(child.func) == "in_parallel":
                child = ast.Tuple(child.args[:2])  # without the sizes of pieces
            if not isinstance(child, ast.Raise | ast.JoinedStr):
                yield from _relevant(child)


def _is_irrelevant(node: ast.AST) -> bool:
    if isinstance(node, ast.Expr):
        node = node.value
        if isinstance(node, ast.Constant):
            return True
    if isinstance(node, ast.Call):
        return _name(node.func) in _CHOICE
    if isinstance(node, ast.NamedExpr):
        return _is_irrelevant(node.value)
    if isinstance(node, ast.Assign):
        return _name(node.targets[0]) in {*_SPEED, "__all__"}
    return False


def _name(node: ast.AST) -> str:
    return getattr(node, "id", getattr(node, "attr", ""))


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield the operator and the changed node, for each change of one node."""
    match node:
        case ast.Compare(ops=[op, *others]):
            for other in _COMPARISONS[type(op)]:
                yield "comparison", ast.Compare(node.left, [other(), *others], node.comparators)
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in _ARITHMETIC:
            other = _ARITHMETIC[type(op)]()
            if isinstance(node, ast.BinOp):
                yield "arithmetic", ast.BinOp(node.left, other, node.right)
            else:
                yield "arithmetic", ast.AugAssign(node.target, other, node.value)
        case ast.Constant(value=bool(value)):
            yield "constant", ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield "constant", ast.Constant(value + 1)
            yield "constant", ast.Constant(value - 1)
        case ast.Constant(value=float(value)):
            yield "constant", ast.Constant(value + 1.0)
        case ast.Constant(value=str(value)) if " " not in value:
            yield "string", ast.Constant(f"other{value}")
        case ast.UnaryOp(op=ast.Not() | ast.Invert() | ast.USub()):
            yield "unary", node.operand
        case ast.BoolOp(op=op):
            other = ast.Or() if isinstance(op, ast.And) else ast.And()
            yield "logic", ast.BoolOp(other, node.values)
        case ast.If(test=test) | ast.IfExp(test=test):
            if not isinstance(test, ast.Compare) and not _is_irrelevant(test):
                changed = copy.copy(node)
                changed.test = ast.UnaryOp(ast.Not(), test)
                yield "logic", changed
        case ast.Return(value=ast.expr() as value):
            if not (isinstance(value, ast.Constant) and value.value is None):
                yield "return", ast.Return(ast.Constant(None))
        case ast.Call(args=[one, other, *rest]) if _name(node.func) not in _SYMMETRIC:
            if not isinstance(one, ast.Starred) and not isinstance(other, ast.Starred):
                yield "arguments", ast.Call(node.func, [other, one, *rest], node.keywords)
    match node:
        case ast.Expr(value=ast.Call()) | ast.Raise() | ast.AugAssign():
            yield "statement", ast.Pass()
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield "statement", ast.Pass()


def folder_of(path: Path) -> str:
    """Return the folder of tests of a module, below tests/; "" for modules at the top."""
    parts = path.relative_to(ROOT).parts[:-1]
    return "/".join(parts if parts[0] == "widgets" else parts[1:])


def tests_of(path: Path) -> list[str]:
    """Return the tests that reach a module, first those of its own file and its examples."""
    folder = folder_of(path)
    first = [f"tests/{folder}/test_{path.stem}.py"]
    if ">>> " in path.read_text():
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        name = name if name.startswith("vtk_segdeform") else f"vtk_segdeform.{name}"
        example = "test_the_examples_of_a_module_are_right"
        first.append(f"tests/whole/test_doctests.py::{example}[{name.removesuffix('.__init__')}]")
    own = (ROOT / "tests" / folder).glob("**/test_*.py" if folder else "test_*.py")
    rest = [*sorted(str(file.relative_to(ROOT)) for file in own), *_MORE.get(folder, ())]
    there = [test for test in first if (ROOT / test.partition("::")[0]).exists()]
    return list(dict.fromkeys([*there, *rest]))


class Bench:
    """Copies of the tree in which mutants are tested, each in a fork of this process."""

    def __init__(self, folder: Path, n_copies: int) -> None:
        ignored = shutil.ignore_patterns(".git", ".venv", "build", "docs", "*_cache", "*-output")
        self._free = [folder / str(i) for i in range(n_copies)]
        for copy_ in self._free:
            shutil.copytree(ROOT, copy_, ignore=ignored)  # with times: kernels stay compiled
        self._running: dict[int, tuple[Path, float, Mutant | None]] = {}

    def start(self, mutant: Mutant | None, tests: list[str], seconds: int) -> None:
        """Start *tests* of a mutant, or of the code as it is, with a limit of processor time."""
        tree = self._free.pop()
        if mutant is not None:
            (tree / mutant.path.relative_to(ROOT)).write_text(mutant.source(), "utf-8")
        sys.stdout.flush()
        child = os.fork()
        if not child:
            code = 70
            try:
                code = _tested(tree, tests, seconds)
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(code)  # never to the caller, who removes the copies
        self._running[child] = tree, time.monotonic() + 10 * seconds, mutant

    def wait(self) -> tuple[Mutant | None, int, float]:
        """Return a mutant whose tests have ended, how they ended, and their processor time."""
        while True:
            for child, (tree, until, mutant) in self._running.items():
                if time.monotonic() > until:
                    os.killpg(child, signal.SIGKILL)
                ended, status, usage = os.wait4(child, os.WNOHANG)
                if ended:
                    del self._running[child]
                    with contextlib.suppress(ProcessLookupError):
                        os.killpg(child, signal.SIGKILL)  # its own children
                    if mutant is not None:
                        place = mutant.path.relative_to(ROOT)
                        (tree / place).unlink()
                        shutil.copy2(ROOT / place, tree / place)
                    self._free.append(tree)
                    return mutant, status, usage.ru_utime + usage.ru_stime
            time.sleep(0.02)


def _tested(tree: Path, tests: list[str], seconds: int) -> int:
    """Run *tests* in a copy of the tree until one fails; return the exit code of pytest."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    os.chdir(tree)
    os.environ.update(PYTHONPATH=str(tree), PYTHONDONTWRITEBYTECODE="1")
    sys.dont_write_bytecode = True
    sys.path[:] = [
        folder
        for folder in sys.path
        if not Path(folder).is_relative_to(ROOT) or ".venv" in Path(folder).parts
    ]
    log = os.open(tree / "pytest.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(log, stream)
    import pytest

    quiet = ["-q", "-x", "--tb=short", "-pno:cacheprovider", "-pno:xdist"]
    loaded = "ignore::pytest.PytestAssertRewriteWarning"  # hypothesis is, already
    code = 0
    for some in tests[:1], tests[1:]:  # the first file kills most mutants, and is soon collected
        if some and not code:
            code = int(pytest.main([*quiet, "-W", loaded, *some]))
    ours = [module for name, module in sys.modules.items() if name.startswith("vtk_segdeform")]
    files = [file for module in ours if (file := getattr(module, "__file__", None))]
    foreign = [file for file in files if not Path(file).is_relative_to(tree)]
    print(*foreign, sep="\n", flush=True)
    return 70 if foreign else code


def measured(folder: str, chosen: list[Mutant], n_processes: int) -> list[tuple[Mutant, str]]:
    """Return the mutants of a *folder* with "killed", "timeout" or "survived"; the tests pass."""
    results = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as place:
        bench = Bench(Path(place), n_processes)
        bench.start(None, list(dict.fromkeys(t for m in chosen for t in tests_of(m.path))), 3600)
        _, status, usual = bench.wait()
        if status:
            log = max(Path(place).glob("*/pytest.log"), key=os.path.getsize).read_text()
            sys.exit(f"The tests of {folder} fail without any mutant:\n{log[-3000:]}")
        seconds = int(2 * usual) + 5
        print(f"{folder}: {len(chosen)} mutants, tests take {usual:.0f} s each at most", flush=True)
        waiting, n_running = list(chosen), 0
        while waiting or n_running:
            while waiting and n_running < n_processes:
                mutant = waiting.pop()
                bench.start(mutant, tests_of(mutant.path), seconds)
                n_running += 1
            mutant, status, _ = bench.wait()
            n_running -= 1
            timeout = os.WIFSIGNALED(status) and os.WTERMSIG(status) != signal.SIGSEGV
            result = "timeout" if timeout else "killed" if status else "survived"
            if result != "killed":
                print(f"{result}  {mutant.line}  {mutant}", flush=True)
            results.append((mutant, result))
    return results


def _changed_lines(base: str) -> dict[Path, set[int]]:
    """Return the lines of each Python file of the source that were changed since *base*."""
    command = ["git", "diff", "-U0", "--merge-base", base, "--", "vtk_segdeform", "widgets"]
    text = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    lines: dict[Path, set[int]] = {}
    for row in text.splitlines():
        if row.startswith("+++ b/") and row.endswith(".py"):
            at = lines[ROOT / row.removeprefix("+++ b/")] = set()
        elif row.startswith("+++"):
            at = set()
        elif hunk := re.match(r"@@ \S+ \+(\d+)(?:,(\d+))? @@", row):
            at |= set(range(int(hunk[1]), int(hunk[1]) + int(hunk[2] or 1)))
    return lines


def _equivalent() -> set[str]:
    rows = EQUIVALENT.read_text("utf-8").splitlines()
    return {row.rpartition(" | ")[0] for row in rows if row and not row.startswith("#")}


def main() -> int:
    """Print how many mutants of each folder were killed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="*", help="mesh, io, widgets/editor ...; all by default")
    parser.add_argument("-n", type=int, default=30, help="mutants of each folder")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--base", help="only lines changed since this revision")
    parser.add_argument("--without", nargs="*", default=(), help="files to leave out")
    parser.add_argument("--least", type=float, default=0.0, help="per cent to be killed, or fail")
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    files = [path for top in ("vtk_segdeform", "widgets") for path in (ROOT / top).rglob("*.py")]
    files = sorted(path for path in files if not set(given.without) & {path.name})
    lines = _changed_lines(given.base) if given.base else None
    by_folder: dict[str, list[Mutant]] = {}
    for path in files:
        folder = folder_of(path)
        if (lines is None or path in lines) and (not given.folders or folder in given.folders):
            mutants = by_folder.setdefault(folder, [])
            mutants += [m for m in mutants_of(path) if lines is None or m.line in lines[path]]
    libraries = (
        "numba",
        "scipy.optimize",
        "scipy.sparse.linalg",
        "scipy.spatial",
        "igl",
        "pyvista",
        "hypothesis",
        "pytest",
    )
    for name in libraries:  # imported once, not by every fork
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    skipped, table = _equivalent(), []
    for folder, mutants in by_folder.items():
        counted = [mutant for mutant in mutants if str(mutant) not in skipped]
        chosen = random.Random(given.seed).sample(counted, min(given.n, len(counted)))
        results = [result for _, result in measured(folder, chosen, given.processes)]
        counts = [results.count(result) for result in ("killed", "timeout", "survived")]
        table.append((folder or "(top)", len(counted), *counts))
    print(f"\n{'folder':24}  mutants  tested  killed  timeout  survived  kill rate")
    for folder, n, *counts in table:
        rate = 100.0 * (counts[0] + counts[1]) / max(sum(counts), 1)
        killed, timeout, survived = counts
        print(
            f"{folder:24}  {n:7}  {sum(counts):6}  {killed:6}  {timeout:7}  {survived:8}  {rate:7.0f} %"
        )
    tested = sum(sum(row[2:]) for row in table)
    killed = sum(sum(row[2:4]) for row in table)
    return int(100.0 * killed < given.least * tested)


if __name__ == "__main__":
    sys.exit(main())
