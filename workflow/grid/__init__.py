"""From a study to batches of cases that share their operators, and to the tasks dask runs."""

from workflow.grid._ahead import compiling, is_compiling, lend_turns
from workflow.grid._arrangement import Grid, arrange, fixes_operator, reads
from workflow.grid._identity import case_hashes
from workflow.grid._operators import reduced_structure, structure_of
from workflow.grid._plan import Figures, Plan, plan
from workflow.grid._solve import Solved, longest_period_count, scheme_metrics, solve
from workflow.grid._tasks import Segment, Task, Units, bytes_per_case, seconds_per_case, tasks, units_of
from workflow.grid._turns import Turns

__all__ = [
    "Figures",
    "Grid",
    "Plan",
    "Segment",
    "Solved",
    "Task",
    "Turns",
    "Units",
    "arrange",
    "bytes_per_case",
    "case_hashes",
    "compiling",
    "fixes_operator",
    "is_compiling",
    "lend_turns",
    "longest_period_count",
    "plan",
    "reads",
    "reduced_structure",
    "scheme_metrics",
    "seconds_per_case",
    "solve",
    "structure_of",
    "tasks",
    "units_of",
]
