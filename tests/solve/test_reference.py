"""Errors against a reference: what they compare, what is computed how often; one whose basis is refined."""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from matrix_files import as_sparse_npz, matrices_of
from quick import quick
from scenes import chain
from studies import CHAOS, PRESSED, SCENE, parsed, solve_all, written
from workflow import schemes
from workflow.cases import arrange, solution_counts
from workflow.models import Rayleigh, Structure
from workflow.plan import plan_study
from workflow.run import run_study, verify
from workflow.schemes import Status
from workflow.solve import ReferenceBlock, References, Solved, solve, tasks
from workflow.solve import _tasks as cutting
from workflow.solve._solutions import ReferenceSolutions, solution_seconds
from workflow.study import CaseSettings, Study, read_study

REFERRED = (
    "study: a\n"
    + SCENE
    + """
schemes: {midpoint: {method: moreau, theta: 0.5}}
axes: {scheme: [moreau, midpoint], h: [1e-4, 1e-5], alpha: [0, 5, 20], e: [0, 0.5]}
zip: {model: {mechanical_modes: [1, full], thermal_modes: [2, full]}}
reference: {scheme: midpoint, h: 1e-5, mechanical_modes: full, thermal_modes: full}
output: {interval: 1 ms}
"""
)


def counted(method: str, study: Study, path: Path, h: float | None = None) -> list[int]:
    """Run a study and return the cases of each batch of several that a scheme computes, at a step if one is given."""
    scheme = import_module(f"workflow.schemes.{method}")
    compute, batches = scheme.compute, list[int]()

    def counting(operator: Any, cases: schemes.Cases, over: schemes.Sampling) -> schemes.Results:
        if h is None or operator.h == h:
            batches.append(cases.count)
        return compute(operator, cases, over)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scheme, "compute", counting)
        run_study(study, path, threads=1)
    return batches


CHEAP = REFERRED.replace("h: 1e-5, mechanical", "h: 2e-5, e: 0, mechanical")


def test_each_distinct_reference_is_computed_once(tmp_path: Path) -> None:
    """One per alpha, and with the gap opened and closed by 1e-12; of one alpha more its own alone."""
    more = CHEAP.replace("alpha: [0, 5, 20]", "alpha: [0, 5, 20, 30]")
    assert counted("moreau", parsed(CHEAP), tmp_path / "a.nc", 2e-5) == [3, 3, 3]
    assert counted("moreau", parsed(more), tmp_path / "a.nc", 2e-5) == [1, 1, 1]


@pytest.mark.parametrize("scheme", ["event_driven", "moreau, h: 1e-6"])
@pytest.mark.parametrize("threads", [1, 2, 16])
def test_blocks_are_cut_as_tasks_are(threads: int, scheme: str) -> None:
    """All solutions once, in blocks of one cost: eight for each thread, none of a trifle."""
    few = REFERRED.replace("alpha: [0, 5, 20]", "alpha: {lin: [0, 20, 9000]}").replace(
        "interval: 1 ms", "interval: 20 ms"
    )
    grid = arrange(parsed(few[: few.index("zip:")] + f"reference: {{scheme: {scheme}}}\noutput: {{interval: 20 ms}}\n"))
    every, begun = list(tasks(grid, threads=threads)), list[ReferenceBlock]()
    references = References(grid, (batch for task in every for batch in task.batches), begun.append, threads)
    for task in every:
        references.of(task.batches)
    solved: dict[CaseSettings, list[int]] = {}
    for block in begun:
        solved.setdefault(block.settings(grid), []).extend(block.inner.tolist())
    assert sum(map(len, solved.values())) == sum(solution_counts(grid)) == sum(len(set(one)) for one in solved.values())
    each = [block.inner.size * solution_seconds(grid, block.settings(grid), block.is_exact) for block in begun]
    assert min(8 * threads, sum(each) / cutting.SHORTEST) * 0.9 - len(solved) <= len(begun)
    assert len(begun) <= max(8 * threads, sum(each) / cutting.LONGEST) * 1.1 + len(solved)
    assert np.percentile(each, 90) < 2 * np.percentile(each, 10)


