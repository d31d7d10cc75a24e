"""``python -m vtk_segdeform`` is the command line ``segdeform``."""

from .cli import main

if __name__ == "__main__":
    raise SystemExit(main())
