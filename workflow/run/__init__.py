"""Running a study: ``_study`` the whole, ``_prepare`` what comes before its tasks, ``_task`` one task.

Tasks are graphs of dask, which run on threads (``_threads``) or on the workers of a cluster (``_cluster``).
``_progress`` says how far a run is, ``_outcome`` how it ended; ``_verify`` runs a sample of an archive again.
"""

from workflow.run._cluster import ClusterError
from workflow.run._outcome import Outcome, status_counts, status_name, warnings_of
from workflow.run._prepare import holdings
from workflow.run._progress import Advance, Follower, Progress, in_words, repeating
from workflow.run._study import run_study
from workflow.run._threads import available_threads
from workflow.run._verify import Check, verify
