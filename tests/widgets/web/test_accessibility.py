"""The page for people with poor sight, and without a mouse: contrast, names, roles, keys, zoom.

The rules are those of axe-core that this page can break, computed by Chromium.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from chromium import Chromium, Page, needs_chromium
from web_hands import Served

from vtk_segdeform import Mesh

pytestmark = needs_chromium

LEAST = 4.5  # contrast of text, by WCAG 2, level AA
CONTROLS = "button, a[href], input:not([type=file]), select, [tabindex='0']"
SEEN = """
const seen = (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true })
  && e.getBoundingClientRect().width > 0;
const usable = (e) => !e.closest(':disabled, .disabled');
"""
# Texts whose colour differs too little from what is behind them: of a gradient, its worst end.
LOW_CONTRAST = f"""(() => {{ {SEEN}
const pen = document.createElement('canvas').getContext('2d', {{ willReadFrequently: true }});
const rgba = (colour) => {{
  pen.clearRect(0, 0, 1, 1); pen.fillStyle = colour; pen.fillRect(0, 0, 1, 1);
  const [r, g, b, a] = pen.getImageData(0, 0, 1, 1).data;
  return [r, g, b, a / 255];
}};
const over = ([r, g, b, a], under) => [r, g, b].map((c, k) => a * c + (1 - a) * under[k]);
const light = (colour) => colour.map((c) => c / 255)
  .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
  .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
const contrast = (a, b) => {{
  const [low, high] = [light(a), light(b)].sort((x, y) => x - y);
  return (high + 0.05) / (low + 0.05);
}};
const behind = (e) => {{
  if (!e) return [[255, 255, 255]];
  const style = getComputedStyle(e), own = rgba(style.backgroundColor);
  const ends = style.backgroundImage.match(/rgba?\\([^)]*\\)/g);
  if (ends) return ends.map((end) => rgba(end).slice(0, 3));
  return own[3] === 1 ? [own.slice(0, 3)] : behind(e.parentElement).map((c) => over(own, c));
}};
const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
const found = [];
while (texts.nextNode()) {{
  const text = texts.currentNode.data.trim(), e = texts.currentNode.parentElement;
  if (!text || !seen(e) || !usable(e) || e.closest('script, noscript, style')) continue;
  const ink = rgba(getComputedStyle(e).color);
  const worst = Math.min(...behind(e).map((back) => contrast(over(ink, back), back)));
  if (worst < {LEAST}) found.push(`${{text}} (${{e.className}}): ${{worst.toFixed(2)}}`);
}}
return found; }})()"""
# What can be used inside of something that is used itself, as a whole.
NESTED = f"""(() => {{ const wholes = 'button, a, [role=option], [role=menuitem], [role=button]';
return [...document.querySelectorAll(wholes)].filter((e) => e.querySelector("{CONTROLS}"))
  .map((e) => e.outerHTML.slice(0, 80)); }})()"""
ROLES = {
    "alert", "alertdialog", "columnheader", "dialog", "grid", "gridcell", "group", "img",
    "menu", "menuitem", "progressbar", "row", "rowgroup",
}  # fmt: skip
# Of a role, what its parent or an ancestor must be.
WITHIN = {
    "row": "[role=grid]", "gridcell": "[role=row]", "columnheader": "[role=row]",
    "menuitem": "[role=menu]",
}  # fmt: skip


@pytest.fixture(scope="module")
def served(cactus: Mesh) -> Iterator[Served]:
    with Served(cactus) as served:
        yield served


def faults(page: Page) -> list[str]:
    """Return what is wrong in the present state of *page*, in its present colours."""
    found = page.evaluate(LOW_CONTRAST)
    found += [f"nested: {each}" for each in page.evaluate(NESTED)]
    nodes = page.call("Accessibility.getFullAXTree")["nodes"]
    found += [f"no name: {_of(node, 'role')}" for node in nodes if _is_nameless(node)]
    roles = page.evaluate("[...document.querySelectorAll('[role]')].map((e) => e.role)")
    found += [f"unknown role: {role}" for role in sorted(set(roles) - ROLES)]
    for role, ancestor in WITHIN.items():
        outside = f"[...document.querySelectorAll('[role={role}]')].filter("
        outside += f"(e) => !e.parentElement.closest('{ancestor}')).length"
        found += [f"{role} outside of {ancestor}"] * page.evaluate(outside)
    return found


def _of(node: dict[str, Any], what: str) -> str:
    return str(node.get(what, {}).get("value", ""))


def _is_nameless(node: dict[str, Any]) -> bool:
    has_name = any(map(str.isalnum, _of(node, "name")))  # more than the glyph of an icon
    can_focus = any(each["name"] == "focusable" for each in node.get("properties", []))
    is_control = _of(node, "role") not in ("RootWebArea", "option")  # a select names its options
    return can_focus and is_control and not node.get("ignored") and not has_name


def faults_in_both_colours(page: Page) -> list[str]:
    """Return the `faults` of the present state, in light and dark; leave the other one."""
    found = faults(page)
    is_dark = page.evaluate("!!document.querySelector('.sd.dark')")
    scheme = {"name": "prefers-color-scheme", "value": "light" if is_dark else "dark"}
    page.call("Emulation.setEmulatedMedia", features=[scheme])
    page.wait(f"!!document.querySelector('.sd.dark') !== {str(is_dark).lower()}")
    page.wait("document.getAnimations().every((each) => each.playState !== 'running')")
    return found + page.evaluate(LOW_CONTRAST)


def test_texts_have_contrast_and_controls_have_names_and_roles(
    served: Served, browser: Chromium
) -> None:
    page = served.page(browser)
    page.call("Accessibility.enable")
    assert page.evaluate("document.querySelector('meta[name=viewport]').content").count("=") == 2
    found = {"first": faults_in_both_colours(page)}
    for key, mode in zip("12340", ("regions", "cages", "handles", "deform", "pull"), strict=True):
        page.move((400.0, 400.0))
        page.key(key)
        page.wait(f"document.querySelector('.sd-modes .down')?.dataset.name === 'mode.{mode}'")
        found[mode] = faults_in_both_colours(page)
    page.click("[data-name=view]")
    page.wait("!!document.querySelector('.sd-menu')")
    found["menu"] = faults_in_both_colours(page)
    page.key("Escape")
    page.click("[data-name=help]")
    page.wait("!!document.querySelector('.sd-help')")
    found["help"] = faults_in_both_colours(page)
    assert {state: each for state, each in found.items() if each} == {}
    assert [each for each in page.messages() if each.startswith(("error", "warning"))] == []
    page.close()


def test_keys_alone_reach_every_control(served: Served, browser: Chromium) -> None:
    page = served.page(browser)
    controls = f"""(() => {{ {SEEN} return [...document.querySelectorAll("{CONTROLS}")]
      .filter((e) => seen(e) && usable(e)); }})()"""
    count = page.evaluate(f"window.todo = new Set({controls}); window.todo.size")
    assert count > 10
    page.key("F6")
    for _ in range(2 * count):
        page.evaluate("window.todo.delete(document.activeElement)")
        page.key("Tab")
    left = "[...window.todo].filter((e) => e.isConnected)"  # a job may have ended since
    assert page.evaluate(f"{left}.map((e) => e.outerHTML.slice(0, 120))") == []
    page.close()


def test_no_two_controls_lie_over_each_other_on_a_phone(served: Served, browser: Chromium) -> None:
    page = served.page(browser, size=(390, 844), touch=True)
    found = page.evaluate(f"""(() => {{ {SEEN}
      const boxes = [...document.querySelectorAll("{CONTROLS}")].filter(seen)
        .map((e) => [e.dataset.name || e.title || e.tagName, e.getBoundingClientRect()]);
      return boxes.flatMap(([name, a], k) => boxes.slice(k + 1)
        .filter(([, b]) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2
          && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2)
        .map(([other]) => `${{name}} and ${{other}}`)); }})()""")
    assert found == []
    page.close()
