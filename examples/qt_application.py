"""A Qt application with the editor in its window, a menu and a label for the volume change.

``python examples/qt_application.py --picture FILE`` saves a picture of the window and exits.
"""

import sys

from qtpy import QtCore, QtWidgets

import vtk_segdeform as sd
from vtk_segdeform.widgets.qt import DeformWidget


class Window(QtWidgets.QMainWindow):
    """The main window, with the editor as its central widget."""

    def __init__(self, mesh):
        super().__init__()
        self.editor = DeformWidget(mesh, self)
        self.setCentralWidget(self.editor)
        self.menuBar().addMenu("&File").addAction("&Quit", "Ctrl+Q", self.close)
        self.volume = QtWidgets.QLabel()
        self.volume.setContentsMargins(0, 4, 8, 0)
        self.menuBar().setCornerWidget(self.volume)
        self.show_volume()
        self.editor.deformed.connect(self.show_volume)  # the widget itself shows hints and errors

    def show_volume(self):
        """Show the volume change beside the menu."""
        self.volume.setText(f"Volume change {self.editor.session.volume_change:+.1e}")

    def closeEvent(self, event):  # noqa: N802 - Qt's name
        """Release VTK's resources before the window is destroyed."""
        self.editor.close()
        super().closeEvent(event)


application = QtWidgets.QApplication.instance() or QtWidgets.QApplication(sys.argv)
files = [word for word in sys.argv[1:] if not word.startswith("-")]
picture = files[-1] if "--picture" in sys.argv else None
window = Window(sd.Surface.read(files[0]) if files and not picture else sd.models.cactus(1500))
window.resize(1200, 800)
window.show()
if picture is not None:
    QtCore.QTimer.singleShot(1000, lambda: (window.grab().save(picture), window.close()))
application.exec()
