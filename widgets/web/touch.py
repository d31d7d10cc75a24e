"""Hints for fingers: what to tap instead of a key or a click with Shift.

Drag a cage vertex · Next: 4, deform             Drag a cage vertex · Next: [deform]
No cages yet. Press F to fit them to ...         No cages yet. [Fit them to ...]
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from ..panel import Word

# What a key does is named after it; another key may come between.
_USE = re.compile(r"(?:, \w)?(?:: |, | to )([^.·,():]+?)(?=$| ·|[.,()])")
_OTHERS = (
    (re.compile(r"Shift-click pins\."), "Choose Pin, then tap: the point stays."),
    (re.compile(r" Shift\+wheel: radius \([^)]*\)"), " Two fingers: turn and zoom."),
    (re.compile(r"(?: · |\. )Ctrl: erase"), ""),
    (re.compile(r"X Y Z: axis\. (?:R: turn\. )?"), ""),
    (re.compile(r"Shift-click"), "Choose Pin, then tap"),
)


def for_fingers(words: Iterable[Word]) -> tuple[Word, ...]:
    """Return the *words* of a hint with links that say what they do, not which key does it.

    >>> for_fingers([Word("Drag a cage vertex · Next: "), Word("4", "deform"), Word(", deform")])
    (Word(text='Drag a cage vertex · Next: ', action=''), Word(text='deform', action='deform'))
    """
    words, found = list(words), list[Word]()
    for k, word in enumerate(words):
        if not word.action:
            found.append(word)
            continue
        rest = words[k + 1].text if k + 1 < len(words) else ""
        use = _USE.match(rest)
        if use is None:
            found.append(word)
            continue
        words[k + 1] = replace(words[k + 1], text=rest[use.end() :])
        text, before = use[1], found[-1].text if found else ""
        if before.endswith("Press "):
            found[-1] = replace(found[-1], text=before.removesuffix("Press "))
        if before.endswith((". ", "Press ")):
            text = text[:1].upper() + text[1:]
        found.append(Word(text, word.action))
    plain = (replace(word, text=_plain(word.text)) for word in found)
    return tuple(word for word in plain if word.text)


def _plain(text: str) -> str:
    for pattern, instead in _OTHERS:
        text = pattern.sub(instead, text)
    return text
