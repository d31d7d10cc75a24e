"""The rules of the house, checked by reading the source.

A room is a folder, or a single file at the top; it imports only from rooms before it in `ROOMS`,
and only what their faces (`__init__.py`) name in `__all__`.  Run as a program, this file prints
the rooms, their floors and their sizes.
"""

from __future__ import annotations

import ast
import functools
import gc
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "vtk_segdeform"
WIDGETS = ROOT / "widgets"  # installed as vtk_segdeform.widgets

# In the order of imports; the second row is the method, in the order of the paper.
ROOMS = [
    "version", "importing", "errors", "interpreter", "sizes", "checks", "arrays", "progress",
    "freezing", "files", "kernels",
    "mesh", "mesh_repair", "geometry", "regions", "cages", "subspace", "energy", "solver",
    "finish", "deformer", "autograd", "io", "landmarks", "inside", "any_mesh", "motions", "batches",
    "session", "models", "pictures", "filters",
    "widgets.scene", "widgets.picking", "widgets.region_selector", "widgets.cage_display",
    "widgets.handle_dragger", "widgets.puller", "widgets.volume_overlay", "widgets.films",
    "widgets.editor", "widgets.panel", "widgets.hosting",
    "widgets.web.drawing", "widgets.web",
    "widgets", "widgets.plugin", "widgets.qt", "widgets.app", "benchmarks", "cli", "__main__",
]  # fmt: skip
MOST_FLOORS = 27  # two of them for the page in the browser, one for fits in a session
MOST_IMPORTS = 441  # pairs of rooms of which one imports from the other
MOST_FILES = 25  # in one folder

NUMERIC = {"numpy", "scipy"}
VTK = {"vtkmodules"}
# Libraries beyond numpy and scipy, by file or by room.
GRANTED = {
    "files.folders": {"platformdirs"},
    "kernels.threads": {"threadpoolctl"},
    "kernels.compiled.kernels": {"numba"},
    "cages.contour": VTK,
    "subspace.gpu": {"cupy", "torch"},
    "models.implicit": VTK,
    "autograd": {"torch"},
    "io": {"pyvista"},
    "io.array_names": VTK,
    "io.convert": VTK,
    "io.grids": VTK,
    "io.meshlab": {"pymeshlab"},
    "io.polygons": VTK,
    "io.reading_child": VTK | {"pymeshlab"},
    "io.vtk_arrays": VTK,
    "io.vtk_formats": VTK,
    "landmarks.followers": {"pyvista"},
    "inside": {"pyvista"},
    "any_mesh": {"pyvista"},
    "batches.remote": {"fsspec"},
    "batches.store": {"pyarrow"},
    "session.output": {"pyvista"},
    "session.session": {"pyvista"},
    "session.surface_store": VTK | {"pyvista"},
    "pictures": VTK | {"pyvista"},
    "filters": VTK,
    "filters.paraview_plugin": {"paraview"},
    **{room: VTK for room in ROOMS if room.startswith("widgets")},
    "widgets.scene.qt_events": {"qtpy"},
    "widgets.hosting": VTK | {"pyvista"},
    "widgets.plugin": {"pyvista"},
    "widgets.qt": VTK | {"qtpy"},
    "widgets.qt.widget": {"pyvista", "pyvistaqt"},
    "widgets.app": VTK | {"qtpy"},
    "widgets.app.repair_preview": {"pyvista", "pyvistaqt"},
    "widgets.web.pictures": VTK | {"PIL"},
    "widgets.web.answers": {"wslink"},
    "widgets.web.protocol": {"wslink"},
    "widgets.web.transfer": {"aiohttp"},
    "widgets.web.notebook": {"IPython"},
    "widgets.web.tunnel": {"aiohttp"},
    "widgets.web.whole_page": {"trame_client"},
    "widgets.web.widget": {"anywidget", "traitlets"},
    "widgets.web.web_editor": {"pyvista", "trame", "trame_client", "trame_server", "wslink"},
    "widgets.web.access": {"aiohttp"},
    "widgets.web.serving": {"aiohttp"},
    "benchmarks.peers": {"igl"},
    "benchmarks.solids": {"pyvista"},
    "cli.application": {"qtpy"},
    "cli.batching": {"distributed"},
    "cli.outputs": {"pyvista"},
}