def test_the_solution_of_a_case_is_not_that_of_the_next() -> None:
    held = ReferenceSolutions(np.array([1, 4, 7]), {}, np.array([0.1, 0.4, 0.7]), {1: "lost"})
    some = held.of(np.array([7, 4, 7]))
    assert (some.predictability.tolist(), some.failures) == ([0.7, 0.4, 0.7], {1: "lost"})
    for asked in ([0], [3, 4], [7, 8]):
        with pytest.raises(RuntimeError, match=r"only \[1, 4, 7\] have solutions"):
            held.of(np.array(asked))


def test_a_reference_that_raises_harms_no_case() -> None:
    """One load of three moves the free body for ever: that case fails, the others have their errors."""
    free = {"nodes": 3, "mass": 1, "stiffness": [0, 2, 2], "heat_capacity": 1}
    scene = {"chain": free, "casing.gap": 0.1, "load": {}, "initial": "static", "duration": 1}
    axes = {"h": 1e-3, "e": None, "alpha": None, "scene.load.mean": [1, -1, 2]}
    study = quick(axes, scene=scene, reference={"scheme": "event_driven"}, output={"interval": 1e-3})
    (results,) = solve_all(study.text)
    assert results.values["status"].tolist() == [0, 3, 0]
    assert list(results.messages) == [1]
    assert "no equilibrium" in results.messages[1]
    assert np.isnan(results.values["impulse_error"][1])
    assert np.all(results.values["impulse_error"][[0, 2]] < 1e-9)


def test_an_axis_that_only_the_reference_reads_makes_cases_of_its_own() -> None:
    text = "study: a\n" + SCENE + "axes: {scheme: event_driven, h: [1e-3, 1e-5]}\nreference: {scheme: moreau}\n"
    grid = arrange(parsed(text))
    assert grid.sharing.tolist() == [1, 1]
    coarse, fine = (solve(grid, outer, np.arange(1)).values["displacement_error"][0] for outer in (0, 1))
    assert coarse > 3 * fine > 0
    replaced = arrange(parsed(text.replace("moreau}", "moreau, h: 1e-5}")))
    assert replaced.sharing.tolist() == [2, 0]


def test_predictability_of_chaos_at_a_gap_of_zero() -> None:
    """Opening a gap of 0 by 1e-12 of it changed nothing, where the motion is known to about 1e-2."""
    text = CHAOS.replace("FREQUENCY", "700").replace("DURATION", "0.2") + "reference: {scheme: event_driven}\n"
    text += "output: {interval: 1 ms, histories: [], balances: false}\n"
    (solved,) = solve_all(text)
    assert 1e-3 < solved.values["predictability"][0] < 1


def mass_on_a_spring(gap: float, start: str, axes: str = "scheme: event_driven, e: 0") -> Solved:
    """1 kg on 100 N/m from a start, for 1 s."""
    text = f"""
study: a
scene:
  chain: {{nodes: 1, mass: 1, stiffness: 100, heat_capacity: 1}}
  casing: {{gap: {gap!r}}}
  initial: {{{start}}}
  duration: 1
schemes: {{midpoint: {{method: moreau, theta: 0.5}}}}
axes: {{{axes}}}
reference: {{scheme: event_driven}}
output: {{interval: 50 ms}}
"""
    return solve_all(text)[0]


def test_predictability_looks_to_both_sides() -> None:
    """The tip stops 5e-14 of the gap short of its casing: only closing the gap makes it touch."""
    results = mass_on_a_spring(0.1 * (1 + 2e-13), "velocity: 1.0")
    assert results.values["impacts"][0] == 0
    assert results.values["predictability"][0] > 1e-8
    assert mass_on_a_spring(0.2, "velocity: 1.0").values["predictability"][0] < 1e-15


