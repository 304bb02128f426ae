"""Preload of dask workers in tests: notes what is computed, and takes its time.

``WATCHED_NOTES`` names the file of notes, one line ``process outer first`` for each batch; ``WATCHED_SLEEP`` seconds
are spent on each.
"""

import os
import time
from typing import Any

import workflow.run._task as running


def _noted(grid: Any, outer: int, inner: Any, **known: Any) -> Any:
    with open(os.environ["WATCHED_NOTES"], "a") as notes:
        notes.write(f"{os.getpid()} {outer} {inner[0]}\n")
    time.sleep(float(os.environ.get("WATCHED_SLEEP", "0")))
    return solve(grid, outer, inner, **known)


if running.solve_in_parts.__module__ == "workflow.solve._solve":  # dask may load a preload twice
    solve = running.solve_in_parts
    running.solve_in_parts = _noted
