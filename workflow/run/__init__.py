"""Running a study: ``_study`` the whole, ``_task`` one task, ``_runner`` where tasks run, ``_outcome`` its end.

``_verify`` runs a sample of an archive again.
Tasks run on threads (``_threads``) or on a dask cluster (``_cluster``, ``_worker``).
"""

from workflow.run._outcome import SHOWN, Outcome, status_counts, status_name, summarise
from workflow.run._study import Progress, run_study
from workflow.run._task import Job, Stored, compute_segment, store_task
from workflow.run._threads import available_threads
from workflow.run._verify import Check, verify
from workflow.run._worker import ClusterError

__all__ = [
    "SHOWN",
    "Check",
    "ClusterError",
    "Job",
    "Outcome",
    "Progress",
    "Stored",
    "available_threads",
    "compute_segment",
    "run_study",
    "status_counts",
    "status_name",
    "store_task",
    "summarise",
    "verify",
]
