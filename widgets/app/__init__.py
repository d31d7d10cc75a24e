"""The desktop program: a window around `DeformWidget`, with files and autosave.

The files, in reading order:

    window        `Window`
    pages         the pages of the window
    start_page    the page shown before a document is open
    documents     the open document, and readers for it
    qt_ticker     the timers of Qt, for a queue
    saving        saving, and the questions asked before
    dialogs       the dialogs
    menus         the menus
    stored_keys   the user's keys
    repairing repair_dialog repair_preview
                  repair and open: a closed copy of the surface as a new document
    recent        recent files
"""

from .window import Window

__all__ = ["Window"]
