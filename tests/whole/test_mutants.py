"""Mutants are what their operators say, and testing them leaves the tree as it is."""

from __future__ import annotations

import ast

import mutants
import mutations
import pytest


def made(tmp_path, monkeypatch, code):
    """Return the changes of *code*, as text."""
    monkeypatch.setattr(mutations, "ROOT", tmp_path)
    path = tmp_path / "module.py"
    path.write_text(code)
    found = mutations.mutants_of(path)
    before = ast.unparse(ast.parse(code))
    sources = [each.source() for each in found]
    assert before not in sources
    assert len(set(sources)) == len(sources)
    assert ast.unparse(found[0].tree) == before if found else True
    return [str(each).split(" :: ")[-1] for each in found]


@pytest.mark.parametrize(
    ("code", "changes"),
    [
        ("x = a < b", ["a < b  ->  a <= b", "a < b  ->  a >= b"]),
        ("x = a is not b", ["a is not b  ->  a is b"]),
        ("x = a + b", ["a + b  ->  a - b"]),
        ("x -= b", ["x -= b  ->  x += b", "x -= b  ->  pass"]),
        ("x = a[1:]", ["1  ->  2", "1  ->  0"]),
        ("x = 0.5", ["0.5  ->  1.5"]),
        ("x = not a or b", ["not a or b  ->  not a and b", "not a  ->  a"]),
        ("x = f(a, b)", ["f(a, b)  ->  f(b, a)"]),
        ("x = a if b else c", ["a if b else c  ->  a if not b else c"]),
        ("x.y = a", ["x.y = a  ->  pass"]),
        ("x = 'name'", ["'name'  ->  'othername'"]),
        ("def f(a):\n    return a", ["return a  ->  return None"]),
        ("if a < b:\n    raise E('at 1')", ["a < b  ->  a <= b", "a < b  ->  a >= b",
                                           "raise E('at 1')  ->  pass"]),
    ],
)  # fmt: skip
def test_an_operator_changes_one_thing(code, changes, tmp_path, monkeypatch):
    assert made(tmp_path, monkeypatch, code) == changes


@pytest.mark.parametrize(
    "code",
    [
        '"""Text."""',
        "x: int | None",
        "def f(a: int | str) -> int | None: ...",
        "x = 'two words'",
        "x = f'{a} of {b + 1}'",
        "_PIECE = 1 << 20",
        "__all__ = ['a']",
        "x = compiled_checks(n)",
        "x.__dict__['name'] = a + 1",
        "x = np.minimum(a, b)",
        "x = f(a, a)",
        "@decorated(1)\ndef f(): ...",
    ],
)
def test_on_what_only_speed_or_text_depends_nothing_is_changed(code, tmp_path, monkeypatch):
    assert made(tmp_path, monkeypatch, code) == []


def test_the_tests_of_a_module_are_those_of_its_folder_and_its_own_come_first():
    path = mutants.ROOT / "vtk_segdeform" / "mesh" / "topology.py"
    tests = mutants.chosen_tests(path)
    assert mutants.folder_of(path) == "mesh"
    assert tests[0] == "tests/mesh/test_topology.py"
    assert "tests/mesh/test_soup.py" in tests
    path = mutants.ROOT / "vtk_segdeform" / "mesh" / "mesh.py"
    assert mutants.chosen_tests(path)[1].endswith("[vtk_segdeform.mesh.mesh]")
    assert mutants.folder_of(mutants.ROOT / "widgets" / "scene" / "view.py") == "widgets/scene"


def test_lines_listed_as_equivalent_are_lines_of_the_code():
    for row in mutants.EQUIVALENT.read_text("utf-8").splitlines():
        if not row.startswith("#"):
            file, code, *_, reason = row.split(" :: ")
            lines = (mutants.ROOT / file).read_text("utf-8").splitlines()
            assert code in [line.strip() for line in lines], row
            assert reason


@pytest.mark.campaign
def test_a_fault_is_killed_on_a_copy_and_the_tree_stays_as_it_is(monkeypatch):
    path = mutants.ROOT / "vtk_segdeform" / "mesh" / "triangles.py"
    before = path.read_bytes()
    chosen = [each for each in mutants.mutants_of(path) if each.operator == "return"][:2]
    assert mutants.results_of(chosen, 2) == ["killed", "killed"]
    assert path.read_bytes() == before
