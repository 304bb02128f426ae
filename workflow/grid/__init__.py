"""From a study to batches of cases that share their operators, and to the tasks dask runs."""

from workflow.grid._ahead import kernel_variants
from workflow.grid._arrangement import Grid, arrange, reads
from workflow.grid._choice import Choices, ChosenModes, choices_text, read_choices
from workflow.grid._compile import compiled_ahead
from workflow.grid._conditions import FRICTION
from workflow.grid._encoding import CHUNK_BYTES, COMPRESSED, LEVEL, encode
from workflow.grid._figures import Figures
from workflow.grid._frequencies import longest_period_count
from workflow.grid._identity import case_hashes
from workflow.grid._mesh_cautions import too_thick
from workflow.grid._operators import reduced_structure, structure_of
from workflow.grid._perturbation import Perturbation
from workflow.grid._plan import Plan, plan, plan_study
from workflow.grid._reference import exact_motion, solution_counts
from workflow.grid._reference_solutions import (
    ReferenceBlock,
    References,
    ReferenceSolutions,
    Solutions,
    compute_block,
    solutions_of,
)
from workflow.grid._solve import Solved, metrics_of, solve
from workflow.grid._tasks import Batch, Task, model_seconds, seconds_per_case, tasks
from workflow.grid._template import HARMONIC, WARNINGS, template
from workflow.grid._waiting_for import (
    CASES,
    COMPILING,
    GATHERING,
    WORKERS,
    seconds_compiled,
    waited_for,
    waiting_for,
)
from workflow.grid._warnings import warning_lines
