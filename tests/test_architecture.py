"""The arrows of the house, enforced by reading the source.

Each chapter may import the ones before it in the story, and only the libraries it is granted.
"""

from __future__ import annotations

import ast
import functools
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "vtk_segdeform"
WIDGETS = ROOT / "widgets"  # installed as vtk_segdeform.widgets

# One line per part of the story; a new file takes its place here.
STORY = [
    "version",
    # a checked mesh
    "errors", "checks", "arrays", "progress", "lock", "regular_file", "atomic", "threads",
    "compiled.kernels", "compiled.volumes", "compiled.products", "compiled.patch_products",
    "compiled.normals", "compiled.rotations", "compiled.triangles", "compiled.coordinates", "fast",
    "surface.counting", "surface.topology", "surface.manifold", "surface.inside", "surface.columns",
    "surface.intersections", "surface.report", "surface.shells", "faults", "freezing", "mesh",
    "surface.quality", "surface.borders", "surface.lids", "surface.ears", "surface.lid_refining",
    "surface.holes", "surface.cracks", "surface.splitting", "surface.repair_steps", "repair",
    # what a deformation keeps
    "volume", "normals", "segmenting.thinning", "local_volume", "distortion", "intrinsic",
    "differential", "rotations",
    # regions and their cages
    "blending", "regions", "segmenting.coarse", "segmenting.borders",
    "segmenting.necks", "segmenting.slices", "segmentation", "mean_value", "blocks", "cages",
    "caging.region_solid", "caging.contour", "caging.cage_simplify", "cage_fit",
    # the solver
    "subspace", "passengers", "sampling", "operators", "grams", "patches", "energy",
    "cage_stiffness", "curvature", "grouping", "constraints", "stand_in", "bound", "binding",
    "device", "gpu", "landing", "positions", "acceleration", "solution", "iteration",
    "solver", "stiffening", "targets", "deformer", "pipeline",
    # a deformation in the making
    "editing.listeners", "editing.naming", "editing.state", "editing.history", "editing.painting",
    "editing.handles", "editing.posing", "session", "editing.archive", "store",
    # meshes from code, from files, and as pictures
    "modelling.remeshing", "modelling.implicit", "models", "formats.array_names",
    "formats.neighbours", "formats.polygons", "formats.off", "formats.ply_tables", "formats.ply",
    "formats.wavefront", "formats.stl", "formats.gltf_buffers", "formats.gltf",
    "formats.reading_child", "formats.isolated", "formats.vtk_readers", "formats.vtk_writers",
    "formats.meshlab_layers", "meshlab", "convert", "repaired", "meshlab_project", "palette",
    "canvas", "pictures",
    # a VTK pipeline
    "formats.vtk_surfaces", "filter_settings", "filters", "paraview_plugin",
    # a view, and widgets in it
    "widgets.gestures", "widgets.sight", "widgets.front", "widgets.view", "widgets.widget",
    "widgets.surface_display",
    # painting
    "widgets.painting.surface_distance", "widgets.painting.visibility", "widgets.picking",
    "widgets.painting.region_colours", "widgets.painting.roles", "widgets.painting.outline",
    "widgets.painting.brush_ring", "widgets.painting.strokes", "widgets.region_selector",
    # cages
    "widgets.caging.wires", "widgets.caging.reach", "widgets.caging.rejected_cage",
    "widgets.caging.cage_drag", "widgets.cage_display",
    # dragging
    "widgets.dragging.gizmo_shapes", "widgets.dragging.gizmo_solids", "widgets.dragging.panels",
    "widgets.dragging.gizmo_label", "widgets.dragging.gizmo", "widgets.dragging.handle_motion",
    "widgets.dragging.handle_marks", "widgets.dragging.pace", "widgets.dragging.live_solve",
    "widgets.handle_dragger",
    # what becomes of the volume
    "widgets.colouring.diverging", "widgets.colouring.legend", "widgets.colouring.region_volumes",
    "widgets.volume_overlay",
    # recordings and films
    "widgets.filming.words", "widgets.filming.transcript", "widgets.filming.limits",
    "widgets.filming.confinement", "widgets.filming.reading", "widgets.recording",
    "widgets.filming.film_files", "widgets.filming.off_screen", "widgets.film",
    # the editor
    "widgets.editing.jobs", "widgets.editing.status_line", "widgets.editing.help_card",
    "widgets.editing.voice", "widgets.editing.log", "widgets.editing.work", "widgets.editing.stage",
    "widgets.editing.hints", "widgets.editing.session_file", "widgets.editing.takes",
    "widgets.editing.desk", "widgets.editing.actions", "widgets.editing.take_actions",
    "widgets.editing.bindings", "widgets.editor",
    # pyvista's extension points
    "plugin",
    # the editor in Qt
    "widgets.editing.panel_actions", "widgets.panel.controls", "widgets.panel.modes",
    "widgets.panel.painting", "widgets.panel.regions", "widgets.panel.handles",
    "widgets.panel.options", "widgets.panel.foot", "widgets.panel.log", "widgets.panel.panel",
    "widgets.qt",
    # the desktop program
    "widgets.app.autosave", "widgets.app.documents", "widgets.app.recent",
    "widgets.app.keeper", "widgets.app.opening", "widgets.app.start_page", "widgets.app.drops",
    "widgets.app.pages", "widgets.app.asking", "widgets.app.saving", "widgets.app.menus",
    "widgets.app.window",
    # the paper's experiments and its peers, measured
    "benchmarks.measuring", "benchmarks.scale", "benchmarks.sections", "benchmarks.charts",
    "benchmarks.history",
    "benchmarks.tasks", "benchmarks.drags", "benchmarks.drawing", "benchmarks.programs",
    "benchmarks.frame_profile", "benchmarks.drag_profile", "benchmarks.table_one",
    "benchmarks.segmentation_study", "benchmarks.experiments", "benchmarks.full_space",
    "benchmarks.peers", "benchmarks.cage_making", "benchmarks.report",
    # the command line
    "command_line.selection", "command_line.motion", "command_line.outputs", "command_line.demo",
    "command_line.interactive", "command_line.bench", "command_line.commands",
    "command_line.progress_bar", "command_line.replaying", "command_line.application",
    "cli", "__main__",
]  # fmt: skip