def test_a_start_on_the_casing_is_only_opened() -> None:
    results = mass_on_a_spring(0.1, "displacement: 0.1, velocity: -1", "scheme: event_driven, e: 0.5")
    assert results.values["status"][0] == Status.OK
    assert 0 < results.values["predictability"][0] < 1e-9


def test_an_error_against_nothing_is_missing_with_a_message() -> None:
    """A coarse step touches a casing that the exact tip never reaches."""
    start = "displacement: 0.09553, velocity: 0.29552"
    results = mass_on_a_spring(0.1001, start, "scheme: midpoint, h: 5e-2, e: 0.9")
    assert results.values["contact_impulse"][0] > 0
    assert results.values["status"][0] == Status.OK
    assert np.isfinite(results.values["displacement_error"][0])
    assert np.isnan(results.values["impulse_error"][0])
    assert results.values["temperature_error"][0] == 0  # both are identically zero
    assert results.messages == {0: "reference: its impulse is identically zero, that of the case is not"}


def test_cases_that_lack_a_failed_reference_have_a_message() -> None:
    """With e = 0.99999 and 1 a pressed, damped tip exceeds the budget; the case itself keeps status and results."""
    axes = "axes: {scheme: [moreau, exact], h: 0.1, e: [0, 0.99999, 1]}\n"
    output = "output: {interval: 0.1 s, histories: [], balances: false}\n"
    first, second = solve_all(f"study: a{PRESSED}{axes}{output}")
    assert first.values["status"].tolist() == [0, 0, 0]
    assert np.isfinite(first.values["contact_impulse"]).all()
    assert np.isnan(first.values["impulse_error"]).tolist() == [False, True, True]
    assert list(first.messages) == [1, 2]
    for text in first.messages.values():
        assert text.startswith("reference: stopped at t = ")
        assert "the scheme's option `events`" in text
    assert "with e = 0.99999 the speed" in first.messages[1]
    assert "does not help" in first.messages[2]
    assert second.values["status"].tolist() == [0, 3, 3]
    assert not any(text.startswith("reference:") for text in second.messages.values())


def test_errors_split_into_those_of_scheme_and_model() -> None:
    """The whole and both parts against solutions run by hand, and none of them where it must be none."""
    text = REFERRED.replace(
        "reference: {scheme: midpoint, h: 1e-5, mechanical_modes: full, thermal_modes: full}",
        "reference: {scheme: event_driven, mechanical_modes: full, thermal_modes: full}",
    ).replace("[moreau, midpoint]", "[moreau, event_driven]")
    grid = arrange(parsed(text))
    by_outer = {outer: solve(grid, outer, np.arange(grid.inner_count)).values for outer in grid.computed.tolist()}
    cells = {outer: grid.settings(outer) for outer in by_outer}
    exact = {c.mechanical_modes: by_outer[o] for o, c in cells.items() if c.scheme.method == "event_driven"}
    for outer, values in by_outer.items():
        reduced = exact[cells[outer].mechanical_modes]
        for name in ("displacement", "temperature", "impulse"):
            size = np.linalg.norm(exact[3][name], axis=1)
            size[size == 0] = 1  # then the case's own is zero too
            scheme = np.linalg.norm(values[name] - reduced[name], axis=1) / size
            model = np.linalg.norm(reduced[name] - exact[3][name], axis=1) / size
            whole = np.linalg.norm(values[name] - exact[3][name], axis=1) / size
            assert np.allclose(values[f"{name}_error"], whole, rtol=1e-9)
            assert np.allclose(values[f"{name}_scheme_error"], scheme, rtol=1e-9)
            assert np.allclose(values[f"{name}_model_error"], model, rtol=1e-9)
    full = [values for outer, values in by_outer.items() if cells[outer].mechanical_modes == 3]
    assert all(np.all(values["displacement_model_error"] == 0) for values in full)
    assert all(np.array_equal(values["impulse_scheme_error"], values["impulse_error"]) for values in full)
    assert np.all(exact[1]["displacement_scheme_error"] == 0)
    assert np.all(exact[1]["displacement_model_error"] > 0)


