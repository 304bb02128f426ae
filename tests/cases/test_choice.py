"""Counts of modes that a tolerance decides: the fewest that meet it in the hardest case, and what they depend on."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quick import hashes_of
from scenes import relative
from studies import SCENE, parsed
from terminal import told
from workflow import schemes
from workflow.analysis import decided, labels_of, recommend, recommendation_entries, sentence
from workflow.archive import open_archive, provenance
from workflow.cases import ChosenModes, arrange, read_choices
from workflow.cases._choice import corners_of
from workflow.cases._conditions import conditions
from workflow.judges import trials
from workflow.models import Structure, structure_of
from workflow.plan import plan_study
from workflow.reduction import reduce_structure
from workflow.run import holdings, run_study, verify
from workflow.solve import solve
from workflow.study import Study, read_study

AUDIT = Path(__file__).parent / "audit"
AUTO = "mechanical_modes: auto, thermal_modes: auto"


def study(axes: str, more: str = "") -> Study:
    """A chain of four nodes that is run exactly."""
    return parsed(f"study: a\n{SCENE}axes: {{scheme: event_driven, {axes}}}\noutput: {{interval: 1 ms}}\n{more}\n")


def errors_by_count(requested: Study) -> dict[tuple[int, int], float]:
    """Return the larger error of displacement and temperature of every reduced model of a study's first case."""
    grid = arrange(requested)
    cell, exact = grid.settings(0), schemes.load("event_driven")
    full = structure_of(cell.scene.model, cell.scene.parameters)
    cases = conditions(cell, full, grid.inner_values(np.zeros(1, dtype=np.int64)), 1)

    def run(mechanical: int, thermal: int) -> dict[str, np.ndarray]:
        reduction = reduce_structure(full, mechanical, thermal, cell.reduction, cell.scene.duration)
        operator = exact.init(reduction.structure, 0.0, exact.Options())
        return exact.compute(operator, reduction.project(cases), replace(grid.sampling, balances=False)).histories

    size = full.mechanical_size
    truth = run(size - 1, size - 1)
    return {
        (m, t): max(relative(histories[name], truth[name]) for name in ("displacement", "temperature"))
        for m in range(size)
        for t in range(size)
        for histories in [run(m, t)]
    }


@pytest.mark.parametrize(
    ("basis", "scene", "more"),
    [
        ("craig_bampton", "alpha: 20", 0),
        ("krylov", "alpha: 20", 0),
        ("rubin", "alpha: 20, scene.initial.temperature: 20", 2),
        ("weakly_coupled", "alpha: 10, scene.chain.heating: 0.5", 2),
        ("krylov", "alpha: 5, scene.load.frequency: 2200, scene.load.amplitude: 20", 2),
    ],
    ids=["craig_bampton", "krylov", "initially warm", "heated", "near resonance"],
)
def test_the_fewest_vectors_that_meet_the_tolerance_are_taken(basis: str, scene: str, more: int) -> None:
    """Or so many more."""
    requested = study(f"{scene}, e: 0.5, {AUTO}, reduction: {basis}, tolerance: [0.1, 1e-2, 1e-3]")
    errors = errors_by_count(requested)
    for outer, tolerance in enumerate((0.1, 1e-2, 1e-3)):
        choice = arrange(requested).choice(outer)
        assert choice is not None
        counts = choice.mechanical_modes, choice.thermal_modes
        assert sum(counts) <= min(sum(pair) for pair, error in errors.items() if error <= tolerance) + more
        assert choice.error == pytest.approx(errors[counts], rel=1e-2, abs=1e-9)
        assert errors[counts] <= tolerance


def test_a_count_that_is_given_stays_and_may_stand_in_the_way() -> None:
    """Two thermal modes alone err by more than the tolerance: mechanical ones are chosen that add no more than it."""
    requested = study("alpha: 20, mechanical_modes: auto, thermal_modes: 1, tolerance: 1e-3, reduction: craig_bampton")
    [choice] = arrange(requested).choices.values()
    assert choice.thermal_modes == 1
    assert 1e-3 < choice.error < errors_by_count(requested)[3, 1] + 1e-3
    [caution] = [text for text in plan_study(requested).warnings if text.startswith("tolerance")]
    assert "miss it" in caution


