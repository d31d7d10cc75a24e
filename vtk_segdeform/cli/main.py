"""The ``segdeform`` command: options, help and exit codes.

    0   success; of check: the surface can be deformed, or is repaired to a closed mesh
    1   it cannot, or the command failed; stderr gives the reason
    2   usage error: unknown option or value, invalid selection or motion
    130 interrupted by Ctrl+C

The module of a command is imported when the command runs, so that ``segdeform --help`` takes a
tenth of a second and loads neither numpy nor VTK.  This is the only module that prints.
Long because it has the options of every command.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import sys
from collections.abc import Callable, Sequence
from ctypes.util import find_library
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from .. import sizes
from ..errors import ConstraintError, SegDeformError
from ..version import __version__
from .progress_bar import ProgressBar

_VECTOR_OPTIONS = ("--rotate", "--pivot", "--translate", "--at", "--to", "--pin")
# Options with the name and the values of the parameter of `Deformer` that they set.
AS_IN_PYTHON = ("avoid_contact", "symmetry", "stretch", "rotation_groups")
# Parameters of Python whose options have other names.
_OPTIONS_OF = {
    "locality": ("local",),
    "n_vertices": ("cage_vertices", "size"),
}
DONE, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130

# Command -> module of this folder; the function has the name of the command.
COMMANDS = {
    "demo": "demo",
    "pull": "pulling",
    "deform": "commands",
    "landmarks": "fitting",
    "edit": "commands",
    "app": "application",
    "serve": "serving",
    "check": "checking",
    "motion": "motions",
    "subdivide": "subdividing",
    "regions": "commands",
    "cages": "commands",
    "batch": "batching",
    "pose": "batching",
    "bench": "bench",
}
# The keys of `benchmarks.EXPERIMENTS`, which is not imported for the help.
EXPERIMENTS = (
    "drag", "constraints", "open", "landmarks", "mechanisms", "batch", "paper", "peers", "solids",
)  # fmt: skip

_SELECTION = """\
selections (SEL):
  z>80%, x<=0.25   half-space: percentage of the bounding box, or model units
  ids.txt          text file of point ids, counted from 0
  pose.sel         text file with one number per point: 0 fixed, 1 free, 2 handle
  name, name=2     point array: non-zero values, or values equal to 2
  z>80%&x<10%      points in both selections
"""

_EXAMPLES = """\
examples:
  segdeform demo -o demo-output
  segdeform pull horse.ply -o pulled.ply --at 0.1,0,0.9 --to 0.2,0,1.1
  segdeform motion rest.ply bent-1.ply bent-2.ply bent-3.ply -o bend.glb
  segdeform check scan.ply --repair -o closed.ply
  segdeform subdivide part.stl -o fine.stl
  segdeform edit horse.ply -o bent.ply
  segdeform app horse.ply
  segdeform serve horse.ply --open
  segdeform deform horse.ply -o bent.ply --fixed 'z<10%' --handle 'z>90%' --rotate y,45
  segdeform deform a.off -o b.off --fixed a.sel --handle a.sel --matrix a.def --regions auto
  segdeform deform in.vtp -o out.vtp --fixed 'z<5%' \\
      --handle left.txt --translate 0,0,0.2   --handle right.txt --rotate x,30 --pivot 0,0,1
  segdeform deform part.vtu -o bent.vtu --fixed 'z<10%' --handle 'z>90%' --rotate y,45
  segdeform batch plan.json -o poses
  segdeform deform heart.ply -o pumped.ply --volume 'cavity=-40%' --volume wall=keep
  segdeform landmarks atlas.ply -o patient.ply --source atlas.fcsv --target patient.mrk.json
  segdeform regions horse.ply -o regions.vtp --regions 6
  segdeform cages horse.ply -o cages.vtp --regions 6 --cage-vertices 300

