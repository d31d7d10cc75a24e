"""The command line, ``segdeform``.

The files, in reading order:

    main            options, help and exit codes
    pulling         ``segdeform pull``
    commands        ``segdeform deform``, ``edit``, ``regions`` and ``cages``
    fitting         ``segdeform landmarks``
    checking        ``segdeform check``
    subdividing     ``segdeform subdivide``
    motions         ``segdeform motion``
    batching        ``segdeform batch`` and ``segdeform pose``
    turns           how far a handle has turned in a pose
    outputs         printed lines and written surfaces
    demo            ``segdeform demo``
    bench           ``segdeform bench``
    application     ``segdeform app``
    serving         ``segdeform serve``
    progress_bar    progress bar in the terminal
"""

from .main import main

__all__ = ["main"]