def test_each_distinct_exact_solution_is_computed_once(tmp_path: Path) -> None:
    """3 alpha and 2 e, for each of two reduced models; the reference is of another scheme."""
    grid = arrange(parsed(REFERRED))
    assert solution_counts(grid) == (6, 12)
    batches = counted("event_driven", grid.study, tmp_path / "a.nc")
    assert [count for count in batches if count > 1] == [6, 6]


NODES = 310
"""Coordinates of a sparse structure that can also be solved in full, by LAPACK."""


def powers_of_two(nodes: int) -> Structure:
    """Return a chain whose matrices hold sums of powers of two: no entry of its file is rounded.

    With other entries, rounding them moves the answers by eps times the condition of K1 and K2, 3e-11 here, and a
    basis that is right to 1e-12 cannot be told from one that is not.
    """
    return chain(
        nodes=nodes,
        mass=2.0**-14,
        stiffness=2.0**28,
        spacing=2.0**-13,
        expansion=2.0**-17,
        heat_capacity=2.0**-7,
        conductance=2.0**3,
        convection=2.0**-9,
        damping=Rayleigh(10.0, 2e-7),
    )


REFINED = """
study: refined
scene:
  matrices: {{file: sparse.npz, contact: {tip}, thermal_contact: {tip}, damping: {{mass: 10, stiffness: 2.0e-7}}}}
  casing: {{gap: 20 um}}
  load: {{amplitude: 24, frequency: 20 Hz}}
  duration: 0.05 s
axes: {{scheme: event_driven, reduction: [{bases}], alpha: [0, 30]}}
reference:
  {{scheme: event_driven, reduction: krylov, mechanical_modes: auto, thermal_modes: auto, tolerance: {tolerance}}}
output: {{interval: 0.5 ms, histories: []}}
"""


def study_of(directory: Path, tolerance: float, bases: str = "krylov") -> Path:
    as_sparse_npz(matrices_of(powers_of_two(NODES)), directory)
    return written(REFINED.format(tip=NODES - 1, tolerance=tolerance, bases=bases), directory)


@pytest.mark.slow  # events of 309 + 309 modes, and growth rates
@pytest.mark.parametrize("tolerance", [1e-5, 1e-8, 1e-10])
def test_the_error_of_a_reference_is_that_against_the_full_solution(tolerance: float, tmp_path: Path) -> None:
    """Cases are solved in full: what they seem to err is the error of the reference."""
    study = read_study(study_of(tmp_path, tolerance))
    dataset = run_study(study, tmp_path / "a.nc").dataset.load()
    stated = float(dataset["reference_basis_error"].max())
    assert float(dataset["reference_basis_error"].min()) == stated
    true = max(float(dataset[name].max()) for name in ("displacement_error", "temperature_error"))
    assert 0 < true <= stated * 1.2
    assert stated <= tolerance
    [choice] = arrange(study).choices.values()
    assert choice.mechanical_modes < NODES - 1
    structure = f"{NODES} + {NODES} coordinates"
    assert f"reference, tolerance {tolerance:g}, krylov, {structure}" in plan_study(study).choices[0]
    assert {check.name for check in verify(tmp_path / "a.nc", 0) if check.holds} >= {"cases", "choices"}


def test_one_choice_serves_all_bases_of_the_cases(tmp_path: Path) -> None:
    grid = arrange(read_study(study_of(tmp_path, 1e-2, "krylov, rubin")))
    assert len(grid.choices) == 1
    assert len({grid.reference_choice(outer) for outer in range(grid.outer_count)}) == 1


def test_a_small_structure_is_compared_with_the_full_one() -> None:
    reference = "{scheme: event_driven, mechanical_modes: auto, thermal_modes: auto, tolerance: 0.1}"
    text = f"study: a\n{SCENE}axes: {{scheme: event_driven, alpha: [0, 20]}}\nreference: {reference}\n"
    [choice] = arrange(parsed(text)).choices.values()
    assert "the full model" in choice.against
    assert 0 < choice.error <= 0.1
