"""VTK's names of the keys of a browser.

A browser names a key by the character it types or by a word (``KeyboardEvent.key``), VTK by the
symbols of X11; keys of the number pad are told apart by ``KeyboardEvent.code``.
"""

from __future__ import annotations

_WORDS = {
    "Escape": "Escape", "Tab": "Tab", "Enter": "Return", "Backspace": "BackSpace",
    "Delete": "Delete", "Insert": "Insert", "Home": "Home", "End": "End", "PageUp": "Prior",
    "PageDown": "Next", "ArrowLeft": "Left", "ArrowRight": "Right", "ArrowUp": "Up",
    "ArrowDown": "Down", "Shift": "Shift_L", "Control": "Control_L", "Alt": "Alt_L",
    "Meta": "Super_L", "CapsLock": "Caps_Lock",
    **{f"F{number}": f"F{number}" for number in range(1, 13)},
}  # fmt: skip
_SIGNS = {
    " ": "space", "!": "exclam", '"': "quotedbl", "#": "numbersign", "$": "dollar",
    "%": "percent", "&": "ampersand", "'": "apostrophe", "(": "parenleft", ")": "parenright",
    "*": "asterisk", "+": "plus", ",": "comma", "-": "minus", ".": "period", "/": "slash",
    ":": "colon", ";": "semicolon", "<": "less", "=": "equal", ">": "greater", "?": "question",
    "@": "at", "[": "bracketleft", "\\": "backslash", "]": "bracketright", "^": "asciicircum",
    "_": "underscore", "`": "grave", "{": "braceleft", "|": "bar", "}": "braceright",
    "~": "asciitilde",
}  # fmt: skip
_PAD = {
    "NumpadAdd": "KP_Add", "NumpadSubtract": "KP_Subtract", "NumpadMultiply": "KP_Multiply",
    "NumpadDivide": "KP_Divide", "NumpadDecimal": "KP_Decimal", "NumpadEnter": "Return",
    **{f"Numpad{digit}": f"KP_{digit}" for digit in range(10)},
}  # fmt: skip
_CODES = {"Escape": 27, "Tab": 9, "Enter": 13, "Backspace": 8, "Delete": 127}


def vtk_key(key: str, place: str = "") -> tuple[str, int] | None:
    """Return VTK's name of a key and the code of its character, 0 if it types none.

    Parameters
    ----------
    key : str
        ``KeyboardEvent.key``.
    place : str
        ``KeyboardEvent.code``.

    Returns
    -------
    name, code : (str, int), or None
        None for keys without a name in VTK, such as those of letters with accents.

    Examples
    --------
    >>> vtk_key("z"), vtk_key("["), vtk_key("ArrowLeft"), vtk_key("1", "Numpad1")
    (('z', 122), ('bracketleft', 91), ('Left', 0), ('KP_1', 49))
    """
    is_character = len(key) == 1 and key.isascii() and key.isprintable()
    code = ord(key) if is_character else _CODES.get(key, 0)
    if place in _PAD:
        return _PAD[place], code
    if is_character and key.isalnum():
        return key, code
    name = _WORDS.get(key, _SIGNS.get(key))
    return None if name is None else (name, code)
