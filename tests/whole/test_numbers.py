"""Measured numbers in README.md and on the pages are printed by a command that their text names.

A comment beside them names it, as ``.. printed by: COMMAND => 0.085; 25 steps`` in
reStructuredText and with ``<!-- -->`` in Markdown: the command succeeds and prints, after rounding,
each number and phrase behind the arrow.  Times differ between machines and are not listed there.
Commands that take longer are marked ``printed by, in the campaign``.  FOLDER is an empty folder,
whose reports count as printed.
"""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    *(
        ROOT / "docs" / f"{name}.rst"
        for name in (
            "batch", "comparison", "constraints", "landmarks", "mathematics", "speed", "volumes",
        )
    ),
]  # fmt: skip
# The percentages of the others are choices and goals.
MEASURING = [page for page in PAGES if page.stem in ("README", "comparison", "speed")]
MARK = re.compile(
    r"(?m)^\s*(?:<!--|\.\.) printed by(?P<long>, in the campaign)?: (?P<command>.+?)"
    r"(?: => (?P<printed>.+?))?(?: -->)?$"
)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?")
MEASURED = re.compile(r"\d ?(?:ms|s|%)(?![\w-])")
HEADING = r"(?m)^(?:#+ .+|.+\n(?:====+|----+))$"


def marks():
    """Return the commands, each once, as parameters of a test."""
    found = {}
    for page in PAGES:
        for mark in MARK.finditer(page.read_text(encoding="utf-8")):
            printed = found.setdefault((mark["command"], bool(mark["long"])), [])
            printed += (mark["printed"] or "").split("; ")
    return [
        pytest.param(command, printed, marks=[pytest.mark.campaign] if long else [], id=command)
        for (command, long), printed in found.items()
    ]


def is_printed(expected: str, output: str) -> bool:
    """Whether a phrase, or a number to the digits that it has, is in the output."""
    number = NUMBER.match(expected)
    if number is None or number[0] not in (expected, expected.removesuffix(" %")):
        return expected in output
    mantissa, _, exponent = number[0].partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    unsigned = [abs(float(each)) for each in NUMBER.findall(output)]
    return any(abs(each - abs(float(number[0]))) <= 0.5001 * unit for each in unsigned)


@pytest.mark.parametrize(("command", "expected"), marks())
def test_the_commands_beside_numbers_print_them(tmp_path, command, expected, capsys):
    program = command.removeprefix("python ")
    if program.startswith("examples/") and program.endswith(".py"):  # starting Python takes longer
        runpy.run_path(str(ROOT / program))
        output = capsys.readouterr().out
        assert [each for each in expected if not is_printed(each, output)] == []
        return
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        command.replace("FOLDER", str(tmp_path)), shell=True, cwd=ROOT,
        env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    if "skipped" in done.stdout and "pytest" in command:
        pytest.skip(done.stdout)
    output = done.stdout + "".join(report.read_text() for report in tmp_path.rglob("*.md"))
    assert [each for each in expected if not is_printed(each, output)] == []


@pytest.mark.parametrize("page", MEASURING, ids=lambda page: page.name)
def test_every_section_with_measurements_names_a_command(page):
    for section in re.split(HEADING, page.read_text(encoding="utf-8")):
        if MEASURED.search(MARK.sub("", section)):
            assert MARK.search(section), section


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_numbers_of_a_comment_are_those_of_its_page(page):
    text = page.read_text(encoding="utf-8")
    shown = {each.lstrip("+-") for each in NUMBER.findall(MARK.sub("", text))}
    for mark in MARK.finditer(text):
        listed = {each.lstrip("+-") for each in NUMBER.findall(mark["printed"] or "")}
        assert listed <= shown, mark[0]


def test_numbers_are_compared_to_the_digits_that_they_have():
    assert is_printed("0.085", "distortion 0.0854")
    assert not is_printed("0.085", "distortion 0.0861")
    assert is_printed("-7.3 %", "volume -7.31 %")
    assert is_printed("4e-04", "4.2e-04")
    assert not is_printed("25 steps", "26 steps")
