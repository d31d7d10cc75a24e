"""The page of the documentation that tells what becomes of which bad input.

What the tests of the zoo expect of each case is what is told: the page needs no case to be run.
"""

from __future__ import annotations

from collections.abc import Iterable

import zoo_operations

# Kinds of exhibits, as `zoo_operations.OTHERS` has them, and what they are called on the page.
HEADINGS = {
    "": "Meshes",
    "regions": "Regions",
    "overlaps": "Overlaps of regions",
    "cages": "Cages",
    "cage poses": "Poses of a cage",
    "selections": "Fixed vertices and handles",
    "targets": "Targets",
    "motions": "Motions of a handle",
    "numbers": "Options that are numbers",
    "PolyData": "Surfaces of VTK",
}
HEAD = """\
Bad input
=========

.. Made by `SEGDEFORM_ZOO=1 python -m pytest tests/whole/test_zoo.py`, of what the tests expect.

What becomes of meshes with faults, cages that do not fit, targets out of sight. Either the answer
is right: finite, of exact volume, with the handles in place or a status that says that they are
not. Or an error of :mod:`vtk_segdeform.errors` names the fault and says what to do. Nothing else
comes out: no other exception, no warning, nothing that takes minutes.

Triangles without area are allowed: a closed mesh that contains some is accepted, bound and posed
like any other.

Each input below met each operation that could take it, {cases} cases: {answered} were answered and
{refused} refused with a named fault.
"""


def page(cases: Iterable[tuple]) -> str:
    """Return the page for `test_zoo.cases`, as reStructuredText."""
    kinds: dict[str, dict[str, list]] = {kind: {} for kind in HEADINGS}
    faults = []
    for exhibit, operation, _, fault in cases:
        first, _, rest = exhibit.partition(": ")
        kind, name = (first, rest) if first in zoo_operations.OTHERS else ("", exhibit)
        kinds[kind].setdefault(name, []).append((operation, fault))
        faults.append(fault)
    answered = faults.count(None)
    counts = {"cases": len(faults), "answered": answered, "refused": len(faults) - answered}
    parts = [HEAD.format(**counts)]
    parts += [_section(HEADINGS[kind], exhibits) for kind, exhibits in kinds.items()]
    return "\n\n".join(parts)


def _section(heading: str, exhibits: dict[str, list]) -> str:
    """Return what is answered, in a line, and a table of what is refused."""
    sound = [name for name, ends in exhibits.items() if not any(fault for _, fault in ends)]
    lines = [heading, "-" * len(heading), ""]
    if sound:
        lines += [f"Answered: {'; '.join(map(_plain, sound))}.", ""]
    lines += [".. list-table::", "   :header-rows: 1", "   :widths: 30 40 30", ""]
    lines += _row("refused", "the error says", "answered all the same by")
    for name, ends in exhibits.items():
        says = sorted({_words(fault) for _, fault in ends if fault})
        fine = [operation for operation, fault in ends if not fault]
        if says:
            lines += _row(name, "; ".join(says), ", ".join(fine))
    return "\n".join([*lines, ""])


def _row(*cells: str) -> list[str]:
    first, *others = [_plain(cell) for cell in cells]
    return [f"   * - {first}", *(f"     - {cell}".rstrip() for cell in others)]


def _words(fault: str) -> str:
    """Return the words that a pattern expects."""
    return fault.replace("\\", "").replace(".*", ", ").replace("|", " or ")


def _plain(text: str) -> str:
    """Return *text* with nothing in it that reStructuredText reads."""
    return "".join(f"\\{letter}" if letter in "\\*`|_" else letter for letter in text)
