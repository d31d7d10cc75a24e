"""The status and the history."""

from __future__ import annotations

import re

from ..editor import DeformEditor, Keys, Mode, key_cap, states_of
from ..volume_overlay import percent
from .fields import Entry, Field, Status, Word


def status(editor: DeformEditor) -> Status:
    """Return the status of *editor*: the last result or error, the next step, running work."""
    controller, session, busy = editor.controller, editor.session, editor.is_busy
    messages, volume = controller.messages, ""
    words: tuple[Word, ...] = ()
    if busy:
        text = messages.text
    elif messages.error:
        text = messages.error
    else:
        step = controller.hint
        text = "" if messages.last_note in step else messages.last_note
        words = words_of(step, editor.keys, editor.mode)
    if not busy:  # a job owns the session
        change = session.volume_change if session.has_volume else None
        volume = "No volume to preserve" if change is None else percent(change)
    return Status(
        text=text[:1].upper() + text[1:],
        is_error=bool(messages.error) and not busy,
        words=words,
        is_busy=busy,
        work=messages.work,
        progress=messages.fraction,
        volume=volume,
        state=f"{session.mesh.n_vertices:,} vertices",
        cancel=Field(
            "cancel",
            "button",
            "Cancel",
            "Stop at this pose" if controller.widgets.is_settling else "Cancel; nothing is changed",
            "cancel",
            visible=messages.fraction is not None,
            while_busy=True,
        ),
    )


def words_of(hint: str, keys: Keys, mode: Mode) -> tuple[Word, ...]:
    """Return a *hint* in parts: keys that work in *mode* are those with actions.

    >>> from vtk_segdeform.widgets.editor import keys_of
    >>> words_of("Drag a cage vertex · Next: 4, deform", keys_of("pyvista"), Mode.CAGES)[1:]
    (Word(text='4', action='deform'), Word(text=', deform', action=''))
    """
    working = [b for b in keys.bindings if b.name and mode in b.modes and b.keys]
    names = {key_cap(b.keys[0]): b.name for b in working}
    # A key after "Press", "or" or "Next:", or before ":" or "to", as hints name it.
    caps = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    pattern = rf"(?:(?:Press|or|Next:) |\(|· |, |\. )({caps})(?=[ :,)]|\.(?!\d)|$)"
    words, end = [], 0
    for found in re.finditer(pattern, hint):
        start, stop = found.span(1)
        words += [Word(hint[end:start]), Word(hint[start:stop], names[found[1]])]
        end = stop
    return (*words, Word(hint[end:])) if end < len(hint) else tuple(words)


def history(editor: DeformEditor) -> tuple[Entry, ...]:
    """Return the states of the session by name, the oldest first."""
    here = editor.controller.history.position
    return tuple(
        Entry(name, is_current=place == here, is_undone=place > here)
        for place, name in enumerate(states_of(editor.controller))
    )
