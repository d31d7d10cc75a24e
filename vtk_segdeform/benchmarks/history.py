"""History of benchmarks: each recorded run appends its ratios to a file, one JSON object per line.

    {"date": "2026-11-22T15:04:05+00:00", "commit": "0b2583d1c9aa", "version": "0.1.0",
     "processor": "...", "scale": "quick", "ratios": {"what was measured": 0.42}}

A commit ends in ``-dirty`` if there were uncommitted changes, and is null for an installed package.
A ratio is null if it was not measured.  Runs are comparable only on the same processor and at the
same scale.
"""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Iterable, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from ..errors import ArgumentError
from ..files import read_regular, replacing, require_place
from ..version import __version__
from .charts import small_multiples
from .measuring import processor
from .sections import Ratio

_SOURCE = Path(__file__).resolve().parents[2]  # of a checkout
_KEYS = {"date": str, "commit": str | None, "processor": str, "scale": str, "ratios": dict}


def read_history(path: Path) -> list[dict[str, Any]]:
    """Return the runs recorded in a file, in order; none if there is no such file.

    Raises
    ------
    ArgumentError
        If a line is not a recorded run.
    OSError
        If the file cannot be read, or could not be replaced later.
    """
    require_place(path)
    if not path.exists():
        return []
    runs = []
    for number, line in enumerate(read_regular(path).splitlines(), 1):
        if not line.strip():
            continue
        try:
            run = json.loads(line)
        except ValueError:
            run = None
        if not isinstance(run, dict) or not all(
            isinstance(run.get(key), kind) for key, kind in _KEYS.items()
        ):
            raise ArgumentError(
                f"line {number} of {path} is not a run recorded by 'segdeform bench --record'; "
                "delete the line or choose another file"
            )
        runs.append(run)
    return runs


def record(path: Path, scale: str, ratios: Iterable[Ratio]) -> None:
    """Append one run to a file; a file with other content is not changed."""
    run = {
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "commit": commit_of(_SOURCE),
        "version": __version__,
        "processor": processor(),
        "scale": scale,
        "ratios": {r.what: None if math.isnan(r.value) else float(r.value) for r in ratios},
    }
    lines = [json.dumps(each) for each in (*read_history(path), run)]
    with replacing(path) as draft:
        draft.write_text("\n".join([*lines, ""]), encoding="utf-8")


def commit_of(source: Path) -> str | None:
    """Return the commit of a checkout, with "-dirty" if it has changes; None for other folders.

    An installed package may be inside another repository, so a checkout must contain ``setup.cfg``
    and be the root of a repository.
    """
    if not (source / "setup.cfg").is_file() or not (source / ".git").exists():
        return None
    words = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        done = subprocess.run(words, cwd=source, capture_output=True, text=True, check=False)
    except OSError:  # git is not installed
        return None
    return done.stdout.strip() or None


def plot_history(runs: Sequence[dict[str, Any]], path: Path) -> None:
    """Write a PNG file with a panel for each ratio and a line for each processor and scale."""
    names = list(dict.fromkeys(name for run in runs for name in run["ratios"]))
    if not names:
        raise ArgumentError("the history has no runs yet; record one by 'segdeform bench --record'")
    machines = list(dict.fromkeys((run["processor"], run["scale"]) for run in runs))
    panels = {
        name: {
            f"{machine[0]}, {machine[1]}": [
                _value(run, name) if (run["processor"], run["scale"]) == machine else math.nan
                for run in runs
            ]
            for machine in machines
        }
        for name in names
    }
    labels = [run["commit"] or run["date"][:10] for run in runs]
    small_multiples(path, labels, panels)


def _value(run: dict[str, Any], name: str) -> float:
    value = run["ratios"].get(name)
    return float(value) if isinstance(value, int | float) else math.nan