exit codes:
  0    success; for check: the surface can be deformed, or was repaired to a closed mesh; for deform
       and pull also where the report says that the pose has crossings, folds or not converged
  1    the command failed; for check: it cannot be deformed, or the repair left it open; for deform
       and pull also where the mesh was written, but a handle misses its target by 0.1 % of its size
       or a volume its goal
  2    usage error
  130  interrupted by Ctrl+C
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    try:
        options, unknown = _parser().parse_known_args(_with_signed_vectors(words))
        if unknown:
            options.parser.error(_unknown_words(options.parser, unknown))
    except SystemExit as end:  # argparse has printed its usage, help or version
        return int(end.code or 0)
    _render_without_display()
    bar = ProgressBar(sys.stderr)

    def say(line: str) -> None:
        bar.clear()
        print(_printable(line), flush=True)

    warnings = _Warnings(options.command, bar)
    logging.getLogger("vtk_segdeform").addHandler(warnings)
    try:
        return DONE if command(options.command)(options, say, bar) else FAILED
    except KeyboardInterrupt:
        bar.clear()
        return INTERRUPTED
    except BrokenPipeError:  # the reader, such as head or less, has quit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except (SegDeformError, OSError, ValueError, RuntimeError, MemoryError) as error:
        bar.clear()
        if options.debug:
            raise
        text = _by_option(_one_line(error), options)
        print(f"segdeform {options.command}: {_printable(text)}", file=sys.stderr)
        is_misused = isinstance(error, ConstraintError) or text.startswith("--")
        return MISUSED if is_misused else FAILED
    finally:
        logging.getLogger("vtk_segdeform").removeHandler(warnings)


def command(name: str) -> Callable[..., bool]:
    """Import the module of a command and return the function that runs it."""
    run: Callable[..., bool] = getattr(import_module(f".{COMMANDS[name]}", __package__), name)
    return run