def test_corners_take_the_hardest_and_the_mildest_value_of_each_dimension() -> None:
    requested = study(
        "alpha: [0, 5, 2], scene.initial.temperature: [-3, 2], scene.load.frequency: [20, 5000, 4000], "
        f"{AUTO}, tolerance: 0.1",
        "zip: {rub: {scene.casing.gap: [1e-5, 2e-5, 1e-5], scene.load.amplitude: [1, 5, 2]}}",
    )
    grid = arrange(requested)
    cell = requested.cell({**grid.base})
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    corners = [dict(corner) for corner in corners_of(grid.inner, structure)]
    assert len({tuple(corner.items()) for corner in corners}) == 16
    answers = sorted((20.0, 5000.0, 4000.0), key=lambda f: -abs(_receptance(structure, 2 * math.pi * f)))
    hardest = {"alpha": 5, "scene.initial.temperature": -3, "scene.casing.gap": 1e-5, "scene.load.amplitude": 2}
    mildest = {"alpha": 0, "scene.initial.temperature": 2, "scene.casing.gap": 2e-5, "scene.load.amplitude": 5}
    assert corners[0] == hardest | {"scene.load.frequency": answers[0]}
    assert mildest | {"scene.load.frequency": answers[-1]} in corners


def test_of_many_corners_those_are_tried_that_are_nearest_to_all_hard_or_all_mild() -> None:
    axes = "alpha: [0, 1], e: [0, 1], scene.load.mean: [0, 1], scene.load.amplitude: [0, 1], scene.load.frequency: 20"
    grid = arrange(study(f"{axes}, scene.load.steady: [0, 1], {AUTO}, tolerance: 0.1"))
    cell = grid.study.cell({**grid.base})
    corners = map(dict, corners_of(grid.inner, structure_of(cell.scene.model, cell.scene.parameters)))
    sums = [sum(corner.values()) for corner in corners]
    assert sums[:2] == [5, 0]
    assert sorted(sums[2:12]) == [1] * 5 + [4] * 5
    assert len(sums) == 16


def test_counts_hold_in_every_corner_though_the_first_is_not_the_hardest() -> None:
    """Without contact heat and impacts the relative error of the tip differs from that of the hottest, hardest rub."""
    text = f"alpha: [0, 20], e: [0, 0.8], scene.load.amplitude: [10, 100], {AUTO}, tolerance: [1e-2, 1e-3]"
    grid = arrange(study(text, "reference: {mechanical_modes: full, thermal_modes: full}"))
    for outer, tolerance in enumerate((1e-2, 1e-3)):
        values = solve(grid, outer, np.arange(grid.inner_count)).values
        errors = np.fmax(values["displacement_error"], values["temperature_error"])
        assert errors.max() <= tolerance
        assert values["basis_error"] == pytest.approx(errors.max(), rel=1e-6)


def _receptance(structure: object, omega: float) -> complex:
    dynamic = structure.stiffness_matrix - omega**2 * structure.mass + 1j * omega * structure.damping_matrix  # type: ignore[attr-defined]
    unit = np.eye(dynamic.shape[0])[-1]
    return complex(np.linalg.solve(dynamic, unit)[-1])


BASE = f"alpha: [0, 20], {AUTO}, tolerance: 1e-2"


def test_a_case_within_the_corners_leaves_the_others_and_one_beyond_tells_them_apart() -> None:
    was = set(hashes_of(study(BASE)))
    within = set(hashes_of(study(BASE.replace("[0, 20]", "[0, 10, 20]"))))
    beyond = set(hashes_of(study(BASE.replace("[0, 20]", "[0, 20, 50]"))))
    assert was < within
    assert not was & beyond


def test_a_count_that_was_chosen_is_another_case_than_one_that_was_given() -> None:
    """Its archive holds counts and error; with another tolerance that leads to the same it is the same case."""
    [choice] = arrange(study(BASE)).choices.values()
    by_numbers = f"alpha: [0, 20], mechanical_modes: {choice.mechanical_modes}, thermal_modes: {choice.thermal_modes}"
    assert not set(hashes_of(study(by_numbers))) & set(hashes_of(study(BASE)))
    assert hashes_of(study(BASE.replace("1e-2", "1.0001e-2"))) == hashes_of(study(BASE))


