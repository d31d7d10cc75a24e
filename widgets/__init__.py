"""Interactive pieces over a plain VTK renderer; imported as ``vtk_segdeform.widgets``.

Widgets turn events into our words and ask a session; they never compute.
"""