class _Warnings(logging.Handler):
    """Prints the package's warnings, for example about arrays that a file format cannot store."""

    def __init__(self, command: str, bar: ProgressBar) -> None:
        super().__init__(logging.WARNING)
        self._command, self._bar = command, bar

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record on its own line."""
        self._bar.clear()
        text = _printable(record.getMessage())
        print(f"segdeform {self._command}: {text}", file=sys.stderr)


def _render_without_display() -> None:
    """Select EGL where there is no X server; VTK would otherwise warn at every picture."""
    if sys.platform != "linux" or os.environ.get("DISPLAY"):
        return
    name = "VTK_DEFAULT_OPENGL_WINDOW"
    if name not in os.environ and find_library("EGL"):  # which starts a process
        os.environ[name] = "vtkEGLRenderWindow"


def _printable(line: str) -> str:
    r"""Return *line* with all unprintable characters escaped.

    Names of files, and names in files, may contain anything: line breaks, and sequences by which a
    terminal moves its cursor or changes its title.

    >>> print(_printable("a\x1b[2Jb\nc"))
    a\x1b[2Jb\nc
    """
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)
    encoding = sys.stdout.encoding or "utf-8"
    return shown.encode(encoding, "backslashreplace").decode(encoding)


def _one_line(error: Exception) -> str:
    """Return the message of an error on one line."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        return "out of memory"
    return " ".join(str(error).split()) or type(error).__name__


def _by_option(text: str, options: argparse.Namespace) -> str:
    """Return a message about a parameter of Python as one about the option that sets it.

    >>> _by_option("n_regions must be 1 or more; got 0", argparse.Namespace(regions=0))
    '--regions must be 1 or more; got 0'
    """
    name, must, rest = text.partition(" must ")
    for option in (name.removeprefix("n_"), *_OPTIONS_OF.get(name, ())):
        if must and option in vars(options):
            return f"--{option.replace('_', '-')} must {rest.replace(' or None', '')}"
    return text


def _with_signed_vectors(words: Sequence[str]) -> list[str]:
    """Join "--pivot -1,0,0" by "=", because argparse would parse -1,0,0 as an option."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] in _VECTOR_OPTIONS and re.match(r"-[\d.]", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


class _HandleOption(argparse.Action):
    """--handle starts a handle; the motion options that follow belong to it."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        handles = list(getattr(namespace, "handles", None) or [])
        if self.dest == "handle":
            handles.append({"select": values})
        elif not handles:
            parser.error(f"{option_string} must come after the --handle it applies to")
        elif self.dest in handles[-1]:
            parser.error(f"{option_string} was given twice for the same handle")
        else:
            handles[-1] = {**handles[-1], self.dest: values}
        namespace.handles = handles


class _Version(argparse.Action):
    """--version also names missing libraries that affect speed, and weaker protection."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from ..files import landlock
        from ..kernels import advice

        print("\n".join(filter(None, (f"segdeform {__version__}", advice(), landlock.advice()))))
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """Prints errors about words that may be names of files."""

    def error(self, message: str) -> NoReturn:
        """Print *message* with the usage, and exit."""
        super().error(_printable(message))


def _parser() -> argparse.ArgumentParser:
    form = argparse.RawDescriptionHelpFormatter
    parser = _Parser(
        prog="segdeform",
        description="Deform surfaces by moving handles, with detail and volume preserved.",
        epilog=_EXAMPLES,
        formatter_class=form,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    parser.add_argument("--debug", action="store_true", help="show the traceback of errors")
    subparsers = parser.add_subparsers(
        title="commands", dest="command", metavar="COMMAND", required=True
    )

    def add_command(name: str, text: str, epilog: str = "") -> argparse.ArgumentParser:
        added = subparsers.add_parser(
            name, help=text, description=f"{text[0].upper()}{text[1:]}.", epilog=epilog,
            formatter_class=form, allow_abbrev=False,
        )  # fmt: skip
        added.set_defaults(parser=added)
        return added

    sub = add_command("demo", "bend the sample cactus; write meshes and pictures")
    _output_folder(sub, "demo-output")
    text = "number of mesh vertices (default: 5430)"
    sub.add_argument("--size", type=_count, default=5430, metavar="N", help=text)
    sub.add_argument("--no-pictures", action="store_true", help="write no pictures")

    sub = add_command("pull", "pull one point of a surface and write the result")
    _input_output(sub, "the deformed mesh", required=True)
    _pull(sub)

    sub = add_command("deform", "move handles of a mesh and write the result", _SELECTION)
    _input_output(sub, "the deformed mesh", required=True)
    _cages(sub)
    _handles(sub)

    sub = add_command("landmarks", "grow and bend a mesh to the targets of its landmarks")
    _input_output(sub, "the fitted mesh", required=True)
    _landmarks(sub)

    sub = add_command("edit", "deform a mesh or a saved session in a window")
    text = "the deformed mesh, written when the window is closed"
    _input_output(sub, text, session=True)
    _attach(sub)

    sub = add_command("app", "open the desktop program")
    sub.add_argument("input", type=Path, nargs="?", metavar="FILE", help="mesh or session file")

    _serve(add_command("serve", "deform a mesh in the browser"))

    sub = add_command("check", "report how a surface can be deformed; optionally repair it")
    _input_output(sub, "the repaired mesh; requires --repair")
    sub.add_argument("--json", action="store_true", help="report as JSON")
    text = "write a closed mesh; requires -o OUT"
    sub.add_argument("--repair", action="store_true", help=text)
    text = "fill holes of at most this many edges (default: 100)"
    sub.add_argument("--largest-hole", type=_count, default=100, metavar="EDGES", help=text)

    sub = add_command("motion", "write poses of a mesh as morph targets or for ParaView")
    sub.add_argument("input", type=Path, metavar="FILE", help="the mesh at rest")
    text = "the same mesh in other poses, in their order"
    sub.add_argument("poses", type=Path, nargs="+", metavar="POSE", help=text)
    text = "a .glb or .gltf with morph targets, or a .pvd with all poses"
    sub.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help=text)
    text = "poses per second (default: 24)"
    sub.add_argument("--fps", type=float, default=24.0, metavar="N", help=text)
    text = (
        "how far a blend may be from a pose that is left out, in %% of the diagonal (default: 0.2)"
    )
    sub.add_argument("--tolerance", type=float, default=0.2, metavar="PERCENT", help=text)

    sub = add_command("subdivide", "split long edges, so that large faces can be pulled")
    _input_output(sub, "the subdivided mesh, of triangles", required=True)
    text = "longest edge, in %% of the diagonal (default: 5)"
    sub.add_argument("--edge", type=float, default=5.0, metavar="PERCENT", help=text)

    sub = add_command("regions", "divide a mesh into regions")
    _input_output(sub, 'the mesh with point arrays "region" and "regions_here", and colours')
    _regions(sub)

    sub = add_command("cages", "fit cages to a mesh")
    _input_output(sub, "all cages as one coloured surface")
    _cages(sub)

    _batch(add_command("batch", "compute many poses of many meshes"))

    sub = add_command("pose", "write one pose of a batch as a mesh")
    text = "output folder of batch, or its URL"
    sub.add_argument("input", metavar="POSES", help=text)
    text = "the mesh in this pose"
    sub.add_argument("-o", "--output", type=Path, metavar="OUT", required=True, help=text)
    text = "number of the pose, from 0, as in the table"
    sub.add_argument("number", type=_count, metavar="NUMBER", help=text)

    _bench(add_command("bench", "run the benchmarks and write a report"))
    return parser


def _batch(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("plan", metavar="PLAN", help="JSON file, or its URL, with meshes and poses")
    add("-o", "--output", required=True, metavar="FOLDER", help="output folder, or its URL")
    text = "number of processes, or of the cluster's threads (default: all)"
    add("--workers", type=_count, default=None, metavar="N", help=text)
    text = "address of the scheduler of a Dask cluster, such as tcp://10.0.0.1:8786"
    add("--scheduler", default=None, metavar="ADDRESS", help=text)
    add("--retry", action="store_true", help="try poses again that have failed before")


def _serve(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("input", type=Path, nargs="?", metavar="FILE", help="mesh or session file")
    text = "port (default: 8765, or any free port if it is in use)"
    add("--port", type=_count, default=None, metavar="N", help=text)
    text = "address to listen on (default: 127.0.0.1, this machine only)"
    add("--host", default="127.0.0.1", metavar="HOST", help=text)
    add("--open", action="store_true", help="open the page in the browser")
    text = "maximum size of an upload (default: 500)"
    add("--upload-limit", type=_count, default=500, metavar="MB", help=text)


def _bench(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    _output_folder(parser, "bench-output")
    scale = parser.add_mutually_exclusive_group()
    scale.add_argument("--quick", action="store_true", help="small meshes; some ten minutes")
    scale.add_argument("--full", action="store_true", help="up to 500,000 vertices; an hour")
    text = f"run one experiment: {', '.join(EXPERIMENTS)}; may be repeated"
    add("--only", action="append", default=[], choices=EXPERIMENTS, metavar="NAME", help=text)
    add("--size", type=_count, default=None, metavar="N", help="one mesh size, in vertices")
    text = "total cage vertices (default: 155)"
    add("--cage-vertices", type=_count, default=155, metavar="N", help=text)


def _input_output(
    parser: argparse.ArgumentParser, text: str, *, required: bool = False, session: bool = False
) -> None:
    formats = f"mesh file (ply, obj, off, stl, vtp, ...){' or session file' if session else ''}"
    parser.add_argument("input", type=Path, metavar="IN", help=formats)
    parser.add_argument("-o", "--output", type=Path, metavar="OUT", required=required, help=text)


def _unknown_words(parser: argparse.ArgumentParser, words: Sequence[str]) -> str:
    """Return the error about *words* that are no arguments of a command, with advice."""
    text = f"unrecognized arguments: {' '.join(words)}"
    options = re.findall(r"--[a-z][a-z-]*", parser.format_help())
    for word in words:
        near = get_close_matches(word.partition("=")[0], options, 1, 0.7)
        if word.startswith("--") and near:
            return f"{text}; did you mean {near[0]}?"
    if all(re.fullmatch(r"[-+.\d][\w.+-]*,?", word) for word in words):
        return f"{text}; write points with commas and without blanks: 0,0,1"
    return text


def _output_folder(parser: argparse.ArgumentParser, name: str) -> None:
    text = f"output folder (default: {name})"
    parser.add_argument("-o", "--output", type=Path, default=name, metavar="FOLDER", help=text)


def _regions(parser: argparse.ArgumentParser) -> None:
    text = "number of regions, 'auto', or a point array of region numbers (default: auto)"
    parser.add_argument("--regions", default="auto", metavar="N", help=text)
    _attach(parser)
    text = "overlap of regions from a point array, in edge rings (default: 4)"
    parser.add_argument("--overlap", type=_count, metavar="RINGS", help=text)


def _cages(parser: argparse.ArgumentParser) -> None:
    _regions(parser)
    text = "total cage vertices (default: depends on the number of regions)"
    parser.add_argument("--cage-vertices", type=_count, default=None, metavar="N", help=text)


def _pull(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    text = "point on the surface to grab"
    add("--at", required=True, metavar="X,Y,Z", help=text)
    add("--to", required=True, metavar="X,Y,Z", help="target of this point")
    text = "radius of the pull (default: 15 %% of the diagonal)"
    add("--radius", type=float, default=None, metavar="R", help=text)
    text = (
        "how local the pull is: 1 keeps the rest in place, 0 leaves all of it free (default: 0.2; "
        "with 1 or 2 pins 0.05, with more 0)"
    )
    add("--local", type=float, default=None, metavar="S", help=text)
    text = "limb of the point that moves: 0 is the smallest, such as a finger (default: auto)"
    add("--limb", type=int, default=None, metavar="N", help=text)
    text = "where that limb bends: 0 along its length, 1 at its joint only (default: 0)"
    add("--hinge", type=float, default=0.0, metavar="H", help=text)
    text = "point on the surface to keep in place; may be repeated"
    add("--pin", action="append", default=[], metavar="X,Y,Z", help=text)
    text = "number of regions (default: auto)"
    add("--regions", type=_count, default=None, metavar="N", help=text)
    text = "total cage vertices (default: depends on the number of regions)"
    add("--cage-vertices", type=_count, default=None, metavar="N", help=text)
    _attach(parser)
    _constraints(parser)
    _contact_and_lids(parser)
    _refine(parser, "with --avoid-contact")
    add("--picture", type=Path, metavar="PNG", help="write a picture of before and after")


def _landmarks(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    formats = ".csv, .mrk.json, .fcsv, .pp, or points of a mesh file"
    text = f"landmarks of the mesh: {formats}"
    add("--source", type=Path, required=True, metavar="FILE", help=text)
    text = "their targets, paired by name"
    add("--target", type=Path, required=True, metavar="FILE", help=text)
    text = "standard deviation of targets whose file gives none (default: 0, met exactly)"
    add("--uncertainty", type=float, default=0.0, metavar="S", help=text)
    text = "let landmarks slide along a surface, or along a curve through the landmarks of a file; "
    text += "names may have *; they need no targets; may be repeated"
    add("--slide", type=_slide, action="append", default=[], metavar="NAMES=FILE", help=text)
    text = "keep, a volume, or a change such as +5%% (default: free)"
    add("--volume", default="free", metavar="GOAL", help=text)
    text = "separate parts that cross in the fit and do not at rest"
    add("--avoid-contact", action="store_true", help=text)
    text = "move another surface, points, curves, a grid or landmarks along; may be repeated"
    add("--carry", type=_carried, action="append", default=[], metavar="IN=OUT", help=text)
    text = "write the error of every landmark"
    add("--residuals", type=Path, metavar="CSV", help=text)
    text = "number of regions (default: auto)"
    add("--regions", type=_count, default=None, metavar="N", help=text)
    text = "total cage vertices (default: depends on the number of regions)"
    add("--cage-vertices", type=_count, default=None, metavar="N", help=text)
    add("--picture", type=Path, metavar="PNG", help="write a picture of mesh and landmarks")


def _slide(text: str) -> tuple[str, Path]:
    names, _, file = text.rpartition("=")
    if not names or not file:
        raise argparse.ArgumentTypeError(f"must be NAMES=FILE; got {text!r}")
    return names, Path(file)


def _carried(text: str) -> tuple[Path, Path]:
    one, _, other = text.partition("=")
    if not one or not other:
        raise argparse.ArgumentTypeError(f"must be IN=OUT; got {text!r}")
    return Path(one), Path(other)


def _handles(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--fixed", metavar="SEL", help="fixed points")
    handle = parser.add_argument_group("handles (motion options follow the handle they apply to)")
    for name, metavar, text in [
        ("handle", "SEL", "handle vertices; may be repeated"),
        ("matrix", "FILE", "4x4 matrix, applied first; it tells no turns: in it, a rotation by 270 "
         "degrees is one by -90"),
        ("rotate", "AXIS,DEGREES", "rotation, applied second: z,60 or 1,0,1,60; the body is turned "
         "in this direction, and with z,720 wound twice"),
        ("pivot", "X,Y,Z", "pivot of the rotation: a point, or the centre of 'fixed' or 'handle' "
         "(default: handle)"),
        ("translate", "X,Y,Z", "translation, applied last"),
    ]:  # fmt: skip
        handle.add_argument(f"--{name}", action=_HandleOption, metavar=metavar, help=text)
    parser.set_defaults(handles=[])
    add("--no-volume", action="store_true", help="do not preserve the volume")
    _constraints(parser)
    _contact_and_lids(parser)
    text = "stretch resistance relative to detail preservation (default: 1)"
    add("--stretch", type=float, default=None, metavar="S", help=text)
    text = "number of rotation clusters (default: 300)"
    add("--rotation-groups", type=_count, default=None, metavar="N", help=text)
    _refine(parser, f"up to {sizes.FINISHED:,} vertices")
    add("--picture", type=Path, metavar="PNG", help="write a picture of before and after")


def _constraints(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    text = (
        "a volume: keep, free, 2.5 (in the mesh's unit, cubed), 40%%, +10%% or -40%%, also after "
        "'at least' or 'at most'; NAME is whole, body 0, cavity, wall, component 0, region 0, a "
        "part, or label 3 of a label map; may be repeated"
    )
    add("--volume", action="append", default=[], metavar="NAME=GOAL", help=text)
    text = "a part of the surface, whose volume is that under a lid; may be repeated"
    add("--part", action="append", default=[], metavar="NAME=SEL", help=text)
    text = "points that move as one body, as bones and buttons; may be repeated"
    add("--rigid", action="append", default=[], metavar="SEL", help=text)
    text = "points that are so many times stiffer than others; may be repeated"
    add("--stiffness", action="append", default=[], metavar="SEL=TIMES", help=text)
    text = (
        "points that move along a plane only, the nearest to them; with :line or :surface after "
        "SEL along a line, or along the surface; may be repeated"
    )
    add("--slide", action="append", default=[], metavar="SEL", help=text)
    text = "mirror motions about a plane with this normal, whose place is found, or auto"
    add("--symmetry", choices=("x", "y", "z", "auto"), default=None, help=text)
    text = "an array of vectors or tensors that turns with the surface; may be repeated"
    add("--turn", action="append", default=[], metavar="ARRAY", help=text)
    text = "the same, pushed forward with the surface: lengths change; may be repeated"
    add("--push", action="append", default=[], metavar="ARRAY", help=text)
    text = "add a point array of this name: how far each point has moved"
    add("--displacement", default=None, metavar="NAME", help=text)


def _contact_and_lids(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--avoid-contact", action="store_true", help="keep parts of the surface from crossing")
    text = "whether open parts enclose a volume under lids over their holes (default: auto)"
    add("--lids", choices=("auto", "on", "off"), default="auto", help=text)


def _refine(parser: argparse.ArgumentParser, default: str) -> None:
    text = f"finish the pose on the mesh itself: less distorted, handles exact (default: {default})"
    action = argparse.BooleanOptionalAction
    parser.add_argument("--refine", action=action, default=None, help=text)


def _attach(parser: argparse.ArgumentParser) -> None:
    text = (
        "let component A follow component B, numbered from 0; A=free: none; may be repeated "
        "(default: a component without fixed or handle points follows one that it lies against)"
    )
    parser.add_argument(
        "--attach", type=_attachment, action="append", default=[], metavar="A=B", help=text
    )


def _attachment(text: str) -> tuple[int, int | str]:
    one, is_given, other = text.partition("=")
    if not (one.isdecimal() and is_given and (other.isdecimal() or other == "free")):
        raise argparse.ArgumentTypeError(f"must be A=B or A=free; got {text!r}")
    return int(one), other if other == "free" else int(other)


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number, 0 or more; got {text!r}")
    return int(text)
