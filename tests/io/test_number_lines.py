"""Lines of numbers: parsed at once, or left to the caller if they are not plain."""

from __future__ import annotations

import pytest

from vtk_segdeform.io.number_lines import Lines


@pytest.mark.parametrize(
    ("text", "is_plain"),
    [("v 1 2.5 -3e2\nf 1 2 3\nv\t0 0 0 \r\n", True), ("v 1 2\nv 1 2 3\n", False),
     ("v 1 2 3\nv 1 2\n", False), ("v 1 x\n", False), ("v 1 2 # 3\n", False), ("f 1 2 3\n", False),
     ("v 1\n 2\n", True)],
)  # fmt: skip
def test_a_table_has_rows_of_as_many_plain_numbers(text, is_plain):
    table = Lines(text.encode(), ("v", "f")).table("v")
    assert (table is not None) == is_plain


@pytest.mark.parametrize(
    ("text", "expected"),
    [("f 1 2 -3\nv 1 2 3\nf 4 5 6 7", [[1, 0, 0], [2, 0, 0], [-3, 0, 0], [4, 0, 0]]),
     ("f 1/2 3/4\n", [[1, 2, 0], [3, 4, 0]]), ("f 1//2 3//4", [[1, 0, 2], [3, 0, 4]]),
     ("f\t1/2/-3 \r\n", [[1, 2, -3]]), ("f 0 1 2", None), ("f 1/0", None), ("f 1/ 2/", None),
     ("f /1 2", None), ("f 1/2/3/4", None), ("f 1 a", None), ("f 1//", None), ("f 1.0", None),
     ("f 1/-/2", None), ("f 123456789012345678", None), ("f - 1", None), ("f 1 2 #", None)],
)  # fmt: skip
def test_corners_are_whole_numbers_given_in_one_way(text, expected):
    found = Lines(text.encode(), ("v", "f")).corners("f")
    assert (found is None) == (expected is None)
    if expected is not None:
        assert found[1][: len(expected)].tolist() == expected


def test_lines_of_a_word_are_found_wherever_they_are():
    lines = Lines(b"v 1\nv 2\nf 1\n# no\nv 3\n\nf 2", ("v", "f"))
    assert lines.of("v") == b"v 1\nv 2\nv 3\n"
    assert lines.of("f") == b"f 1\nf 2\n"
    assert lines.above("v").tolist() == [0, 1, 2, 2, 2, 3, 3]
    assert [text for _, text in lines.others()] == ["# no", ""]
