"""Every operation on every bad mesh of `zoo` gives a correct result or one of our errors.

A correct result has the same number of vertices, all finite, the same volume to 1e-12, and handles
at their targets or a status that says they are not.  An error names the fault, in the words that
`zoo` expects, and a remedy.  There must be no other exception, no warning, and no computation of
minutes.

`pytest -m campaign tests/whole/test_zoo.py -s` runs all cases and prints the counts.  With
SEGDEFORM_ZOO=1 the page of the documentation is generated again.
"""

from __future__ import annotations

import os
import re
import signal
import time
from collections import Counter
from functools import partial
from pathlib import Path

import pytest
import zoo
from zoo_operations import OF_SURFACES, OPERATIONS, TAKE_ANY_ARRAYS

from vtk_segdeform.errors import SegDeformError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bad-input.rst"
LONGEST = 120.0  # seconds of processor time for one case
REMEDY = re.compile(
    r"\b(must|requires|repair|make|add|give|use|take|leave|enlarge|scale|mark|name|choose|move|"
    r"same unit|raise|reverse|pass|fit|segment|count|write|tell|select|check|remove|list each|"
    r"look|export)\b"
)


# One case and its outcome.


def outcome(run, fault, remedy=REMEDY):
    """Return "accepted" or "refused"; raise for a wrong result or any other exception."""
    refusal = None
    try:
        run()
    except SegDeformError as error:
        refusal = error
    if refusal is None:
        assert fault is None, f"accepted, despite {fault}"
        return "accepted"
    message = " ".join(str(refusal).split())
    assert fault is not None, f"refused sound input: {type(refusal).__name__}: {message}"
    assert re.search(fault, message), f"does not name the fault, {fault}: {message}"
    assert remedy.search(message), f"names no remedy: {message}"
    return "refused"


def cases():
    """Yield (exhibit, operation, run, fault) for all cases."""
    for creature in [*zoo.SOUND, *zoo.OPEN, *zoo.FAULTY]:
        for name, operation in OPERATIONS.items():
            if not creature.is_soup and name not in TAKE_ANY_ARRAYS:
                continue  # a file or a PolyData cannot contain it
            fault = creature.given if name in OF_SURFACES else creature.fault
            if name == "repair" and creature.repairable:
                fault = None
            yield creature.name, name, partial(_run, creature, operation), fault


def _run(creature, operation):
    operation(*creature.make())


EVERY = 71  # one case in this many belongs to the suite, all of them to the campaign
FEW = [*cases()][::EVERY]


@pytest.fixture
def bounded(tmp_path, monkeypatch):
    """Work in an empty folder, with limited processor time."""

    def stop(*_):
        raise TimeoutError(f"took more than {LONGEST:.0f} s")

    monkeypatch.chdir(tmp_path)
    if not hasattr(signal, "SIGPROF"):
        yield lambda: None
        return
    before = signal.signal(signal.SIGPROF, stop)  # processor time, since other tests run as well
    try:
        yield lambda: signal.setitimer(signal.ITIMER_PROF, LONGEST)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@pytest.mark.parametrize(
    ("exhibit", "operation", "run", "fault"), FEW, ids=[f"{c[0]} - {c[1]}" for c in FEW]
)
def test_bad_input_gives_a_correct_result_or_an_error_with_a_reason(
    exhibit, operation, run, fault, bounded
):
    bounded()
    assert outcome(run, fault) in ("accepted", "refused")


HEAD = """\
Bad input
=========

.. Generated from the tests by `SEGDEFORM_ZOO=1 python -m pytest tests/whole/test_zoo.py`.

This page lists damaged and unusual meshes. In each case, either the result is correct (finite, of
exact volume, with the handles at their targets or a status that says they are not), or an error of
:mod:`vtk_segdeform.errors` names the fault and says what to do. There are no other exceptions, no
warnings, and no computations of many minutes.

Any surface can be deformed as it is: with holes, branching edges, seams, flipped or duplicate
faces, unused points, or only one side. A :class:`~vtk_segdeform.Mesh` may have holes, branching
edges and triangles without area as well. What it refuses is accepted as a
:class:`~vtk_segdeform.Surface`, on which the filter and the commands work.

Each mesh is tested with each operation, in {cases} cases: {answered} return a result and {refused}
raise an error that names the fault.

Accepted: {accepted}.

.. list-table::
   :header-rows: 1
   :widths: 30 40 30

"""


def page():
    """Return the page of the documentation, as reStructuredText."""
    exhibits, faults = {}, []
    for exhibit, operation, _, fault in cases():
        exhibits.setdefault(exhibit, []).append((operation, fault))
        faults.append(fault)
    table = row("refused", "the message contains", "accepted by")
    for name, ends in exhibits.items():
        says = sorted({words(fault) for _, fault in ends if fault})
        if says:
            fine = [operation for operation, fault in ends if not fault]
            table += row(name, "; ".join(says), ", ".join(fine))
    sound = [name for name, ends in exhibits.items() if not any(fault for _, fault in ends)]
    answered = faults.count(None)
    head = HEAD.format(
        cases=len(faults), answered=answered, refused=len(faults) - answered,
        accepted="; ".join(map(plain, sound)),
    )  # fmt: skip
    return head + "\n".join([*table, ""])


def row(*cells):
    first, *others = [plain(cell) for cell in cells]
    return [f"   * - {first}", *(f"     - {cell}".rstrip() for cell in others)]


def words(fault):
    """Return the words that a pattern expects."""
    return fault.replace("\\", "").replace(".*", ", ").replace("|", " or ")


def plain(text):
    """Return *text* with the markup of reStructuredText escaped."""
    return "".join(f"\\{letter}" if letter in "\\*`|_" else letter for letter in text)


def test_the_page_of_the_documentation_lists_the_expected_outcomes():
    if os.environ.get("SEGDEFORM_ZOO"):
        PAGE.write_text(page(), encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == page()


@pytest.mark.campaign
def test_every_case_is_accepted_or_refused(bounded):
    counts, others, slow = Counter(), [], []
    for exhibit, operation, run, fault in cases():
        began = time.perf_counter()
        bounded()
        try:
            ended = outcome(run, fault)
        except Exception as error:  # noqa: BLE001 - to count them all
            ended = f"{type(error).__name__}: {error}"
            others.append((exhibit, operation, ended))
        seconds = time.perf_counter() - began
        counts[
            "accepted" if ended == "accepted" else "refused" if ended == "refused" else "other"
        ] += 1
        if seconds > 5.0:
            slow.append(f"{exhibit} - {operation}: {seconds:.0f} s")
    print(f"\n{counts.total()} cases: {counts['accepted']} accepted, {counts['refused']} refused "
          f"with a named fault, {counts['other']} others")  # fmt: skip
    print("longer than 5 s:", *slow, sep="\n  ")
    assert counts.total() >= 400
    assert not others, "\n".join(f"{e} - {o}: {what}" for e, o, what in others)
