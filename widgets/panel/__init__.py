"""The panel of the editor without a toolkit: what it shows, and what its controls do.

    sections(editor)                  the boxes of the present mode, with fields and tables
    menu(editor)                      the menu of the right button
    toolbar(editor)                   the buttons that are the same in every mode
    status(editor)                    the message, the next step, progress
    history(editor)                   the states by name
    press(editor, name, value)        use a control: one entry for every skin
    file_field(editor, name)          one that asks for a file
    use_file(editor, name, path)      use it

Qt and the web page draw these models and call `press`; nothing of a control is written twice.

The files, in reading order:

    fields      what fields, tables and sections are
    panel       `sections` and `press`
    pulling handles motion poses landmarks carried options volumes regions painting
                the sections
    toolbar     the toolbar and the menu about the view
    menu        the menu of the right button
    thumbnails  small pictures of saved poses
    status      the status and the history
"""

from .fields import (
    Cell,
    Column,
    Entry,
    Field,
    Item,
    Row,
    Section,
    Status,
    Table,
    Value,
    Word,
    tooltip,
)
from .menu import menu
from .panel import all_sections, file_field, press, sections, use_file
from .status import history, status
from .toolbar import toolbar, view_entries

__all__ = [
    "Cell",
    "Column",
    "Entry",
    "Field",
    "Item",
    "Row",
    "Section",
    "Status",
    "Table",
    "Value",
    "Word",
    "all_sections",
    "file_field",
    "history",
    "menu",
    "press",
    "sections",
    "status",
    "toolbar",
    "tooltip",
    "use_file",
    "view_entries",
]