def test_a_tolerance_that_decides_nothing_changes_no_case() -> None:
    assert hashes_of(study("alpha: 20, tolerance: 1e-3")) == hashes_of(study("alpha: 20"))
    plan = plan_study(study("alpha: 20, tolerance: [1e-2, 1e-3]"))
    assert plan.unique == 1
    assert any("tolerance changes nothing" in text for text in plan.warnings)


def test_counts_do_not_depend_on_scheme_and_options() -> None:
    grid = arrange(
        study(BASE.replace("alpha", "h: [1e-4, 1e-5], alpha"), "").with_({"axes.scheme": ["moreau", "event_driven"]})
    )
    assert [name for name, _ in grid.dims] == ["scheme", "h", "alpha"]
    assert len(grid.choices) == 1
    assert len({(grid.settings(k).mechanical_modes, grid.settings(k).thermal_modes) for k in range(4)}) == 1


def test_a_hardest_case_that_fails_leaves_all_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(trials._BUDGET, "events", 1)
    requested = study(f"alpha: 20.5, {AUTO}, tolerance: 1e-2")
    [choice] = arrange(requested).choices.values()
    assert math.isnan(choice.error)
    assert (choice.mechanical_modes, choice.thermal_modes) == (3, 3)
    assert any("not confirmed: no corner" in text for text in plan_study(requested).warnings)
    assert np.isnan(solve(arrange(requested), 0, np.arange(1)).values["basis_error"]).all()


@pytest.mark.parametrize(
    ("reference", "meaning"),
    [("", "only a `reference` would tell"), ("reference: {mechanical_modes: full, thermal_modes: full}", "own errors")],
)
def test_corners_that_are_left_out_are_named_with_what_that_means(tmp_path: Path, reference: str, meaning: str) -> None:
    """By `plan`, by the archive and by `show`: a tip that runs away leaves the numbers at the stronger coupling."""
    requested = study(f"alpha: [1, 1e9], {AUTO}, tolerance: 1e-2", reference)
    [choice] = arrange(requested).choices.values()
    assert choice.error <= 1e-2
    assert choice.untried.startswith("without 1 of 2 corners of the scene: alpha = 1e+09 (diverged: the state left")
    [caution] = [text for text in plan_study(requested).warnings if "corners" in text]
    assert choice.untried in caution
    assert meaning in caution
    path = tmp_path / "a.nc"
    assert caution in run_study(requested, path, threads=1).warnings
    assert caution in told("show", path)[1]
    with open_archive(path) as archive:
        assert caution in archive.attrs["warnings"]
    [kept] = read_choices(provenance(path)["choices"]).values()
    assert kept == choice


def test_what_the_exact_scheme_refuses_is_tried_by_implicit_euler(monkeypatch: pytest.MonkeyPatch) -> None:
    def refusing(structure: Structure, h: float, options: object) -> object:
        raise ValueError("not this structure")

    exact = replace(schemes.load("event_driven"), init=refusing)
    load = schemes.load
    monkeypatch.setattr(schemes, "load", lambda name: exact if name == "event_driven" else load(name))
    requested = study(f"alpha: 20.25, h: 1e-4, {AUTO}, tolerance: 1e-2").with_({"axes.scheme": "moreau"})
    [choice] = arrange(requested).choices.values()
    assert choice.error <= 1e-2
    assert choice.against == "confirmed by moreau (theta = 1, h = 0.0001 s) against the full model"


