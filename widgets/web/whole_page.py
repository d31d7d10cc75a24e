"""The page as one document, which loads nothing: scripts, styles and fonts are inside.

In a notebook no address may lead to the kernel, so there is nothing that a page could load.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from trame_client.module import vue3

_PAGE = Path(__file__).with_name("page")
_IMPORT = re.compile(r"^import (?:(\w+) from )?'\./([\w.]+)';$", re.MULTILINE)
_URL = re.compile(r"""url\(["']?(?!data:)([^"')?]+)[^)]*\)""")
_DOCUMENT = """\
<!doctype html>
<html lang="en" data-app-name="trame">
<head><meta charset="utf-8"><meta name="viewport"><link rel="icon" href="data:,">
{head}
</head>
<body><div id="app"></div></body>
</html>
"""


def whole_page(server: Any) -> str:
    """Return the page of a trame *server* as one HTML document.

    The server lists no files any more: pages at its address would lack them.
    """
    state, www = server.state, Path(vue3.www)
    styles = [*www.glob("assets/*.css"), *_files(server, state.trame__styles)]
    scripts = [_PAGE / "tunnel.js", www / "vue.global.js", *_files(server, state.trame__scripts)]
    ours = [_blocks(path, set()) for path in _files(server, state.trame__module_scripts)]
    modules = ["\n".join(["const exported = {};", *blocks]) for blocks in ours]
    modules += [_text(path) for path in www.glob("assets/*.js")]
    state.trame__styles, state.trame__scripts, state.trame__module_scripts = [], [], []
    head = [f"<style>{_style(path)}</style>" for path in styles]
    head += [f"<script>{_script(_text(path))}</script>" for path in scripts]
    head += [f'<script type="module">{_script(text)}</script>' for text in modules]
    return _DOCUMENT.format(head="\n".join(head))


def _files(server: Any, addresses: Iterable[str]) -> Iterator[Path]:
    """Yield the files that *server* has at relative *addresses*."""
    for each in addresses:
        folder, _, name = each.partition("/")
        yield Path(server.serve[folder]) / name


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _script(text: str) -> str:
    """Return a script such that it does not end its element."""
    return text.replace("</script", r"<\/script").replace("<!--", r"<\!--")


def _style(path: Path) -> str:
    """Return a style sheet with the fonts that it loads; formats that are missing are left out."""

    def inside(found: re.Match[str]) -> str:
        file = path.parent / found[1]
        data = base64.b64encode(file.read_bytes()).decode() if file.is_file() else ""
        return f'url("data:font/{file.suffix[1:]};base64,{data}")'

    return _URL.sub(inside, _text(path))


def _blocks(path: Path, known: set[str]) -> Iterator[str]:
    """Yield the modules that the one at *path* imports, and then itself, as blocks of one script.

    Modules import from files beside them, and export by default only.
    """
    text = _text(path)
    for _, name in _IMPORT.findall(text):
        if name not in known:
            known.add(name)
            yield from _blocks(path.with_name(name), known)
    text = _IMPORT.sub(r"const \1 = exported['\2'];", text).replace("const  = ", "")
    text = text.replace("export default ", f"exported['{path.name}'] = ")
    yield f"{{\n{text}\n}}"