NUMERIC = {"numpy", "scipy"}
VTK = {"vtkmodules"}
PANEL = {"controls", "modes", "painting", "regions", "handles", "options", "foot", "log", "panel"}
PROGRAM = {
    "keeper", "opening", "start_page", "drops", "pages", "asking", "saving", "menus", "window",
}  # fmt: skip
GRANTED = {
    "threads": {"threadpoolctl"},
    "gpu": {"cupy", "torch"},
    "compiled.kernels": {"numba"},
    "caging.contour": VTK,
    "modelling.implicit": VTK,
    "formats.array_names": VTK | {"pyvista"},
    "formats.polygons": VTK | {"pyvista"},
    "formats.off": {"pyvista"},
    "formats.ply": {"pyvista"},
    "formats.wavefront": {"pyvista"},
    "formats.stl": {"pyvista"},
    "formats.gltf": {"pyvista"},
    "formats.vtk_readers": {"pyvista"},
    "formats.vtk_writers": {"pyvista", *VTK},
    "formats.meshlab_layers": {"pyvista"},
    "meshlab": {"pymeshlab", "pyvista"},
    "meshlab_project": {"pyvista"},
    "convert": VTK | {"pyvista"},
    "repaired": {"pyvista"},
    "canvas": VTK | {"pyvista"},
    "pictures": VTK | {"pyvista"},
    "formats.vtk_surfaces": VTK,
    "filter_settings": VTK,
    "filters": VTK,
    "paraview_plugin": {"paraview"},
    "benchmarks.charts": {"matplotlib"},
    "benchmarks.drawing": VTK,
    "benchmarks.programs": {"igl", "open3d", "bpy"},
    "benchmarks.experiments": {"pyvista"},
    "benchmarks.cage_making": VTK | {"igl", "gpytoolbox"},
    "command_line.outputs": {"pyvista"},
    "command_line.replaying": {"pyvista"},
    "plugin": {"pyvista"},
    **{f"widgets.panel.{name}": {"qtpy"} for name in PANEL},
    "widgets.qt": {"qtpy", "pyvista", "pyvistaqt"},
    **{f"widgets.app.{name}": {"qtpy"} for name in PROGRAM},
    "command_line.application": {"qtpy"},
}

MAY_PRINT_AND_EXIT = {"cli", "__main__", "paraview_plugin"}
LONGEST = 400
FILES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts): path
    for path in sorted(PACKAGE.rglob("*.py"))
} | {
    ".".join(("widgets", *path.relative_to(WIDGETS).with_suffix("").parts)): path
    for path in sorted(WIDGETS.rglob("*.py"))
}
NAMES = [name for name in FILES if not name.endswith("__init__")]
CHAPTERS = [name for name in STORY if name in NAMES]


@functools.cache
def tree_of(name: str) -> ast.Module:
    """Return a file as it is parsed; nobody changes it."""
    return ast.parse(FILES[name].read_text())


@functools.cache
def nodes_of(name: str) -> tuple[ast.AST, ...]:
    """Return all nodes of a file, which takes longer than what is asked of them."""
    return tuple(ast.walk(tree_of(name)))


@functools.cache
def calls_in(name: str) -> tuple[tuple[str, ast.Call], ...]:
    """Return all calls in a file, each with the text of what it calls."""
    calls = (node for node in nodes_of(name) if isinstance(node, ast.Call))
    return tuple((ast.unparse(call.func), call) for call in calls)


@functools.cache
def imports(name: str) -> frozenset[tuple[str, bool]]:
    """Return (module, is ours) for every import anywhere in a file, inside functions too."""
    return frozenset(_imports(name))