def test_an_archive_holds_counts_and_error_and_can_be_extended(tmp_path: Path) -> None:
    text = BASE.replace("1e-2", "[0.1, 1e-2]")
    reference = "reference: {mechanical_modes: full, thermal_modes: full}"
    path = tmp_path / "a.nc"
    run_study(study(text, reference), path, threads=1)
    choices = list(arrange(study(text)).choices.values())
    with open_archive(path) as archive:
        assert archive.mechanical_modes.item() == -1
        assert archive.mechanical_modes.attrs["flag_values"] == -1
        assert archive.mechanical_modes.attrs["flag_meanings"] == "auto"
        assert archive.thermal_modes_used.isel(alpha=1).values.tolist() == [choice.thermal_modes for choice in choices]
        assert (archive.basis_error <= archive.tolerance).all()
        assert (archive.displacement_error <= archive.tolerance).all()
        assert (archive.temperature_error <= archive.tolerance).all()
        assert [one.mechanical_modes for one in decided(archive)] == [choice.mechanical_modes for choice in choices]
        answer = recommend(archive, 0.05)
        assert "(auto + auto)" in sentence(answer)
        content = recommendation_entries(answer)
        assert content["mechanical_modes"] == "auto"
        assert content["thermal_modes_used"] == choices[1].thermal_modes
        assert labels_of(archive, "tolerance") == ["tolerance 0.1", "tolerance 0.01"]
    assert all(check.holds for check in verify(path, sample=2))
    more = study(text.replace("[0, 20]", "[0, 10, 20]"), reference)
    assert (holdings(more, path).stored, holdings(more, path).missing) == (4, 2)


def test_a_workers_grid_takes_the_counts_that_the_run_decided() -> None:
    requested = study(BASE)
    other = {"0": ChosenModes(2, 3, 0.5, (), "elsewhere")}
    grid = arrange(requested, other)
    assert (grid.settings(0).mechanical_modes, grid.settings(0).thermal_modes) == (2, 3)
    values = solve(grid, 0, np.arange(2)).values
    assert values["mechanical_modes_used"].tolist() == [2.0, 2.0]
    assert values["basis_error"].tolist() == [0.5, 0.5]


def test_more_than_half_of_what_trials_measure_against_is_not_confirmed() -> None:
    """Of 330 coordinates, true errors at a tolerance of 1e-6 with 100 + 100 vectors are 4.61e-5 and 6.66e-5."""
    study = read_study(AUDIT / "auto_of_330_coordinates.yaml")
    grid = arrange(study)
    solved = solve(grid, 0, np.zeros(1, dtype=np.int64))
    assert np.isnan(solved.values["basis_error"]).all()
    assert solved.values["status"].tolist() == [0]
    assert "not confirmed" in solved.messages[0]
    assert any("not confirmed" in text for text in plan_study(study).warnings)


@pytest.mark.parametrize(("name", "where", "error"), [("1", 12, 2.25e-2), ("2", 14, 5.27e-2)])
def test_a_condition_inside_the_corners_that_misses_the_tolerance_has_its_own_error(
    name: str, where: int, error: float
) -> None:
    grid = arrange(read_study(AUDIT / f"auto_inside_an_axis_{name}.yaml"))
    choice = grid.choice(0)
    assert choice is not None
    values = solve(grid, 0, np.arange(grid.inner_count)).values
    expected = np.full(18, choice.error)
    expected[where] = max(values[f"{history}_model_error"][where] for history in ("displacement", "temperature"))
    assert values["basis_error"] == pytest.approx(expected, rel=1e-12)
    assert expected[where] == pytest.approx(error, rel=5e-3)


def test_a_reference_poorer_than_the_case_tells_no_error_of_its_basis() -> None:
    study = read_study(AUDIT / "auto_inside_an_axis_1.yaml")
    reference = study.reference
    assert reference is not None
    poor = replace(study, reference=replace(reference, values={**reference.values, "mechanical_modes": 2}))
    grid = arrange(poor)
    choice = grid.choice(0)
    assert choice is not None
    assert solve(grid, 0, np.arange(18)).values["basis_error"].tolist() == [choice.error] * 18


def test_show_and_plan_count_the_conditions_that_meet_the_tolerance(tmp_path: Path) -> None:
    study, path = AUDIT / "auto_inside_an_axis_1.yaml", tmp_path / "a.nc"
    run_study(read_study(study), path, threads=1)
    with open_archive(path) as archive:
        [one] = decided(archive)
    assert (one.met, one.conditions) == (17, 18)
    for words in (("show", path), ("plan", study, "-o", path)):
        assert "met in 17 of 18 conditions" in " ".join(told(*words)[1].split())
