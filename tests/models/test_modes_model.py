"""Tables of modes: the structure they were taken from, as far as its tip feels it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenes import heavy_chain
from studies import written
from workflow.models import (
    Array,
    Rayleigh,
    Structure,
    UnusableMatricesError,
    critical_alpha,
    load,
    mechanical_modes,
    modal_coupling,
    thermal_modes,
)
from workflow.study import StudyError, read_study

CHAIN = heavy_chain(nodes=6)


def tables(structure: Structure) -> tuple[Array, Array, Array]:
    """Modes, thermal modes and coupling of a structure as rows of numbers."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    damping = structure.damping.of_modes(mechanical.values)
    ratio = np.divide(damping, 2 * mechanical.values, out=np.zeros_like(damping), where=mechanical.values > 0)
    table = np.column_stack([mechanical.values / (2 * np.pi), ratio, mechanical.tip])
    return table, np.column_stack([thermal.values, thermal.tip]), modal_coupling(structure, mechanical, thermal)


def as_rows(table: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, row)) for row in table)


def of_tables(*tables: Array) -> Structure:
    model = load("modes")
    return model.assemble(model.Parameters(*(as_rows(table) for table in tables)))


def test_a_rigid_mode_is_one() -> None:
    free = heavy_chain(nodes=4, stiffness=(0.0, 2e7, 2e7, 2e7))
    modal = of_tables(tables(free)[0])
    assert mechanical_modes(modal).values[0] == 0.0
    assert critical_alpha(modal) == np.inf


STUDY = """
study: table
scene:
  modes: {modes}
  casing: {{gap: 5.0e-5}}
  load: {{amplitude: 100, frequency: 20}}
  duration: 0.01
"""


def test_tables_stand_in_a_study_or_in_files(tmp_path: Path) -> None:
    table, heat, coupling = tables(CHAIN)
    order = [2, 0, 1]  # columns of a file come in any order
    names = np.array(["frequency", "damping_ratio", "tip"])[order]
    np.savetxt(tmp_path / "modes.csv", table[:, order], delimiter=",", header=",".join(names), comments="", fmt="%.17g")
    np.savetxt(tmp_path / "heat.csv", heat, delimiter=",", header="rate,tip", comments="", fmt="%.17g")
    np.savetxt(tmp_path / "coupling.csv", coupling, delimiter=",", fmt="%.17g")
    rows = [f"{{frequency: {f!r} Hz, damping_ratio: {z!r}, tip: {t!r}}}" for f, z, t in as_rows(table)]
    inline = f"{{table: [{', '.join(rows)}], heat: {[list(row) for row in as_rows(heat)]}, "
    inline += f"coupling: {[list(row) for row in as_rows(coupling)]}}}"
    files = "{table: modes.csv, heat: heat.csv, coupling: coupling.csv}"
    model, structures = load("modes"), []
    for text in (files, inline):
        study = read_study(written(STUDY.format(modes=text), tmp_path))
        structures.append(model.assemble(study.scene.parameters))
    assert np.array_equal(structures[0].stiffness_matrix, structures[1].stiffness_matrix)
    assert np.array_equal(structures[0].coupling_matrix, structures[1].coupling_matrix)


def test_a_head_may_have_units(tmp_path: Path) -> None:
    (tmp_path / "modes.csv").write_text("frequency [Hz], damping_ratio, tip [1/√kg]\n1200,0.005,14.1\n")
    (tmp_path / "heat.csv").write_text("rate [1/s],tip [1/√(J/K)]\n0.5,2\n")
    study = read_study(written(STUDY.format(modes="{table: modes.csv, heat: heat.csv}"), tmp_path))
    structure = load("modes").assemble(study.scene.parameters)
    assert structure.mass.tolist() == [[pytest.approx(1 / 14.1**2)]]
    assert structure.heat_capacity.tolist() == [[pytest.approx(1 / 2**2)]]


@pytest.mark.parametrize(
    ("modes", "problem"),
    [
        ("{table: [[1000, 0.01, 0]]}", "`tip` has an impossible value"),
        ("{table: [[-1, 0.01, 1]]}", "`frequency` has an impossible value"),
        ("{table: [[1000, 0.01]]}", "is no row of the table"),
        ("{table: [{frequency: 1, damping_ration: 0, tip: 1}]}", "ration: `damping_ration` is not known here; did you"),
        ("{table: [{frequency: 1000, damping_ratio: 0.01}]}", "is no row of the table"),
        ("{table: [[1000, 0.01, one]]}", "`one` is not"),
        ("{table: []}", "has 0 rows"),
        ("{table: none.csv}", "`none.csv` is no file; name a file, relative to /"),
        ("{table: [[1000, 0.01, 1]], coupling: [[1]]}", "without `heat`"),
        ("{table: [[1000, 0.01, 1]], heat: [[1, 1]], coupling: [[1, 2]]}", "1 rows of 2"),
        ("{table: bad.csv}", "has the columns"),
        ("{table: worse.csv}", "`worse.csv`, line 2: `1,2,x` is not 3 numbers with commas between"),
        ("{table: kilo.csv}", "`kilo.csv` has `frequency` in kHz; write `frequency [Hz]`"),
    ],
)
def test_what_is_no_table_is_refused(modes: str, problem: str, tmp_path: Path) -> None:
    (tmp_path / "kilo.csv").write_text("frequency [kHz],tip,damping_ratio\n1,2,0.01\n")
    (tmp_path / "bad.csv").write_text("frequency,tip\n1,2\n")
    (tmp_path / "worse.csv").write_text("frequency,tip,damping_ratio\n1,2,x\n")
    with pytest.raises(StudyError) as raised:
        read_study(written(STUDY.format(modes=modes), tmp_path))
    assert problem in str(raised.value)


def test_reduced_it_keeps_its_ratios() -> None:
    table, heat, coupling = tables(CHAIN)
    table[:, 1] = 0.01
    structure: Any = of_tables(table, heat, coupling)
    assert structure.damping == Rayleigh(ratio=0.01)
    table[0, 1] = 0.02
    assert of_tables(table, heat, coupling).damper is not None
    with pytest.raises(UnusableMatricesError, match="rows of 2 numbers: write rows of 3"):
        of_tables(table[:, :2])
