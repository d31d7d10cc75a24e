"""A Qt application of one's own with the editor in it: a window, a menu, a label for the volume.

python examples/qt_application.py [MESH]          on a screen
python examples/qt_application.py --picture FILE  draws its window once, and ends
"""

import sys

from qtpy import QtCore, QtWidgets

import vtk_segdeform as sd
from vtk_segdeform.widgets.qt.widget import DeformWidget


class Window(QtWidgets.QMainWindow):
    """The application's window; the editor is what it has in the middle."""

    def __init__(self, mesh):
        super().__init__()
        self.editor = DeformWidget(mesh, self)
        self.setCentralWidget(self.editor)
        self.menuBar().addMenu("&File").addAction("&Quit", "Ctrl+Q", self.close)
        self.volume = QtWidgets.QLabel()
        self.statusBar().addPermanentWidget(self.volume)
        self.editor.deformed.connect(self.show_volume)
        self.editor.error.connect(lambda words: self.statusBar().showMessage(words, 5000))

    def show_volume(self):
        """Tell by how much the volume has changed."""
        self.volume.setText(f"volume {self.editor.session.volume_change:+.1e}")

    def closeEvent(self, event):  # noqa: N802 - Qt's word
        """Free what is drawn, while the window is still there."""
        self.editor.close()
        super().closeEvent(event)


application = QtWidgets.QApplication.instance() or QtWidgets.QApplication(sys.argv)
files = [word for word in sys.argv[1:] if not word.startswith("-")]
picture = files[-1] if "--picture" in sys.argv else None
window = Window(sd.read_mesh(files[0]) if files and not picture else sd.models.cactus(1500))
window.resize(1200, 800)
window.show()
if picture is not None:
    QtCore.QTimer.singleShot(1000, lambda: (window.grab().save(picture), window.close()))
application.exec()
