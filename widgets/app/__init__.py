"""The desktop program: a window around `DeformWidget`, with files and autosave.

The files, in reading order:

    window        `Window`
    pages         what fills the window
    start_page    the page shown before a mesh is open
    documents     what can be open, and opening it
    opening       reading a document in another thread
    saving        saving, and the questions asked before
    asking        dialogs
    menus         the menus
    drops         files dropped on the window
    recent        recent files
    keeper        autosave
    autosave      autosaved files, and recovery after a crash
"""

from .window import Window

__all__ = ["Window"]
