"""Running a study: ``_study`` the whole, ``_prepare`` what comes before its tasks, ``_task`` one task.

``_reuse`` what is stored already, and what of it a run would lose; ``_progress`` how far a run is, ``_notebook`` the
line that shows it in a notebook; ``_outcome`` how a run ended; ``_verify`` runs a sample of an archive again. Tasks
are graphs of dask (``_graph``), which run (``_runner``) on threads (``_threads``) or on a cluster (``_cluster``,
``_worker``).
"""

from workflow.run._outcome import Outcome, status_counts, status_name, warnings_of
from workflow.run._progress import Advance, Follower, Progress, in_words, repeating
from workflow.run._reuse import holdings
from workflow.run._study import run_study
from workflow.run._threads import available_threads
from workflow.run._verify import Check, verify
from workflow.run._worker import ClusterError
