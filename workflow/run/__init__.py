"""Running a study: ``_study`` the whole, ``_prepare`` what comes before its tasks, ``_task`` one task.

``_reuse`` what is stored already, and what of it a run would lose; ``_progress`` how far a run is, ``_notebook`` the
line that shows it in a notebook; ``_outcome`` how a run ended; ``_verify`` runs a sample of an archive again. Tasks run
(``_runner``) on threads (``_threads``) or on a dask cluster (``_cluster``, ``_worker``).
"""

from workflow.run._outcome import MOST_FAILURES, Outcome, status_counts, status_name, summarise, warnings_of
from workflow.run._progress import Advance, Follower, Progress, in_words, repeating
from workflow.run._reuse import Holdings, Reuse, holdings
from workflow.run._study import ReuseOptions, run_study
from workflow.run._task import Job, Stored, compute_batch, store_task
from workflow.run._threads import available_threads
from workflow.run._verify import Check, verify
from workflow.run._worker import ClusterError

__all__ = [
    "MOST_FAILURES",
    "Advance",
    "Check",
    "ClusterError",
    "Follower",
    "Holdings",
    "Job",
    "Outcome",
    "Progress",
    "Reuse",
    "ReuseOptions",
    "Stored",
    "available_threads",
    "compute_batch",
    "holdings",
    "in_words",
    "repeating",
    "run_study",
    "status_counts",
    "status_name",
    "store_task",
    "summarise",
    "verify",
    "warnings_of",
]
