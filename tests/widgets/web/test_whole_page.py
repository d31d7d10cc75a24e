"""The page as one document: what it would load is inside."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("trame")
from solids import OCTAHEDRON

from vtk_segdeform import Mesh
from vtk_segdeform.widgets.web import WebEditor
from vtk_segdeform.widgets.web import whole_page as module


@pytest.fixture(scope="module")
def document() -> str:
    editor = WebEditor(Mesh(*OCTAHEDRON))
    page = module.whole_page(editor.server)
    state = editor.server.state
    assert state.trame__scripts == state.trame__module_scripts == state.trame__styles == []
    editor.close()
    return page


def test_it_loads_nothing(document: str) -> None:
    assert re.findall(r"<script[^>]*\bsrc=", document) == []
    assert re.findall(r"<link[^>]*>", document) == ['<link rel="icon" href="data:,">']
    styles = " ".join(re.findall("<style>(.*?)</style>", document, re.DOTALL))
    assert set(re.findall(r"url\([\"']?(.{5})", styles)) == {"data:"}
    assert re.findall(r"^import .*|^export .*", document, re.MULTILINE) == []
    for font in ("woff2", "ttf"):
        assert re.search(rf'url\("data:font/{font};base64,[\w+/]{{1000}}', document), font


def test_its_scripts_end_where_they_should(document: str, tmp_path: Path) -> None:
    assert document.count("<script") == document.count("</script")
    assert module._script("a = '</script>';") == r"a = '<\/script>';"
    for name, text in {"b.js": "export default 1;", "a.js": "import b from './b.js';\nb;"}.items():
        (tmp_path / name).write_text(text)
    blocks = [*module._blocks(tmp_path / "a.js", set())]
    assert blocks == ["{\nexported['b.js'] = 1;\n}", "{\nconst b = exported['b.js'];\nb;\n}"]
