"""What the cases of a study are: their order, conditions and structures, the modes they keep, their identity.

An outer index is a combination of values that fix the operators (scheme, structure, basis, modes, step), an inner index
one of all other values: together they number a case.
"""

from workflow.cases._arrangement import TOLERANCE, Grid, Indices, arrange, decides_structure, reads
from workflow.cases._choice import OF_REFERENCE, ChosenModes, choices_text, corner_text, read_choices
from workflow.cases._conditions import FRICTION, Perturbation, Start, alpha_of, cases_of, friction_of
from workflow.cases._identity import case_hashes
from workflow.cases._reference import (
    compared_values,
    distinct_solutions,
    exact_settings,
    is_compared,
    needed_settings,
    reference_settings,
    solution_counts,
    tells_basis_error,
)
from workflow.cases._structures import Reduced, full_structure, model_on, reduced, reduced_structure
from workflow.cases._waiting_for import (
    CASES,
    COMPILING,
    GATHERING,
    PLANNING,
    REFERENCES,
    WORKERS,
    expect_structures,
    seconds_compiled,
    waited_for,
    waiting_for,
)
