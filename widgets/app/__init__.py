"""The desktop program: a window around `DeformWidget`, with files, and work that is not lost."""
