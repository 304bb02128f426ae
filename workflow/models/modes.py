"""Structure from a table of modes, as finite element codes print it, without matrices.

With mass-normalised modes x_n = Σ φ_j η_j, θ_n = Σ χ_l τ_l, and equation (1) is

    η_j'' + 2 ζ_j ω_j η_j' + ω_j² η_j + Σ G_jl τ_l = φ_j (f - λ),   τ_l' + μ_l τ_l = χ_l α λ.

Its tip is x_n, θ_n (:mod:`workflow.models._from_matrices`). Modes beyond the table are truncated: x_n lacks their
static response, which a mode of high frequency may replace.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workflow.declare import File, Rows, rows
from workflow.models._from_matrices import COLD, GivenMatrices, structure_from_matrices
from workflow.models._mode_tables import COLUMNS, HEAT_COLUMNS, read_matrix, read_table
from workflow.models._semidefinite import UnusableMatricesError
from workflow.models._structure import Matrices, Rayleigh


@dataclass(frozen=True)
class Parameters:
    """Modes of a structure with its tip free, and optionally its thermal modes."""

    table: File | Rows = rows(
        "CSV file, or rows, with columns frequency [Hz], damping_ratio and tip: the tip's displacement in the mode of "
        "unit modal mass [1/√kg], positive towards the casing",
        COLUMNS,
    )
    heat: File | Rows | None = rows(
        "CSV file, or rows, with columns rate [1/s] and tip: the tip's temperature in the thermal mode of unit modal "
        "heat capacity [1/√(J/K)]",
        HEAT_COLUMNS,
        default=None,
    )
    coupling: File | Rows | None = rows(
        "CSV file, or rows, of φᵀK12χ [N/K/√kg/√(J/K)]: a row for each mode, a column for each thermal mode",
        default=None,
    )


def assemble(parameters: Parameters) -> Matrices:
    """Return the structure of equations (1a) and (1b), its last coordinate the tip.

    Raises
    ------
    UnusableMatricesError
        A table is not one of modes.
    """
    frequency, ratio, tip = read_table(parameters.table, COLUMNS).T
    _check(np.all(frequency >= 0), "frequency", "at least 0")
    _check(np.all(ratio >= 0), "damping_ratio", "at least 0")
    _check(np.any(tip != 0), "tip", "other than 0 in some mode")
    if parameters.heat is None and parameters.coupling is not None:
        raise UnusableMatricesError("`coupling` is given without `heat`", "give both, or neither")
    one = ((0.0, 1 / float(np.sqrt(COLD))),)
    rate, heat_tip = read_table(one if parameters.heat is None else parameters.heat, HEAT_COLUMNS).T
    _check(np.all(rate >= 0), "rate", "at least 0")
    _check(np.any(heat_tip != 0), "tip", "other than 0 in some thermal mode")
    shape = frequency.size, rate.size
    omega = 2 * np.pi * frequency
    even = bool(np.all(ratio[omega > 0] == ratio.max()))
    return structure_from_matrices(
        GivenMatrices(
            mass=np.eye(shape[0]),
            stiffness=np.diag(omega**2),
            coupling=np.zeros(shape) if parameters.coupling is None else read_matrix(parameters.coupling, shape),
            heat_capacity=np.eye(shape[1]),
            conductance=np.diag(rate),
            contact=tip,
            thermal_contact=heat_tip,
            steady=np.zeros(shape[0]),
            heating=np.zeros(shape[1]),
            damping=Rayleigh(ratio=float(ratio.max())) if even else Rayleigh(),
            damper=None if even else np.diag(2 * ratio * omega),
            uniform_rise=heat_tip / float(heat_tip @ heat_tip),
        )
    )


def _check(holds: bool | np.bool_, column: str, what: str) -> None:
    if not holds:
        raise UnusableMatricesError(f"column `{column}` has a value that cannot be", f"write values {what}")
