"""Names that people give: what may be one, and what becomes of those of regions.

A name is text in any script, to be shown on one line: no control characters, no line breaks,
none that turn the direction of what follows, and at most 80 letters.

Regions are numbered, and a name is only what they are called.  One without a name is called by
its place, "region 1" for the first; so these words are no other region's to take.  Names are
kept as a tuple, "" for none, without those at its end: a region that comes last needs no care.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from ..checks import require_sequence, shown
from ..errors import RegionError

LONGEST = 80
Names = tuple[str, ...]

_CONTROL = {"Cc", "Cs", "Zl", "Zp"}  # surrogates among them, which no file can hold
_TURNING = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}
_PLACE = re.compile(r"region \d+")


def fault_of(name: object) -> str:
    """Return what is wrong with a *name*, to be read after what it is of; "" if nothing is.

    >>> fault_of("Arm, left"), fault_of("a" * 90)
    ('', "'s name may have 80 letters; got 90")
    """
    if not isinstance(name, str) or not name.strip():
        return f"'s name must be printable text; got {shown(name)}"
    if len(name) > LONGEST:
        return f"'s name may have {LONGEST} letters; got {len(name)}"
    for letter in name:
        turns = unicodedata.bidirectional(letter) in _TURNING
        if turns or unicodedata.category(letter) in _CONTROL:
            return f"'s name must be printable text; got {shown(name)}"
    return ""


def called(names: Names, region: int) -> str:
    """Return what a *region* is called; also one that is still to come.

    >>> called(("", "arm"), 0), called(("", "arm"), 1)
    ('region 1', 'arm')
    """
    return (names[region] if region < len(names) else "") or f"region {region + 1}"


def renamed(names: Names, region: int, name: str) -> Names:
    """Return *names* with another one for *region*; with "" it is called by its place again.

    Raises
    ------
    RegionError
        If *name* cannot be one, or is another region's.
    """
    if not isinstance(name, str):
        raise RegionError(f"a region{fault_of(name)}")
    given = name.strip()
    if given == f"region {region + 1}":
        given = ""
    longer = [*names, *[""] * (region + 1 - len(names))]
    longer[region] = ""
    if given != "":
        _require_free(given, longer)
    longer[region] = given
    return _trimmed(longer)


def merged(names: Names, which: Sequence[int]) -> Names:
    """Return *names* where regions became one, in the place of the first: it takes their first.

    >>> merged(("arm", "", "leg"), [1, 2])
    ('arm', 'leg')
    """
    numbers = sorted(set(which))
    kept = next((names[k] for k in numbers if k < len(names) and names[k]), "")
    after = list(names) + [""] * (numbers[0] + 1 - len(names))
    after[numbers[0]] = kept
    return _trimmed([name for k, name in enumerate(after) if k not in numbers[1:]])


def split(names: Names, region: int, count: int) -> Names:
    """Return *names* where one of *count* regions was cut, its second part the last.

    >>> split(("", "arm"), 1, 3)
    ('', 'arm', '', 'arm 2')
    """
    name = names[region] if region < len(names) else ""
    if not name:
        return names
    stem, number = name, 2
    if found := re.fullmatch(r"(.*\S) (\d{1,4})", name):
        stem, number = found[1], int(found[2]) + 1
    while (second := f"{stem[: LONGEST - 6]} {number}") in names:
        number += 1
    if _PLACE.fullmatch(second):  # of somebody's "region"
        return names
    return (*names, *[""] * (count - len(names)), second)


def checked_names(names: Sequence[object], count: int) -> Names:
    """Return the *names* of *count* regions, or a RegionError that says what is wrong with them."""
    require_sequence(names, "region_names")
    if len(names) > count:
        raise RegionError(f"there are {len(names)} names for {count} regions")
    checked: list[str] = []
    for region, name in enumerate(names):
        if not isinstance(name, str):
            raise RegionError(f"a region{fault_of(name)}")
        if name and name != f"region {region + 1}":
            _require_free(name, checked)
        checked.append("" if name == f"region {region + 1}" else name)
    return _trimmed(checked)


def _require_free(name: str, others: Sequence[str]) -> None:
    fault = fault_of(name)
    if fault:
        raise RegionError(f"a region{fault}")
    if name in others:
        raise RegionError(f"there is a region {name!r} already; choose another name")
    if _PLACE.fullmatch(name):
        raise RegionError(
            f"{name!r} is what a region in that place is called while it has no name; "
            "choose another name"
        )


def _trimmed(names: Sequence[str]) -> Names:
    last = max((k for k, name in enumerate(names) if name), default=-1)
    return tuple(names[: last + 1])
