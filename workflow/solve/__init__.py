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
from workflow.solve._solve import Solved, failed, joined, kernel_variants, solve, solve_in_parts
from workflow.solve._tasks import (
    LONGEST,
    TASK_BYTES,
    Batch,
    Task,
    costs,
    memory_needed,
    model_seconds,
    require_memory,
    seconds_per_case,
    stored_bytes,
    tasks,
)
from workflow.solve._variables import dims_of, lengths, unset, variables_of
