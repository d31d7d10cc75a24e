"""Names of regions, handles and volumes.

A name is text in any script that can be shown on one line: at most 80 characters, without control
characters, line breaks and characters that change the writing direction.

Regions are identified by number.  A region without a name is shown as "region 1", "region 2", ...
by its number, and no other region can have this name.  Names are stored as a tuple with "" for
regions without a name; regions at the end without a name are left out.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from ..arrays import is_whole
from ..checks import require_sequence, shown
from ..errors import RegionError

LONGEST = 80
Names = tuple[str, ...]

_CONTROL = {"Cc", "Cs", "Zl", "Zp"}  # with surrogates, which cannot be written to a file
_BIDIRECTIONAL = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}
_DEFAULT = re.compile(r"region \d+")


def fault_of(name: object) -> str:
    """Return why *name* is invalid, to follow "a region" or "a handle"; "" if it is valid.

    >>> fault_of("Arm, left"), fault_of("a" * 90)
    ('', "'s name must have at most 80 characters; got 90")
    """
    if not isinstance(name, str) or not name.strip():
        return f"'s name must be printable text; got {shown(name)}"
    if len(name) > LONGEST:
        return f"'s name must have at most {LONGEST} characters; got {len(name)}"
    for letter in name:
        turns = unicodedata.bidirectional(letter) in _BIDIRECTIONAL
        if turns or unicodedata.category(letter) in _CONTROL:
            return f"'s name must be printable text; got {shown(name)}"
    return ""


def region_name(names: Names, region: int) -> str:
    """Return the name of a *region*, also of one that does not exist yet.

    RegionError if *region* is not a whole number, 0 or more.

    >>> region_name(("", "arm"), 0), region_name(("", "arm"), 1)
    ('region 1', 'arm')
    """
    if not is_whole(region, 0):
        raise RegionError(f"region must be a whole number, 0 or more; got {shown(region)}")
    return (names[region] if region < len(names) else "") or f"region {region + 1}"


def volume_label(names: Names, volume: str) -> str:
    """Return what a *volume* of `Deformer.volume_names` is called where one counts from 1.

    >>> volume_label(("", "arm"), "region 1"), volume_label((), "body 0"), volume_label((), "wall")
    ('arm', 'body 1', 'wall')
    """
    kind, _, number = volume.rpartition(" ")
    if kind not in ("body", "cavity", "component", "region") or not number.isdecimal():
        return volume
    return region_name(names, int(number)) if kind == "region" else f"{kind} {int(number) + 1}"


def renamed(names: Names, region: int, name: str) -> Names:
    """Return *names* with *name* for *region*; "" removes its name.

    Raises
    ------
    RegionError
        If *name* is invalid or the name of another region.
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
    """Return *names* after regions were merged into the first, which gets the first of their names.

    >>> merged(("arm", "", "leg"), [1, 2])
    ('arm', 'leg')
    """
    numbers = sorted(set(which))
    kept = next((names[k] for k in numbers if k < len(names) and names[k]), "")
    after = list(names) + [""] * (numbers[0] + 1 - len(names))
    after[numbers[0]] = kept
    return _trimmed([name for k, name in enumerate(after) if k not in numbers[1:]])


def split(names: Names, region: int, count: int) -> Names:
    """Return *names* after one of *count* regions was split; the new region comes last.

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
    if _DEFAULT.fullmatch(second):  # if a region is named "region"
        return names
    return (*names, *[""] * (count - len(names)), second)


def checked_names(names: Sequence[object], count: int) -> Names:
    """Return *names* of *count* regions without redundant ones; RegionError if one is invalid."""
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
        raise RegionError(f"there is already a region {name!r}; choose another name")
    if _DEFAULT.fullmatch(name):
        raise RegionError(
            f"{name!r} is reserved for a region of this number without a name; choose another name"
        )


def _trimmed(names: Sequence[str]) -> Names:
    last = max((k for k, name in enumerate(names) if name), default=-1)
    return tuple(names[: last + 1])
