"""The user's keys, in the settings of the program."""

from __future__ import annotations

import json
from typing import Any

from ..editor import Keys, keys_of

_SETTING = "keys"


def read_keys(settings: Any) -> tuple[Keys, str]:
    """Return the stored keys, and why the default ones are used instead, or ""."""
    stored = settings.value(_SETTING) or "{}"
    try:
        return keys_of(json.loads(stored)), ""
    except (ValueError, TypeError) as fault:  # an ArgumentError is a ValueError
        return keys_of("pyvista"), f"Default keys are used; the stored ones are invalid: {fault}"


def write_keys(settings: Any, keys: Keys) -> None:
    """Store the keys."""
    settings.setValue(_SETTING, json.dumps(keys.changes))
    settings.sync()
