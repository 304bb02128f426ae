"""From a study to batches of cases that share their operators, and to the tasks dask runs.

An outer index is a combination of values that fix the operators (scheme, structure, basis, modes, step), an inner index
one of all other values: together they number a case.

What a study's cases are: ``_choice`` of modes, ``_arrangement``, ``_conditions``, ``_frequencies``, ``_identity``. What
solves a batch of them: ``_compile``, ``_operators``, ``_tasks``, ``_reference``, ``_solve``. What is said before they
run, and what holds their results: ``_warnings``, ``_plan``, ``_template``.
"""

from workflow.grid._arrangement import Grid, arrange, reads
from workflow.grid._choice import Choices, ChosenModes, choices_text, read_choices
from workflow.grid._compile import compiled_ahead
from workflow.grid._conditions import FRICTION, Perturbation
from workflow.grid._frequencies import longest_period_count
from workflow.grid._identity import case_hashes
from workflow.grid._operators import Figures, reduced_structure, structure_of
from workflow.grid._plan import Plan, plan, plan_study
from workflow.grid._reference import (
    ReferenceBlock,
    References,
    ReferenceSolutions,
    Solutions,
    compute_block,
    exact_motion,
    solution_counts,
    solutions_of,
)
from workflow.grid._solve import Solved, kernel_variants, metrics_of, solve
from workflow.grid._tasks import Batch, Task, model_seconds, seconds_per_case, tasks
from workflow.grid._template import CHUNK_BYTES, COMPRESSED, HARMONIC, LEVEL, WARNINGS, encode, template
from workflow.grid._waiting_for import (
    CASES,
    COMPILING,
    GATHERING,
    WORKERS,
    seconds_compiled,
    waited_for,
    waiting_for,
)
from workflow.grid._warnings import too_thick, warning_lines
