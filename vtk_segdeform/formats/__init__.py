"""Mesh files whose digits, polygons or seams VTK would lose; `convert` is the door."""
