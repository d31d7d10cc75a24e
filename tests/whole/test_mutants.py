"""Mutants are tested by the tests of their folder, and the tree stays as it is."""

from __future__ import annotations

import mutants
import pytest


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
