"""The command line, ``segdeform``: the only place that prints, and that decides an exit code.

    0   done
    1   a fault was found, or the work could not be done: the line on stderr says why
    2   the command was not understood: unknown option, bad selection, bad motion

What the commands do is told in `commands`; here is how they are called.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import sys
from collections.abc import Sequence
from ctypes.util import find_library
from pathlib import Path
from typing import Any

from ..benchmarks import EXPERIMENTS
from ..errors import ConstraintError, SegDeformError
from ..kernels import advice
from ..version import __version__
from . import commands
from .application import application
from .bench import bench
from .progress_bar import ProgressBar
from .replaying import replay_command

_TAKE_VECTORS = ("--rotate", "--pivot", "--translate")
DONE, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130

_SELECTION = """\
selections (SEL):
  z>80%, x<=0.25   half-space; per cent of the bounding box, or in the mesh's own unit
  ids.txt          a file of vertex numbers, from 0
  pose.sel         one number per vertex: 0 fixed, 1 free, 2 handle
  name, name=2     a point array: not zero, or equal to 2
  z>80%&x<10%      both
"""

_REPLAYS = """\
A recording may come from an untrusted source. Its keys read and write files only in --folder. The
replay is refused or stopped with exit code 1 if it exceeds --events, --seconds or a window of
16 million pixels.
"""

_EXAMPLES = """\
examples:
  segdeform demo -o demo-output
  segdeform check scan.ply --repair -o closed.ply
  segdeform edit horse.ply -o bent.ply
  segdeform app horse.ply
  segdeform deform horse.ply -o bent.ply --fixed 'z<10%' --handle 'z>90%' --rotate y,45
  segdeform deform a.off -o b.off --fixed a.sel --handle a.sel --matrix a.def --regions auto
  segdeform deform in.vtp -o out.vtp --fixed 'z<5%' \\
      --handle left.txt --translate 0,0,0.2   --handle right.txt --rotate x,30 --pivot 0,0,1
  segdeform replay horse.recording.txt horse.recording.segdeform --film bug.gif
  segdeform regions horse.ply -o regions.vtp --regions 6
  segdeform cages horse.ply -o cages.vtp --regions 6 --cage-vertices 300

exit codes: 0 done; 1 a fault was found or the work failed; 2 the command was not understood
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    try:
        options = _parser().parse_args(_with_signed_vectors(words))
    except SystemExit as end:  # argparse has printed its usage, help or version
        return int(end.code or 0)
    _draw_without_a_screen()
    bar = ProgressBar(sys.stderr)

    def say(line: str) -> None:
        bar.clear()
        print(_printable(line), flush=True)

    warnings = _Warnings(options.command, bar)
    logging.getLogger("vtk_segdeform").addHandler(warnings)
    try:
        return DONE if options.run(options, say, bar) else FAILED
    except KeyboardInterrupt:
        bar.clear()
        return INTERRUPTED
    except BrokenPipeError:  # the reader, head or less, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except (SegDeformError, OSError, ValueError, RuntimeError, MemoryError) as error:
        bar.clear()
        if options.debug:
            raise
        told = _printable(_told(error))
        print(f"segdeform {options.command}: {told}", file=sys.stderr)
        return MISUSED if isinstance(error, ConstraintError) else FAILED
    finally:
        logging.getLogger("vtk_segdeform").removeHandler(warnings)


class _Warnings(logging.Handler):
    """Prints the package's warnings, for example of arrays that a file format cannot store."""

    def __init__(self, command: str, bar: ProgressBar) -> None:
        super().__init__(logging.WARNING)
        self._command, self._bar = command, bar

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record as a line of its own."""
        self._bar.clear()
        print(f"segdeform {self._command}: {record.getMessage()}", file=sys.stderr)


def _draw_without_a_screen() -> None:
    """Lead VTK to EGL where there is no X server: it would warn of that with every picture."""
    if sys.platform == "linux" and not os.environ.get("DISPLAY") and find_library("EGL"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")


def _printable(line: str) -> str:
    """Return *line* with unprintable characters escaped: file names may be any bytes."""
    encoding = sys.stdout.encoding or "utf-8"
    return line.encode(encoding, "backslashreplace").decode(encoding)


def _told(error: Exception) -> str:
    """Return the error in one line."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        return "out of memory"
    return " ".join(str(error).split()) or type(error).__name__


