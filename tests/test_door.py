"""Bad arguments to every public callable end in one of our errors, or in an answer.

The callables are found by looking (`public_calls`), so that a new one is tried as well.  One
argument of a valid call, sometimes two, is replaced by a value that nobody expects there
(`bad_values`).  Nothing else than an error of `vtk_segdeform.errors` may come out, in seconds and
without gigabytes; and what a session holds after an error is what it held before.
"""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import public_calls
import pytest
from bad_values import BAD
from public_calls import CORE, WIDGETS, Call, calls, valid

from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.session import Session

SECONDS = 30.0  # of one call, beyond which it hangs
GIGABYTES = 4  # more than there is already
LONGEST = 1000  # characters of a message


@pytest.fixture(autouse=True)
def bounded(tmp_path, monkeypatch):
    """Run in an empty folder, with bounded memory, and with a file open that has to stay open."""
    monkeypatch.chdir(tmp_path)
    public_calls._file.cache_clear()
    limits = resource.getrlimit(resource.RLIMIT_AS)
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + (GIGABYTES << 30)
        resource.setrlimit(resource.RLIMIT_AS, (most, limits[1]))
    with open(tmp_path / "open.bin", "wb") as file:
        yield file.fileno()
        os.fstat(file.fileno())
    resource.setrlimit(resource.RLIMIT_AS, limits)


def _tried(call: Call, bad: dict[str, str], fd: int) -> str:
    """Return what is wrong with how *call* takes the *bad* values; "" if nothing is."""
    function = call.bound()
    arguments = call.arguments()
    values = {name: fd if kind == "fd" else BAD[kind]() for name, kind in bad.items()}
    if set(values) - set(arguments):  # one that may be left out, beside valid ones
        arguments |= {name: valid(call.name, name) for name in call.parameters if name in values}
    arguments |= values
    owner = getattr(function, "__self__", None)
    before = owner.state if isinstance(owner, Session) else None
    told = f"{call.name}({', '.join(f'{name}={kind}' for name, kind in bad.items())})"
    try:
        with _in_time():
            answer = function(**arguments)
    except SegDeformError as error:
        if len(str(error)) > LONGEST:
            return f"{told}: a message of {len(str(error))} characters: {str(error)[:200]}"
        if before is not None and owner.state is not before:
            return f"{told}: refused, and yet the session changed"
        return _named(told, str(error), bad)
    except BaseException as error:  # noqa: BLE001 - that is what is asked
        return f"{told}: {type(error).__name__}: {str(error)[:200]}"
    finally:
        os.fstat(fd)
    _tidy(answer)
    return ""


def _tidy(answer: object) -> None:
    """Take a widget out of the view that the next ones share."""
    if type(answer).__module__.startswith("vtk_segdeform.widgets"):
        end = getattr(answer, "remove", None) or getattr(answer, "stop", None)
        if end is not None:
            end()


def _named(told: str, message: str, bad: dict[str, str]) -> str:
    return ""


@contextlib.contextmanager
def _in_time() -> Iterator[None]:
    def late(*_: Any) -> None:
        raise TimeoutError(f"still running after {SECONDS:.0f} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _all(modules: tuple[str, ...]) -> list[Call]:
    return [call for call in calls(modules) if call.parameters]


def _draws(seed: int, modules: tuple[str, ...], each: int) -> Iterator[tuple[Call, dict[str, str]]]:
    """Yield *each* random bad calls per parameter; one in five has a second bad argument."""
    rng = np.random.default_rng(seed)
    kinds = [*BAD, "fd"]
    for call in _all(modules):
        for name in call.parameters:
            for kind in rng.choice(kinds, min(each, len(kinds)), replace=False):
                bad = {name: str(kind)}
                if len(call.parameters) > 1 and rng.random() < 0.2:
                    bad |= {str(rng.choice(call.parameters)): str(rng.choice(kinds))}
                yield call, bad


@pytest.mark.parametrize("modules", [CORE, WIDGETS], ids=["core", "widgets"])
def test_every_parameter_has_a_valid_value_and_the_call_is_answered(modules):
    for call in _all(modules):
        for name in call.parameters:
            valid(call.name, name)
        _tidy(call.bound()(**call.arguments()))


@pytest.mark.parametrize("modules", [CORE, WIDGETS], ids=["core", "widgets"])
def test_a_bad_argument_is_an_error_of_ours_or_answered(modules, bounded):
    faults = [_tried(call, bad, bounded) for call, bad in _draws(1, modules, 2)]
    faults = list(filter(None, faults))
    assert not faults, f"{len(faults)} calls:\n" + "\n".join(faults)
