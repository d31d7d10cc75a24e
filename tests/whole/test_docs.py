"""The pages of the documentation, read as text: nothing in them is missing, made up or stale.

`make docs` sees the rest: references, markup, and whether the pictures can be drawn.
"""

from __future__ import annotations

import ast
import doctest
import linecache
import re
import shlex
from pathlib import Path

import pytest

import vtk_segdeform as sd
from vtk_segdeform import widgets
from vtk_segdeform.cli.main import _parser, _with_signed_vectors, command
from vtk_segdeform.errors import MissingDependencyError
from vtk_segdeform.io import meshlab
from vtk_segdeform.io.convert import is_mesh_file
from vtk_segdeform.pictures.canvas import require_offscreen
from vtk_segdeform.widgets.editor.bindings import help_sections

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
MADE = ("build", "figures", "gallery")  # by `make docs`
PAGES = {
    path.relative_to(DOCS).with_suffix("").as_posix(): path.read_text(encoding="utf-8")
    for path in sorted(DOCS.rglob("*.rst"))
    if path.relative_to(DOCS).parts[0] not in MADE
}
INDEX = "gallery/index"  # made, and lists the rest of the gallery
HELD = {"Ctrl", "Shift"}  # while something else is done
DRAW = {"embedding/pyvista"}
NEED_MESHLAB = {"embedding/meshlab"}


def told_in_toctrees() -> list[str]:
    """Return the pages that toctrees name."""
    found = []
    for name, text in PAGES.items():
        for tree in re.findall(r"\.\. toctree::\n((?:[ ]+.*\n|\n)+)", text):
            entries = [line.strip() for line in tree.splitlines()]
            entries = [entry for entry in entries if entry and not entry.startswith(":")]
            found += [(Path(name).parent / entry).as_posix() for entry in entries]
    return found


def constant(module: str, name: str) -> ast.expr:
    """Return what a name is set to in a file of docs/making."""
    tree = ast.parse((DOCS / "making" / f"{module}.py").read_text(encoding="utf-8"))
    for node in tree.body:
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        if isinstance(target, ast.Name) and target.id == name:
            return node.value
    raise AssertionError(f"no {name} in docs/making/{module}.py")


def drawn() -> set[str]:
    """Return the names of the figures that `make docs` draws."""
    figures = constant("figures", "FIGURES")
    names = set(ast.literal_eval(constant("by_hand", "PICTURES")))
    for key, value in zip(figures.keys, figures.values, strict=True):
        name, count = ast.literal_eval(key), ast.literal_eval(value.elts[1])
        names |= {f"{name}-{k}" for k in range(1, count + 1)} if count else {name}
    return names


def pictures_named() -> list[str]:
    """Return the pictures that pages name."""
    pattern = r"\.\. (?:figure|image):: (\S+)"
    return [picture for text in PAGES.values() for picture in re.findall(pattern, text)]


def inclusions(text: str) -> list[tuple[Path, dict[str, str]]]:
    """Return the files that a page includes, with options."""
    found = []
    for path, options in re.findall(r"literalinclude:: (\S+)\n((?:   :.*\n)*)", text):
        found.append((ROOT / path.replace("../", ""), dict(re.findall(r":(.+?): (.*)", options))))
    return found


def test_every_page_is_in_one_toctree():
    told = told_in_toctrees()
    assert sorted(told) == sorted({*PAGES, INDEX} - {"index"})


def test_every_picture_that_a_page_names_is_there_or_is_drawn():
    for picture in pictures_named():
        if picture.startswith("/figures/"):
            assert Path(picture).stem in drawn()
        else:
            assert (DOCS / picture.lstrip("/")).is_file()


def test_every_picture_that_is_drawn_is_shown():
    assert drawn() <= {Path(picture).stem for picture in pictures_named()}


def test_pictures_that_are_kept_are_small():
    assert sum(path.stat().st_size for path in DOCS.glob("pictures/*")) < 1.5e6


