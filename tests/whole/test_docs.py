"""The pages of the documentation, read as text: nothing in them is missing, invented or stale.

`make docs` checks the rest: references, markup, and whether the pictures can be drawn.
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
from vtk_segdeform.widgets.editor.bindings import DEFAULT_KEYS

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
GENERATED = ("build", "figures", "gallery")  # by `make docs`
PAGES = {
    path.relative_to(DOCS).with_suffix("").as_posix(): path.read_text(encoding="utf-8")
    for path in sorted(DOCS.rglob("*.rst"))
    if path.relative_to(DOCS).parts[0] not in GENERATED
}
INDEX = "gallery/index"  # generated, and lists the rest of the gallery
MODIFIERS = {"Ctrl", "Shift"}
DRAW = {"embedding/pyvista"}
NEED_MESHLAB = {"embedding/meshlab"}


def pages_in_toctrees() -> list[str]:
    """Return the pages that toctrees name."""
    found = []
    for name, text in PAGES.items():
        for tree in re.findall(r"\.\. toctree::\n((?:[ ]+.*\n|\n)+)", text):
            entries = [line.strip() for line in tree.splitlines()]
            entries = [entry for entry in entries if entry and not entry.startswith(":")]
            found += [(Path(name).parent / entry).as_posix() for entry in entries]
    return found


def constant(module: str, name: str) -> ast.expr:
    """Return the value of a constant in a file of docs/making."""
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
    found = pages_in_toctrees()
    assert sorted(found) == sorted({*PAGES, INDEX} - {"index"})


def test_every_picture_that_a_page_names_is_there_or_is_drawn():
    for picture in pictures_named():
        if picture.startswith("/figures/"):
            assert Path(picture).stem in drawn()
        else:
            assert (DOCS / picture.lstrip("/")).is_file()


def test_every_picture_that_is_drawn_is_shown():
    assert drawn() <= {Path(picture).stem for picture in pictures_named()}


def test_pictures_in_the_repository_are_small():
    sizes = {path.name: path.stat().st_size for path in DOCS.glob("pictures/*")}
    assert sizes.pop("drag.gif") < 2e6
    assert sum(sizes.values()) < 1.4e6  # in full colour where a palette would show bands


def test_pictures_in_the_repository_are_shown():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = "\n".join([readme, *PAGES.values()])
    kept = [path.name for path in DOCS.glob("pictures/*")]
    assert [name for name in kept if f"pictures/{name}" not in shown] == []


def test_links_of_the_readme_lead_somewhere():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", readme) if "://" not in link]
    assert len(links) > 10
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_api_pages_have_every_public_name():
    api = "\n".join(text for page, text in PAGES.items() if page.startswith(("api/", "errors")))
    for module in (sd, widgets):
        listed = PAGES["api/index"].split(f"``{module.__name__}``\n")[1].split(".. rubric::")[0]
        for name in module.__all__:
            assert re.search(rf"(?m)^   {name}$", listed), name
            full = rf"(?:{re.escape(module.__name__)}\.)?{name}"
            assert re.search(rf"(?m)^\.\. (?:auto\w+|py:module):: {full}$", api), name


def test_every_error_is_on_its_page():
    errors = [n for n, e in vars(sd.errors).items() if isinstance(e, type)]
    assert all(f".. autoexception:: {name}\n" in PAGES["errors"] for name in errors)


def test_the_messages_on_the_page_of_errors_are_those_of_the_code():
    messages = re.findall(r"(?m)^   \* - ``(.+)``$", PAGES["errors"])
    source = "".join(path.read_text() for path in ROOT.glob("vtk_segdeform/**/*.py"))
    assert len(messages) > 5
    assert [message for message in messages if message not in source] == []


def test_the_qt_example_is_included_as_it_is():
    whole = {"language": "python"}  # no option that omits a part
    assert inclusions(PAGES["embedding/qt"]) == [(ROOT / "examples" / "qt_application.py", whole)]


def test_the_markers_of_inclusions_are_there():
    found = [each for text in PAGES.values() for each in inclusions(text)]
    assert found
    for path, options in found:
        text = path.read_text(encoding="utf-8")
        assert options.get("start-at", "") in text, path
        after = text[text.index(options.get("start-at", "")) :]
        assert all(options.get(end, "") in after for end in ("end-before", "end-at")), path


def test_python_on_a_page_comes_from_a_program_or_runs():
    assert [page for page, text in PAGES.items() if "code-block:: py" in text] == []


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
    linecache.clearcache()  # else doctest checks every file in it first
    failed, tried = doctest.testfile(
        str(DOCS / f"{page}.rst"), module_relative=False, optionflags=doctest.NORMALIZE_WHITESPACE
    )
    assert tried
    assert not failed


def test_every_key_on_a_page_has_an_action():
    known = {
        key for _, rows in DEFAULT_KEYS.sections() for caps, _ in rows for key in caps.split("  ")
    }
    for page, text in PAGES.items():
        keys = set(re.findall(r":kbd:`(.+?)`", text.replace(r"\\", "\\")))
        assert keys <= known | MODIFIERS, page


def test_the_tables_of_keys_are_generated():
    assert ".. keys::" in PAGES["keys"]


def test_every_command_on_a_page_is_valid(capsys):
    lines = {line for t in PAGES.values() for line in re.findall(r"\$ segdeform (.+)", t)}
    assert len(lines) > 20
    parser = _parser()
    for line in lines:
        try:
            given = parser.parse_args(_with_signed_vectors(shlex.split(line)))
        except SystemExit:
            pytest.fail(f"{line}: {capsys.readouterr().err}")
        assert callable(command(given.command)), line


def test_the_formats_on_the_page_of_files_are_readable():
    table = PAGES["files"].split("Sessions\n")[0]
    suffixes = re.findall(r"``(\.\w+)``", table)
    assert len(suffixes) > 10
    assert all(is_mesh_file(f"mesh{suffix}") for suffix in suffixes)


def test_the_places_of_changes_have_what_the_guide_names():
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = guide.split("## Where a change goes\n")[1].split("\n## ")[0]
    places = re.findall(r"(?m)\d\. `(\S+\.py)`(.*?)(?=\d\. `|$)", section)
    known = [(path, text) for path, text in places if "NAME" not in path]
    assert {path.split("/")[0] for path, _ in known} == {"vtk_segdeform", "widgets", "tests"}
    for path, text in known:
        source = (ROOT / path).read_text(encoding="utf-8")
        assert [name for name in re.findall(r"`([^`]+)`", text) if name not in source] == [], path


@pytest.mark.parametrize("page", ["architecture", "mathematics", "speed"])
def test_the_files_that_a_page_names_are_there(page):
    named = set(re.findall(r"[\w/]+/\w+\.py", PAGES[page]))
    folders = (ROOT, ROOT / "vtk_segdeform")
    assert named
    assert [name for name in named if not any((f / name).is_file() for f in folders)] == []


def test_the_architecture_has_every_folder():
    folders = [path.parent.name for path in ROOT.glob("vtk_segdeform/*/__init__.py")]
    folders += [path.parent.name for path in ROOT.glob("widgets/*/__init__.py")]
    assert len(folders) > 20
    assert [name for name in folders if f"``{name}/``" not in PAGES["architecture"]] == []


def test_the_functions_on_the_way_to_the_factor_are_in_their_files():
    line = r"(?m)^ +(?:\w+\.)?(\w+)(?:[:(].*)? {2,}(\w+/\w+\.py)$"
    found = re.findall(line, PAGES["architecture"])
    assert len(found) > 10
    for name, path in found:
        source = (ROOT / "vtk_segdeform" / path).read_text()
        assert re.search(rf"\b{name}\b", source), f"no {name} in {path}"


def test_numbers_of_equations_are_those_of_the_paper():
    numbers = re.findall(r"\.\. equation:: (\d+)", PAGES["mathematics"])
    assert sorted(map(int, numbers)) == list(range(1, 22))
