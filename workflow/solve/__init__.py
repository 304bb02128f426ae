"""What solves cases: tasks of about the same length, kernels compiled before them, batches through their schemes.

The solutions that errors are measured against are computed beside them, in blocks that serve many cases.
"""

from workflow.solve._compile import compiled_ahead
from workflow.solve._operators import observed_structure, projection_residual_of
from workflow.solve._solutions import (
    ReferenceBlock,
    References,
    ReferenceSolutions,
    Solutions,
    compute_block,
    exact_motion,
    solution_seconds,
    solutions_of,
)
from workflow.solve._solve import NOT_ASKED, Solved, kernel_variants, metrics_of, periods_of, solve, steady_of
from workflow.solve._tasks import Batch, Task, asked_bytes, model_seconds, seconds_per_case, steady_bytes, tasks