def _imports(name: str) -> Iterator[tuple[str, bool]]:
    folder = name.split(".")[:-1]
    for node in nodes_of(name):
        if isinstance(node, ast.Import):
            yield from ((alias.name.partition(".")[0], False) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level:
            named = [*folder[: len(folder) + 1 - node.level], *(node.module or "").split(".")]
            named = [part for part in named if part]
            if ".".join([*named, "__init__"]) in FILES or not named:
                yield from ((".".join([*named, alias.name]), True) for alias in node.names)
            else:
                yield ".".join(named), True
        elif isinstance(node, ast.ImportFrom):
            package, _, module = str(node.module).partition(".")
            if package != "vtk_segdeform":
                yield package, False
            elif module:
                yield module, True
            else:
                yield from ((alias.name, True) for alias in node.names)


def none(offences: Iterable[str]) -> None:
    """Fail with all the *offences* at once, "file: offence" each."""
    found = sorted(set(offences))
    assert not found, "\n" + "\n".join(found)


def test_every_file_has_its_place_in_the_story():
    assert sorted(STORY) == sorted(NAMES)
    assert len(set(STORY)) == len(STORY)


def test_a_chapter_imports_only_earlier_ones():
    places = {name: place for place, name in enumerate(STORY)}
    none(
        f"{name}: imports {module}, which the story tells later"
        for name in CHAPTERS
        for module, ours in imports(name)
        if ours and places.get(module, len(STORY)) >= places[name]
    )


def test_a_chapter_imports_only_the_libraries_it_is_granted():
    everywhere = NUMERIC | set(sys.stdlib_module_names)
    none(
        f"{name}: imports {module}"
        for name in CHAPTERS
        for module, ours in imports(name)
        if not ours
        and module not in everywhere
        and module not in GRANTED.get(name, VTK if name.startswith("widgets.") else set())
    )


def test_a_chapter_is_short_enough_to_read_at_once():
    lengths = {name: path.read_text().count("\n") for name, path in FILES.items()}
    none(
        f"{name}: {length} lines; say 'Long because ...' or split it"
        for name, length in lengths.items()
        if length > LONGEST and "Long because" not in (ast.get_docstring(tree_of(name)) or "")
    )


def test_a_chapter_begins_by_saying_what_it_is():
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


def test_a_chapter_changes_no_global_state_and_evaluates_no_text():
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
        if name.startswith("compiled."):
            continue  # numba wants arguments by position
        for node in nodes_of(name):
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                positional = [a.arg for a in node.args.posonlyargs + node.args.args]
                positional = [arg for arg in positional if arg not in ("self", "cls")]
                if len(positional) > 4:
                    offences.append(f"{name}: {node.name}({', '.join(positional)}): use keywords")
    none(offences)


# Given a draft to write to; the log of a recording, which grows event by event; and /proc.
WRITE_TO_WHAT_THEY_ARE_GIVEN = {
    "formats.off", "formats.ply", "formats.wavefront", "formats.vtk_writers",
    "formats.reading_child", "widgets.filming.film_files", "widgets.recording",
    "benchmarks.measuring",
}  # fmt: skip
REPLACING = {
    "os.replace", "os.rename", "os.renames", "os.link", "shutil.move", "tempfile.mkstemp",
    "tempfile.mktemp", "tempfile.NamedTemporaryFile", "NamedTemporaryFile", "mkstemp",
}  # fmt: skip


def test_files_are_replaced_in_one_place():
    none(
        f"{name}: {ast.unparse(call)}: use atomic.replacing"
        for name in FILES
        if name != "atomic"
        for what, call in calls_in(name)
        if _replaces(what, call)
    )


def test_files_are_written_only_where_they_are_replaced():
    none(
        f"{name}: {ast.unparse(call)}: write to a draft of atomic.replacing"
        for name in FILES
        if name not in {"atomic", *WRITE_TO_WHAT_THEY_ARE_GIVEN}
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
    """Tell whether a call puts a file in the place of another one."""
    renames = what.endswith((".rename", ".replace")) and len(call.args) == 1
    return what in REPLACING or (renames and not call.keywords)


def _writes(what: str, call: ast.Call) -> bool:
    """Tell whether a call writes a file."""
    if what.endswith((".write_text", ".write_bytes", ".savefig", ".SetFileName", "np.savez")):
        return True
    texts = [*call.args, *(word.value for word in call.keywords)]
    modes = [str(text.value) for text in texts if isinstance(text, ast.Constant)]
    opens = what == "open" or what.endswith(".open")
    return opens and any(set(mode) <= set("wxabt+") and set(mode) & set("wxa") for mode in modes)


TIMERS = {
    "CreateTimer", "CreateOneShotTimer", "CreateRepeatingTimer", "DestroyTimer", "ResetTimer",
    "add_timer_event", "create_timer", "destroy_timer",
}  # fmt: skip


def test_only_the_view_creates_and_destroys_vtk_timers():
    """Hosts may have one timer behind all of them, so a second owner would stop the first's."""
    none(
        f"{name}: {word}"
        for name in FILES
        if name != "widgets.view"
        for node in nodes_of(name)
        for word in (getattr(node, "attr", None), getattr(node, "value", None))
        if isinstance(node, ast.Attribute | ast.Constant)
        if isinstance(word, str) and word in TIMERS
    )
