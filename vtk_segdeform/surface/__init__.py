"""When triangles are a closed surface, what is wrong if not, and how it is mended.

`faults`, `repair` and `cages` are the doors.
"""
