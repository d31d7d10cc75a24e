"""Every creature of the zoo meets every operation: a right answer, or an error of ours that says.

Right is: as many vertices, all finite, the volume that it was to 1e-12, handles met or the status
says that they are not.  A refusal names the fault, by the words that `zoo` expects, and a cure.
Nothing else may come out: no other exception, no warning, nothing that takes minutes.

`pytest -m campaign tests/whole/test_zoo.py -s` takes all and prints the
counts. With SEGDEFORM_ZOO=1 the page of the documentation is written again.
"""

from __future__ import annotations

import itertools
import os
import re
import signal
import time
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import zoo
from zoo_operations import OPERATIONS, OTHERS, TAKE_ANY_ARRAYS, TAKE_PAIRS, require_right, scene
from zoo_page import page

from vtk_segdeform.errors import MeshError, SegDeformError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bad-input.rst"
LONGEST = 120.0  # seconds of work, for one case
CURE = re.compile(
    r"\b(must|repair|make|add|give|use|take|leave|enlarge|scale|mark|name|choose|move|look|"
    r"same unit|raise|reverse|pass|fit|segment|count|write|tell|select|check|remove|list each)\b"
)


# One case, and how it ended.


def outcome(run, fault, cure=CURE):
    """Return "answered" or "refused"; anything else raises, a wrong answer too."""
    refusal = None
    try:
        run()
    except SegDeformError as error:
        refusal = error
    if refusal is None:
        assert fault is None, f"answered, though {fault}"
        return "answered"
    said = " ".join(str(refusal).split())
    assert fault is not None, f"refused what is sound: {type(refusal).__name__}: {said}"
    assert re.search(fault, said), f"does not name the fault, {fault}: {said}"
    assert cure.search(said), f"names no cure: {said}"
    return "refused"


def cases():
    """Yield (exhibit, operation, run, fault) of everything."""
    for creature in [*zoo.SOUND, *zoo.FAULTY]:
        for name, operation in OPERATIONS.items():
            if not creature.is_soup and name not in TAKE_ANY_ARRAYS:
                continue  # nothing that a file or a PolyData could hold
            fault = None if name == "repair" and creature.mended else creature.fault
            yield creature.name, name, partial(_met, creature, operation), fault

    for kind, (creatures, operations) in OTHERS.items():
        for creature, operation in itertools.product(creatures, operations):
            run = partial(_met if kind in TAKE_PAIRS else _met_whole, creature, operation)
            name = operation.__name__.replace("_", " ")
            yield f"{kind}: {creature.name}", name, run, creature.but.get(name, creature.fault)


def _met_whole(creature, operation):
    operation(creature.make())


def _met(creature, operation):
    operation(*creature.make())


# A case that takes long, and is known to: the cages are larger than the mesh.
SLOW = {"cages: 1600 vertices"}
EVERY = 31  # of the cases is in the suite

# One for each kind of exhibit and operation would be too many; every so manieth is in the suite.
FEW = [case for case in cases() if case[0] not in SLOW and "segdeform deform" not in case[1]][
    ::EVERY
]


@pytest.fixture
def bounded(tmp_path, monkeypatch):
    """Work in an empty folder; whatever takes too long is an error."""

    def stop(*_):
        raise TimeoutError(f"took more than {LONGEST:.0f} s")

    monkeypatch.chdir(tmp_path)
    if not hasattr(signal, "SIGPROF"):
        yield lambda: None
        return
    before = signal.signal(signal.SIGPROF, stop)  # by work, not by the clock: others work as well
    try:
        yield lambda: signal.setitimer(signal.ITIMER_PROF, LONGEST)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@pytest.mark.parametrize(
    ("exhibit", "operation", "run", "fault"), FEW, ids=[f"{c[0]} - {c[1]}" for c in FEW]
)
def test_each_is_answered_rightly_or_refused_with_a_reason(exhibit, operation, run, fault, bounded):
    bounded()
    assert outcome(run, fault) in ("answered", "refused")


def test_a_wrong_answer_and_an_error_of_others_are_both_caught():
    mesh = scene()[0]
    with pytest.raises(AssertionError):
        outcome(lambda: require_right(mesh, mesh.vertices * (1.0 + 1e-11)), None)
    with pytest.raises(AssertionError):
        outcome(lambda: require_right(mesh, mesh.vertices * np.nan), None)
    with pytest.raises(ZeroDivisionError):
        outcome(lambda: 1 // 0, None)
    with pytest.raises(AssertionError, match="though open edges"):
        outcome(lambda: None, "open edges")

    def refuse(text):
        raise MeshError(text)

    with pytest.raises(AssertionError, match="no cure"):
        outcome(partial(refuse, "3 open edges"), "open edges")
    with pytest.raises(AssertionError, match="name the fault"):
        outcome(partial(refuse, "something; repair it"), "open edges")
    with pytest.raises(AssertionError, match="sound"):
        outcome(partial(refuse, "something; repair it"), None)


def test_the_page_of_the_documentation_tells_what_is_expected_of_every_case():
    if os.environ.get("SEGDEFORM_ZOO"):
        PAGE.write_text(page(cases()), encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == page(cases())


@pytest.mark.campaign
def test_the_whole_zoo_is_answered_or_refused_and_nothing_else(bounded):
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
            "answered" if ended == "answered" else "refused" if ended == "refused" else "other"
        ] += 1
        if seconds > 5.0:
            slow.append(f"{exhibit} - {operation}: {seconds:.0f} s")
    print(f"\n{counts.total()} cases: {counts['answered']} answered, {counts['refused']} refused "
          f"with a named fault, {counts['other']} others")  # fmt: skip
    print("longer than 5 s:", *slow, sep="\n  ")
    assert counts.total() >= 400
    assert not others, "\n".join(f"{e} - {o}: {what}" for e, o, what in others)
