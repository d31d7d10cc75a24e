"""What the Qt panel beside a view is made of; `widgets.qt` puts it together.

Each part shows one aspect of the editor's desk and does `editing.actions` and `panel_actions`,
nothing of its own.  A part is a QWidget with a `refresh` that is cheap where nothing changed.
"""