MAY_PRINT_AND_EXIT = {
    "cli.main", "__main__", "filters.paraview_plugin", "io.reading_child",
}  # fmt: skip
LONGEST = 400
FILES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts): path
    for path in sorted(PACKAGE.rglob("*.py"))
} | {
    ".".join(("widgets", *path.relative_to(WIDGETS).with_suffix("").parts)): path
    for path in sorted(WIDGETS.rglob("*.py"))
}
NAMES = [name for name in FILES if not name.endswith("__init__")]


@pytest.fixture(scope="module", autouse=True)
def no_garbage_collection() -> Iterator[None]:
    """Do not search the nodes of all files for garbage, which takes as long as parsing them."""
    gc.disable()
    yield
    gc.enable()


class Import(NamedTuple):
    """One imported name: of which module, and whether that is ours."""

    module: str
    name: str
    ours: bool


@functools.cache
def room_of(name: str) -> str:
    """Return the room of a file or a module: the longest prefix of its name in `ROOMS`."""
    parts = name.removesuffix(".__init__").split(".")
    prefixes = (".".join(parts[:n]) for n in range(len(parts), 0, -1))
    return next((prefix for prefix in prefixes if prefix in ROOMS), "")


@functools.cache
def tree_of(name: str) -> ast.Module:
    """Return the syntax tree of a file, which must not be changed."""
    return ast.parse(FILES[name].read_text())


@functools.cache
def nodes_of(name: str) -> tuple[ast.AST, ...]:
    """Return all nodes of a file; cached, since walking the tree dominates the tests.

    Unlike `ast.walk` it leaves out positions and contexts, which takes a third of its time.
    """
    found: list[ast.AST] = [tree_of(name)]
    for node in found:
        for value in vars(node).values():
            if isinstance(value, list):
                found += [each for each in value if isinstance(each, ast.AST)]
            elif isinstance(value, ast.AST) and not isinstance(value, ast.expr_context):
                found.append(value)
    return tuple(found)


@functools.cache
def calls_in(name: str) -> tuple[tuple[str, ast.Call], ...]:
    """Return all calls in a file, each with the text of what it calls."""
    calls = (node for node in nodes_of(name) if isinstance(node, ast.Call))
    return tuple((ast.unparse(call.func), call) for call in calls)


@functools.cache
def imports(name: str) -> frozenset[Import]:
    """Return every import anywhere in a file, inside functions too."""
    return frozenset(_imports(name))


