"""Every public callable either accepts a bad argument or raises one of our errors.

The callables are discovered (`public_calls`), so that new ones are tested as well.  One argument of
a valid call, sometimes two, is replaced by an unexpected value (`bad_values`).  Only errors of
`vtk_segdeform.errors` may be raised, within seconds and without gigabytes of memory, and a session
must be unchanged after an error.
"""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import sys
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import public_calls
import pytest
from bad_values import BAD
from campaign import every
from public_calls import CORE, SAID_AS, WIDGETS, Call, calls, valid

from vtk_segdeform.errors import SegDeformError
from vtk_segdeform.session.session import Session
from vtk_segdeform.session.state import Locality, Pose, State

SECONDS = 30.0  # limit for one call
GIGABYTES = 4  # in addition to the memory in use
SETTERS = {"DeformEditor.path"}  # of paths
LONGEST = 1000  # characters of a message


@pytest.fixture(autouse=True)
def bounded(tmp_path, monkeypatch):
    """Run in an empty folder, with bounded memory, and with a file that must stay open."""
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
    """Return how *call* mishandles the *bad* values; "" if it does not."""
    function = call.bound()
    arguments = call.arguments()
    values = {name: fd if kind == "fd" else BAD[kind]() for name, kind in bad.items()}
    if set(values) - set(arguments):  # an optional one, in addition to valid ones
        arguments |= {name: valid(call.name, name) for name in call.parameters if name in values}
    arguments |= values
    owner = getattr(function, "__self__", None)
    before = owner.state if isinstance(owner, Session) else None
    label = f"{call.name}({', '.join(f'{name}={kind}' for name, kind in bad.items())})"
    try:
        with _within_limit():
            answer = function(**arguments)
    except SegDeformError as error:
        if len(str(error)) > LONGEST:
            return f"{label}: a message of {len(str(error))} characters: {str(error)[:200]}"
        if before is not None and owner.state is not before:
            return f"{label}: raised an error, but changed the session"
        return _named(call, label, str(error), bad)
    except BaseException as error:  # noqa: BLE001 - any other is the fault
        return f"{label}: {type(error).__name__}: {str(error)[:200]}"
    finally:
        os.fstat(fd)
        public_calls.tidy()
    public_calls.remove(answer)
    return ""


def _named(call: Call, label: str, message: str, bad: dict[str, str]) -> str:
    """Return a complaint unless *message* names the argument, or the path passed for it."""
    if len(bad) > 1:
        return ""
    ((name, kind),) = bad.items()
    names = SAID_AS.get(f"{call.name}.{name}", ()) + SAID_AS.get(name, (name,))
    if name == "value":
        names = (call.name.rpartition(".")[2],)
    is_path = kind in ("text", "empty text", "path", "long name") and name in ("path", "source")
    if is_path or any(each in message for each in names):
        return ""
    return f"{label}: the message does not say {' or '.join(names)}: {message[:200]}"


