"""The page of the documentation on bad input.

It lists the results that the tests of the zoo expect, so no case has to run.
"""

from __future__ import annotations

from collections.abc import Iterable

import zoo_operations

# Kinds of exhibits, as in `zoo_operations.OTHERS`, and their headings on the page.
HEADINGS = {
    "": "Meshes",
    "regions": "Regions",
    "overlaps": "Overlaps",
    "cages": "Cages",
    "cage poses": "Poses of a cage",
    "selections": "Fixed vertices and handles",
    "targets": "Targets",
    "motions": "Handle motions",
    "numbers": "Numeric options",
    "PolyData": "VTK surfaces",
}
HEAD = """\
Bad input
=========

.. Generated from the tests by `SEGDEFORM_ZOO=1 python -m pytest tests/whole/test_zoo.py`.

This page lists faulty input: damaged meshes, cages that do not fit, targets out of range. In each
case, either the result is correct (finite, of exact volume, with the handles at their targets or a
status that says they are not), or an error of :mod:`vtk_segdeform.errors` names the fault and says
what to do. There are no other exceptions, no warnings, and no computations of many minutes.

Any surface can be deformed as it is: with holes, branching edges, seams, flipped or duplicate
faces, unused points, or only one side. A :class:`~vtk_segdeform.Mesh` may have holes, branching
edges and triangles without area as well. What it refuses is accepted by the operations on surfaces:
"Surface", "filter", "segdeform check" and "segdeform deform".

Each input is tested with each operation that accepts its type, in {cases} cases: {answered} return
a result and {refused} raise an error that names the fault.
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
    """Return a section: a line of accepted input, and a table of refused input."""
    sound = [name for name, ends in exhibits.items() if not any(fault for _, fault in ends)]
    lines = [heading, "-" * len(heading), ""]
    if sound:
        lines += [f"Accepted: {'; '.join(map(_plain, sound))}.", ""]
    lines += [".. list-table::", "   :header-rows: 1", "   :widths: 30 40 30", ""]
    lines += _row("refused", "the message contains", "accepted by")
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
    """Return *text* with the markup of reStructuredText escaped."""
    return "".join(f"\\{letter}" if letter in "\\*`|_" else letter for letter in text)