def _with_signed_vectors(words: Sequence[str]) -> list[str]:
    """Return *words* with "--pivot -1,0,0" joined by "=": argparse takes -1,0,0 for an option."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] in _TAKE_VECTORS and re.match(r"-[\d.]", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


class _OfHandle(argparse.Action):
    """--handle begins a handle; a motion option after it belongs to that handle."""

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
            parser.error(f"{option_string} says how a handle moves; write it after its --handle")
        elif self.dest in handles[-1]:
            parser.error(f"{option_string} is given twice for one handle")
        else:
            handles[-1] = {**handles[-1], self.dest: values}
        namespace.handles = handles


def _parser() -> argparse.ArgumentParser:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="segdeform",
        description="Bend a dense closed mesh while its detail and its exact volume stay.",
        epilog=_EXAMPLES,
        formatter_class=form,
    )
    version = "\n".join(filter(None, (f"segdeform {__version__}", advice())))
    parser.add_argument("--version", action="version", version=version)
    parser.add_argument("--debug", action="store_true", help="show where an error came from")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def command(name: str, run: Any, text: str, epilog: str = "") -> argparse.ArgumentParser:
        sub = subparsers.add_parser(
            name, help=text, description=f"{text[0].upper()}{text[1:]}.", epilog=epilog,
            formatter_class=form, allow_abbrev=False,
        )  # fmt: skip
        sub.set_defaults(run=run)
        return sub

    sub = command("demo", commands.demo, "bend the cactus over; write meshes and pictures")
    sub.add_argument("-o", "--output", type=Path, default=Path("demo-output"), metavar="FOLDER")
    sub.add_argument("--size", type=_count, default=5430, metavar="N", help="mesh vertices (5430)")
    sub.add_argument("--no-pictures", action="store_true", help="only meshes and numbers")

    sub = command("deform", commands.deform, "move handles of a mesh", _SELECTION)
    _input_output(sub, required=True)
    _subspace(sub)
    _motion(sub)

    sub = command("edit", commands.edit, "open a window to deform a mesh, or a saved session, in")
    _input_output(sub, required=False)

    sub = command("app", application, "open the desktop program, with a mesh, a session or nothing")
    sub.add_argument("input", type=Path, nargs="?", metavar="FILE", help="a mesh or a session")

    text = "replay a recording made with Ctrl+R"
    sub = command("replay", replay_command, text, _REPLAYS)
    sub.add_argument("recording", type=Path, metavar="RECORDING", help="NAME.recording.txt")
    _input_output(sub, required=False)
    sub.add_argument("--film", type=Path, metavar="OUT", help="off-screen, to a .gif or an .mp4")
    text = "folder for files that the recorded keys save; without it, saving fails"
    sub.add_argument("--folder", type=Path, metavar="FOLDER", help=text)
    text = "limit on events plus timer ticks (200000)"
    sub.add_argument("--events", type=_count, default=200_000, metavar="N", help=text)
    text = "time limit in seconds (300)"
    sub.add_argument("--seconds", type=_count, default=300, metavar="S", help=text)

    sub = command("check", commands.check, "report the faults of a mesh, and repair them")
    _input_output(sub, required=False)
    sub.add_argument("--repair", action="store_true", help="write the repaired mesh to -o OUT")
    text = "fill holes of up to this many edges (100)"
    sub.add_argument("--largest-hole", type=_count, default=100, metavar="EDGES", help=text)

    sub = command("regions", commands.regions, "cut a mesh into regions; write them as an array")
    _input_output(sub, required=False)
    _number_of_regions(sub)

    sub = command("cages", commands.cages, "make the cages of a mesh; write them coloured")
    _input_output(sub, required=False)
    _subspace(sub)

    sub = command("bench", bench, "measure against the paper and its peers; write a report")
    sub.add_argument("-o", "--output", type=Path, default=Path("bench-output"), metavar="FOLDER")
    much = sub.add_mutually_exclusive_group()
    much.add_argument("--quick", action="store_true", help="small sizes, a few minutes")
    much.add_argument("--full", action="store_true", help="up to a million vertices, an hour")
    sub.add_argument(
        "--only", action="append", default=[], choices=list(EXPERIMENTS), help="may be given again"
    )
    sub.add_argument(
        "--size", type=_count, default=None, metavar="N", help="mesh vertices, one size"
    )
    sub.add_argument("--cage-vertices", type=_count, default=155, metavar="N", help="in all (155)")
    what = sub.add_mutually_exclusive_group()
    what.add_argument("--interactive", action="store_true", help="time a drag in a window instead")
    text = "append the ratios, with date and commit, to a file of JSON lines"
    what.add_argument("--record", type=Path, metavar="FILE", help=text)
    text = "measure nothing; plot the runs recorded in a file"
    what.add_argument("--history", type=Path, metavar="FILE", help=text)
    return parser


def _input_output(parser: argparse.ArgumentParser, *, required: bool) -> None:
    parser.add_argument("input", type=Path, metavar="IN", help="ply, obj, off, stl, vtp, ...")
    parser.add_argument("-o", "--output", type=Path, metavar="OUT", required=required)


def _number_of_regions(parser: argparse.ArgumentParser) -> None:
    text = "how many regions: a number (3), auto, or the name of a point array of labels"
    parser.add_argument("--regions", default="3", metavar="N", help=text)
    text = "edge rings that regions from an array grow into each other (4)"
    parser.add_argument("--overlap", type=_count, default=4, metavar="RINGS", help=text)


def _subspace(parser: argparse.ArgumentParser) -> None:
    _number_of_regions(parser)
    parser.add_argument(
        "--cage-vertices", type=_count, default=155, metavar="N", help="of all cages together (155)"
    )


def _motion(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--fixed", required=True, metavar="SEL", help="vertices held in place")
    one = parser.add_argument_group("for each handle, after its --handle")
    for name, metavar, text in [
        ("handle", "SEL", "vertices that move; give it again for another handle"),
        ("matrix", "FILE", "4x4 matrix, applied first"),
        ("rotate", "AXIS,DEGREES", "then a turn: z,60 or 1,0,1,60"),
        ("pivot", "X,Y,Z", "of the turn; 'fixed' or 'handle' for a centre (handle)"),
        ("translate", "X,Y,Z", "then a shift"),
    ]:
        required = name == "handle"
        one.add_argument(
            f"--{name}", action=_OfHandle, metavar=metavar, help=text, required=required
        )
    add("--no-volume", action="store_true", help="let the volume change")
    add("--stretch", type=float, default=None, metavar="S", help="resistance to stretching")
    add("--rotation-groups", type=_count, default=None, metavar="N", help="0: one per vertex")
    add("--picture", type=Path, metavar="PNG", help="write before and after as a picture")


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number, 0 or more; got {text!r}")
    return int(text)