@contextlib.contextmanager
def _within_limit() -> Iterator[None]:
    def stop(*_: Any) -> None:
        raise TimeoutError(f"still running after {SECONDS:.0f} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _all(modules: tuple[str, ...]) -> list[Call]:
    return [call for call in calls(modules) if call.parameters]


def _draws(seed: int, these: list[Call], each: int) -> Iterator[tuple[Call, dict[str, str]]]:
    """Yield *each* random bad calls per parameter; one in five has a second bad argument.

    Those of a callable are the same whatever others there are.
    """
    kinds = [*BAD, "fd"]
    for call in these:
        rng = np.random.default_rng([seed, *call.name.encode()])
        for name in call.parameters:
            for kind in rng.choice(kinds, min(each, len(kinds)), replace=False):
                bad = {name: str(kind)}
                if len(call.parameters) > 1 and rng.random() < 0.2:
                    bad |= {str(rng.choice(call.parameters)): str(rng.choice(kinds))}
                yield call, bad


def _check_errors(these: list[Call], seed: int, each: int, fd: int) -> None:
    answers = [_tried(call, bad, fd) for call, bad in _draws(seed, these, each)]
    faults = list(filter(None, answers))
    print(f"\n{len(answers)} calls, {len(faults)} faults")
    assert not faults, f"{len(faults)} calls:\n" + "\n".join(faults)


@pytest.mark.parametrize("modules", [CORE, WIDGETS], ids=["core", "widgets"])
def test_every_parameter_has_a_valid_value_and_the_call_returns(modules):
    for call in _all(modules):
        for name in call.parameters:
            valid(call.name, name)
        if not public_calls.expensive(call):
            public_calls.remove(call.bound()(**call.arguments()))
            public_calls.tidy()


@pytest.mark.parametrize("modules", [CORE, WIDGETS], ids=["core", "widgets"])
def test_a_bad_argument_is_accepted_or_the_error_names_it(modules, bounded):
    cheap = [call for call in _all(modules) if not public_calls.expensive(call)]
    _check_errors(cheap, 1, 1, bounded)


@pytest.mark.parametrize(("step", "most"), every(2, [(5, 9), (1, 33)]))
@pytest.mark.parametrize("cls", [State, Pose, Locality], ids=lambda cls: cls.__name__)
def test_a_session_rejects_a_state_with_bad_parts(cls, step, most, bounded):
    """Each field of a state, or of its pose, in turn holds each *step*-th bad value."""
    state = public_calls.session().state
    last = Locality(100, 0.5, 0.3, 0.5, state.pose.cage_vertices)
    thing = {State: state, Pose: state.pose, Locality: last}[cls]
    accepted = 0
    for number, each in enumerate(fields(cls)):
        for kind in [*BAD][number % step :: step]:
            bad = replace(thing, **{each.name: BAD[kind]()})
            if cls is not State:
                bad = replace(state, **{cls.__name__.lower(): bad})
            try:
                with _within_limit():
                    Session(public_calls.mesh(), state=bad)
            except SegDeformError as error:
                message = str(error)
            except Exception as error:  # noqa: BLE001 - any other is the fault
                pytest.fail(f"{cls.__name__}({each.name}={kind}): {type(error)} {error!s:.200}")
            else:
                message = ""
                accepted += 1
            assert len(message) < LONGEST, (each.name, kind)
    print(f"{cls.__name__}: {accepted} accepted")
    assert accepted <= most  # empty ones, and pivots of no handle


POINTS = {"fit_landmarks.source", "picture_landmarks.source"}  # not paths


def _paths() -> list[tuple[Call, str]]:
    """Return the calls that take a path, each with the parameter's name."""
    names = {"path", "cache", "folder", "source"}
    pairs = [(call, name) for call in _all(CORE + WIDGETS) for name in call.parameters]
    pairs = [(call, name) for call, name in pairs if name in names or call.name in SETTERS]
    pairs = [(call, name) for call, name in pairs if f"{call.name}.{name}" not in POINTS]
    assert len(pairs) >= 15
    return pairs


@pytest.mark.parametrize("every_path", every(2, [False, True]))
def test_a_file_name_that_is_too_long_raises_one_of_our_errors(every_path, bounded):
    cheap = [pair for pair in _paths() if not public_calls.expensive(pair[0])]
    for number, (call, name) in enumerate(cheap):
        suffix = Path(valid(call.name, name)).suffix if name == "path" else ""
        longest = "x" * (255 - len(suffix)) + suffix
        paths = (longest, "x" * 300 + suffix, "x" * 300 + "/a" + suffix)
        for path in paths if every_path else [paths[number % 3]]:
            function = call.bound()
            try:
                answer = function(**call.arguments() | {name: path})
            except SegDeformError:
                continue
            public_calls.remove(answer)
        public_calls.tidy()


def test_a_file_descriptor_is_not_a_path_and_stays_open(bounded):
    for call, name in _paths():
        assert _tried(call, {name: "fd"}, bounded) == ""
        with pytest.raises(ValueError, match="must be a"):
            call.bound()(**call.arguments() | {name: bounded})
        os.fstat(bounded)
    public_calls.tidy()


@pytest.mark.campaign
@pytest.mark.parametrize("modules", [CORE, WIDGETS], ids=["core", "widgets"])
@pytest.mark.parametrize("seed", range(3))
def test_every_bad_value_for_every_argument(modules, seed, bounded):
    _check_errors(_all(modules), seed, len(BAD) + 1, bounded)
