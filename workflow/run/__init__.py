"""Running a study: ``_study`` the whole, ``_task`` one task, ``_threads`` where tasks run, ``_outcome`` its end."""

from workflow.run._outcome import SHOWN, Outcome, status_counts, summarise
from workflow.run._study import Progress, run_study
from workflow.run._task import Job, Stored, compute_segment, store_task
from workflow.run._threads import available_threads

__all__ = [
    "SHOWN",
    "Job",
    "Outcome",
    "Progress",
    "Stored",
    "available_threads",
    "compute_segment",
    "run_study",
    "status_counts",
    "store_task",
    "summarise",
]