@pytest.mark.parametrize(("module", "name"), [(m, n) for m in (sd, widgets) for n in m.__all__])
def test_the_api_tells_of_every_public_name(module, name):
    listed = PAGES["api/index"].split(f"``{module.__name__}``\n")[1].split(".. rubric::")[0]
    assert re.search(rf"(?m)^   {name}$", listed)
    told = "\n".join(text for page, text in PAGES.items() if page.startswith(("api/", "errors")))
    full = rf"(?:{re.escape(module.__name__)}\.)?{name}"
    assert re.search(rf"(?m)^\.\. (?:auto\w+|py:module):: {full}$", told)


def test_every_error_is_told_of():
    errors = [n for n, e in vars(sd.errors).items() if isinstance(e, type)]
    assert all(f".. autoexception:: {name}\n" in PAGES["errors"] for name in errors)


def test_what_is_said_of_errors_is_what_they_say():
    said = re.findall(r"(?m)^   \* - ``(.+)``$", PAGES["errors"])
    source = "".join(path.read_text() for path in ROOT.glob("vtk_segdeform/**/*.py"))
    assert len(said) > 5
    assert all(words in source for words in said)


def test_the_qt_example_is_included_as_it_is():
    whole = {"language": "python"}  # no option that leaves something out
    assert inclusions(PAGES["embedding/qt"]) == [(ROOT / "examples" / "qt_application.py", whole)]


@pytest.mark.parametrize("page", [name for name, text in PAGES.items() if inclusions(text)])
def test_what_is_included_is_there(page):
    for path, options in inclusions(PAGES[page]):
        text = path.read_text(encoding="utf-8")
        assert options.get("start-at", "") in text
        after = text[text.index(options.get("start-at", "")) :]
        assert all(options.get(end, "") in after for end in ("end-before", "end-at"))


@pytest.mark.parametrize("page", PAGES)
def test_python_on_a_page_comes_from_a_program_or_runs(page):
    assert "code-block:: py" not in PAGES[page]


@pytest.mark.parametrize("page", [name for name, text in PAGES.items() if ">>> " in text])
def test_the_examples_on_a_page_print_what_they_say(page, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    if page in NEED_MESHLAB and not meshlab.available():
        pytest.skip("needs PyMeshLab")
    if page in DRAW:
        try:
            require_offscreen()
        except MissingDependencyError as missing:
            pytest.skip(str(missing))
    linecache.clearcache()  # else doctest looks after every file in it first
    failed, tried = doctest.testfile(
        str(DOCS / f"{page}.rst"), module_relative=False, optionflags=doctest.NORMALIZE_WHITESPACE
    )
    assert tried
    assert not failed


@pytest.mark.parametrize("page", [name for name, text in PAGES.items() if ":kbd:" in text])
def test_every_key_that_a_page_tells_of_does_something(page):
    keys = {key for _, rows in help_sections() for caps, _ in rows for key in caps.split("  ")}
    assert set(re.findall(r":kbd:`(.+?)`", PAGES[page])) <= keys | HELD


def test_the_tables_of_keys_are_made_of_the_editors_own():
    assert ".. keys::" in PAGES["keys"]


@pytest.mark.parametrize(
    "line", sorted({line for t in PAGES.values() for line in re.findall(r"\$ segdeform (.+)", t)})
)
def test_every_command_that_a_page_tells_of_is_understood(line):
    words = _with_signed_vectors(shlex.split(line))
    assert callable(command(_parser().parse_args(words).command))


def test_files_that_are_said_to_be_read_are():
    table = PAGES["files"].split("Sessions\n")[0]
    suffixes = re.findall(r"``(\.\w+)``", table)
    assert len(suffixes) > 10
    assert all(is_mesh_file(f"mesh{suffix}") for suffix in suffixes)


def test_numbers_of_equations_are_those_of_the_paper():
    numbers = re.findall(r"\.\. equation:: (\d+)", PAGES["mathematics"])
    assert sorted(map(int, numbers)) == list(range(1, 22))
