"""Preload of dask workers in tests: notes what is computed, takes its time, dies where it is told to.

``WATCHED_NOTES`` names the file of notes, one line ``process outer first`` for each batch;
``WATCHED_SLEEP`` seconds are spent on each; a worker that is given the batch ``WATCHED_DEADLY``
(``outer first``) kills itself.
"""

import os
import signal
import time
from typing import Any

import workflow.run._task as running


def _noted(grid: Any, outer: int, inner: Any, **known: Any) -> Any:
    where = f"{outer} {inner[0]}"
    with open(os.environ["WATCHED_NOTES"], "a") as notes:
        notes.write(f"{os.getpid()} {where}\n")
    if where == os.environ.get("WATCHED_DEADLY"):
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(float(os.environ.get("WATCHED_SLEEP", "0")))
    return solve(grid, outer, inner, **known)


if running.solve.__module__ == "workflow.solve._solve":  # dask may load a preload twice
    solve = running.solve
    running.solve = _noted
