"""The editor in Qt applications.

The files, in reading order:

    widget      `DeformWidget` and `deform_dock`
    panel       the panel beside the view, which draws `widgets.panel`
    toolbar sections tables status history
                the parts of the panel
    view_menu   menu entries for the camera
    keys_dialog the keys of all actions
    controls    buttons, fields and layouts of the parts
    icons       the icons of the toolbar
"""

from .controls import check_box, shortcut, stopper
from .keys_dialog import menu_keys
from .view_menu import add_entry, add_view_entries, name_keys
from .widget import DeformWidget, close_view, deform_dock

__all__ = [
    "DeformWidget",
    "add_entry",
    "add_view_entries",
    "check_box",
    "close_view",
    "deform_dock",
    "menu_keys",
    "name_keys",
    "shortcut",
    "stopper",
]