def _imports(name: str) -> Iterator[Import]:
    folder = name.split(".")[:-1]
    for node in nodes_of(name):
        if isinstance(node, ast.Import):
            yield from (Import(alias.name.partition(".")[0], "", False) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            package, _, module = str(node.module or "").partition(".")
            ours = bool(node.level) or package == "vtk_segdeform"
            if node.level:
                parts = [*folder[: len(folder) + 1 - node.level], *filter(None, (package, module))]
                module = ".".join(parts)
            for alias in node.names if ours else ():
                inner = ".".join(filter(None, (module, alias.name)))
                if alias.name in face(module):
                    yield Import(module, alias.name, True)
                elif inner in FILES or (f"{inner}.__init__" in FILES and inner in ROOMS):
                    yield Import(inner, "", True)
                else:
                    yield Import(module, alias.name, True)
            if not ours:
                yield Import(package, "", False)


@functools.cache
def face(room: str) -> frozenset[str]:
    """Return the names in the `__all__` of a room, which is all that other rooms may import."""
    for node in nodes_of(f"{room}.__init__") if f"{room}.__init__" in FILES else ():
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return frozenset(ast.literal_eval(node.value))
    return frozenset()


@functools.cache
def between_rooms() -> tuple[tuple[str, Import], ...]:
    """Return every file, faces left out, with each of its imports from another room."""
    return tuple(
        (name, what)
        for name in NAMES
        for what in imports(name)
        if what.ours and room_of(what.module) != room_of(name)
    )


def floors() -> dict[str, int]:
    """Return the floor of each room: one above the highest room that it imports."""
    found: dict[str, int] = {}
    for room in ROOMS:
        below = {room_of(what.module) for name, what in between_rooms() if room_of(name) == room}
        found[room] = 1 + max((found.get(other, 0) for other in below), default=0)
    return found


def none(offences: Iterable[str]) -> None:
    """Fail with all the *offences* at once, "file: offence" each."""
    found = sorted(set(offences))
    assert not found, "\n" + "\n".join(found)


def test_every_file_is_in_a_room():
    none(f"{name}: in no room" for name in NAMES if not room_of(name))
    none(f"{room}: no such folder or file" for room in ROOMS if not _exists(room))
    assert len(set(ROOMS)) == len(ROOMS)


def _exists(room: str) -> bool:
    return room in FILES or f"{room}.__init__" in FILES


def test_a_room_imports_only_from_rooms_before_it():
    place = {room: n for n, room in enumerate(ROOMS)}
    none(
        f"{name}: imports {what.name} from {what.module}, a later room"
        for name, what in between_rooms()
        if place.get(room_of(what.module), len(ROOMS)) >= place[room_of(name)]
    )


def test_rooms_import_each_other_through_their_faces():
    """`from ..mesh import Mesh`, never `from ..mesh.topology import`; only names in `__all__`."""
    none(
        f"{name}: imports {what.name or 'all'} of {what.module}; import it from its folder"
        for name, what in between_rooms()
        if f"{room_of(what.module)}.__init__" in FILES and not _through_the_face(what)
    )


def _through_the_face(what: Import) -> bool:
    room = room_of(what.module)
    return what.module == room and (not what.name or what.name in face(room))


def test_the_files_of_a_room_import_each_other_in_one_direction():
    graph = {
        name: {w.module for w in imports(name) if w.ours and room_of(w.module) == room_of(name)}
        for name in NAMES
    }
    none(
        f"{name}: imports itself by way of {graph[name] & _reached(graph, name)}"
        for name in NAMES
        if name in _reached(graph, name)
    )


def _reached(graph: dict[str, set[str]], start: str) -> set[str]:
    found: set[str] = set()
    todo = [start]
    while todo:
        new = graph.get(todo.pop(), set()) - found
        found |= new
        todo += new
    return found


def test_floors_imports_and_folders_are_few():
    assert max(floors().values()) <= MOST_FLOORS
    assert (
        len({(room_of(name), room_of(what.module)) for name, what in between_rooms()})
        <= MOST_IMPORTS
    )
    sizes = Counter(name.rpartition(".")[0] for name in NAMES)
    none(f"{folder}: {size} files" for folder, size in sizes.items() if size > MOST_FILES)


def test_the_docstring_of_a_face_lists_all_files():
    """A folder's docstring lists its files in reading order."""
    none(
        f"{folder}: {name} is not in the docstring of __init__.py"
        for folder, name in (name.rpartition(".")[::2] for name in NAMES)
        if folder not in {"", "widgets", "kernels.compiled"}
        and name not in (ast.get_docstring(tree_of(f"{folder}.__init__")) or "").split()
    )


def test_a_room_imports_only_the_libraries_in_its_list():
    everywhere = NUMERIC | set(sys.stdlib_module_names)
    none(
        f"{name}: imports {what.module}"
        for name in NAMES
        for what in imports(name)
        if not what.ours
        and what.module
        not in everywhere | GRANTED.get(name, set()) | GRANTED.get(room_of(name), set())
    )


def test_a_long_file_says_why():
    lengths = {name: path.read_text().count("\n") for name, path in FILES.items()}
    none(
        f"{name}: {length} lines; say 'Long because ...' or split it"
        for name, length in lengths.items()
        if length > LONGEST and "Long because" not in (ast.get_docstring(tree_of(name)) or "")
    )


def test_every_file_has_a_docstring():
    none(f"{name}: no docstring" for name in FILES if not ast.get_docstring(tree_of(name)))


def test_only_the_command_line_prints_or_exits():
    forbidden = {
        "print", "exit", "quit", "input", "sys.exit", "os._exit", "sys.stdout.write",
        "sys.stderr.write",
    }  # fmt: skip
    silent = [name for name in FILES if name not in MAY_PRINT_AND_EXIT]
    none(
        f"{name}: calls {what}"
        for name in silent
        for what in forbidden & {called for called, _ in calls_in(name)}
    )
    none(
        f"{name}: names SystemExit"
        for name in silent
        for node in nodes_of(name)
        if isinstance(node, ast.Name) and node.id == "SystemExit"
    )


def test_no_file_changes_global_state_or_evaluates_text():
    forbidden = {
        "eval", "exec", "compile", "np.random.seed", "np.seterr", "warnings.filterwarnings",
        "warnings.simplefilter", "logging.basicConfig", "pickle.load", "pickle.loads",
    }  # fmt: skip
    none(
        f"{name}: calls {what}"
        for name in FILES
        for what in forbidden & {called for called, _ in calls_in(name)}
    )
    none(
        f"{name}: {ast.unparse(node)}"
        for name in FILES
        for node in nodes_of(name)
        if isinstance(node, ast.Global)
    )


def test_public_functions_take_at_most_four_positional_arguments():
    offences = []
    for name in FILES:
        if name.startswith("kernels.compiled."):
            continue  # numba wants arguments by position
        for node in nodes_of(name):
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                positional = [a.arg for a in node.args.posonlyargs + node.args.args]
                positional = [arg for arg in positional if arg not in ("self", "cls")]
                if len(positional) > 4:
                    offences.append(f"{name}: {node.name}({', '.join(positional)}): use keywords")
    none(offences)


# Ctrl+C ends them, and so the process; ParaView loads its file before the package; PyMeshLab has to
# be imported in the main thread.
MAY_BE_INTERRUPTED = (
    "cli", "benchmarks", "io.reading_child", "io.meshlab", "filters.paraview_plugin",
)  # fmt: skip


def test_imports_in_functions_are_completed_though_interrupted():
    """`imported("a.module")` comes before `from a.module import ...`; see importing.py."""
    found = [name for name in FILES if not name.startswith(MAY_BE_INTERRUPTED)]
    found = [
        name for name in found if re.search(r"^ +(from|import) ", FILES[name].read_text(), re.M)
    ]
    none(
        f"{name}: {node.name} imports {ast.unparse(inner)} without `imported`"
        for name in found
        for node in nodes_of(name)
        if isinstance(node, ast.FunctionDef) and "imported(" not in ast.unparse(node)
        for inner in ast.walk(node)
        if isinstance(inner, ast.Import | ast.ImportFrom)
        if ast.unparse(inner) != "from . import WebEditor"  # which its face does
    )
    none(
        f"{name}: {what}: use importing.imported"
        for name in FILES
        if not name.startswith((*MAY_BE_INTERRUPTED, "importing"))
        for what, _ in calls_in(name)
        if what.endswith("import_module")
    )


def test_scipy_starts_no_threads():
    """They outlive a query that is interrupted, but not its arrays: use kernels.nearest."""
    none(
        f"{name}: {ast.unparse(call)}"
        for name in FILES
        for _, call in calls_in(name)
        if any(each.arg == "workers" for each in call.keywords)
    )


# ldd, and a command from `interpreter`; io.confined sets its child's path itself.
START_PROCESSES = {
    "interpreter", "cli.application", "io.confined", "kernels.compilation", "pictures.canvas",
}  # fmt: skip


def test_python_processes_are_started_in_one_way():
    """Otherwise they import from the working directory."""
    starts = r"\b(subprocess|get_context|sys\.executable|get_executable|os\.(system|spawn\w+))\b"
    none(
        f"{name}: {found[0]}: use interpreter.python_command or spawning"
        for name in FILES
        if name not in START_PROCESSES and (found := re.search(starts, FILES[name].read_text()))
    )
    none(
        f"{name}: sys.executable: use interpreter.python_command"
        for name in FILES
        if name != "interpreter" and "sys.executable" in FILES[name].read_text()
    )


WRITERS = re.findall(r"(?m)^from \.(\w+) import .*\bwrite_", FILES["io.convert"].read_text())
# They write to a draft from their caller, or to memory.
WRITE_DIRECTLY = {
    "batches.tasks",
    *(f"io.{name}" for name in WRITERS),
    "io.gltf.writing",
    "io.reading_child",
    "widgets.films.film_files",
}
REPLACING = {
    "os.replace", "os.rename", "os.renames", "os.link", "shutil.move", "tempfile.mkstemp",
    "tempfile.mktemp", "tempfile.NamedTemporaryFile", "NamedTemporaryFile", "mkstemp",
}  # fmt: skip


def test_files_are_replaced_in_one_place():
    none(
        f"{name}: {ast.unparse(call)}: use files.replacing"
        for name in FILES
        if name != "files.atomic"
        for what, call in calls_in(name)
        if _replaces(what, call)
    )


def test_files_are_written_only_where_they_are_replaced():
    none(
        f"{name}: {ast.unparse(call)}: write to a draft of files.replacing"
        for name in FILES
        if name not in {"files.atomic", *WRITE_DIRECTLY}
        for what, call in calls_in(name)
        if _writes(what, call) and id(call) not in _within_replacing(name)
    )


def _within_replacing(name: str) -> set[int]:
    """Return the ids of the calls of a file that are within `with replacing(...)`."""
    return {
        id(call)
        for block in nodes_of(name)
        if isinstance(block, ast.With)
        and any(_is_replacing(item.context_expr) for item in block.items)
        for call in ast.walk(block)
    }


def _is_replacing(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "replacing"


def _replaces(what: str, call: ast.Call) -> bool:
    """Return whether a call replaces a file."""
    renames = what.endswith((".rename", ".replace")) and len(call.args) == 1
    return what in REPLACING or (renames and not call.keywords)


def _writes(what: str, call: ast.Call) -> bool:
    """Return whether a call writes a file."""
    if what.endswith((".write_text", ".write_bytes", ".savefig", ".SetFileName", "np.savez")):
        return True
    texts = [*call.args, *(word.value for word in call.keywords)]
    modes = [str(text.value) for text in texts if isinstance(text, ast.Constant)]
    opens = what == "open" or what.endswith(".open")
    return opens and any(set(mode) <= set("wxabt+") and set(mode) & set("wxa") for mode in modes)


def _report() -> Iterator[str]:
    sizes = Counter(room_of(name) for name in NAMES)
    users = Counter(room_of(what.module) for _, what in between_rooms())
    for room, floor in sorted(floors().items(), key=lambda each: each[1]):
        yield f"{floor:3} {room:26} {sizes[room]:3} files, imported {users[room]} times"
    pairs = {(room_of(name), room_of(what.module)) for name, what in between_rooms()}
    yield f"{len(ROOMS)} rooms on {max(floors().values())} floors, {len(NAMES)} files"
    yield f"{len(pairs)} pairs of rooms of which one imports from the other"


if __name__ == "__main__":
    print("\n".join(_report()))
