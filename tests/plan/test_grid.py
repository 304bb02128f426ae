"""Order of dimensions, cases that are one case, tasks that cover every unit once and cost what the model says."""

import json
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_limits

from matrix_files import as_npz, matrices_of
from scenes import blade
from studies import HEAVY_SCENE, ILL, SCENE, SINGLE, SMALL, parsed, written
from terminal import told
from workflow import schemes
from workflow.cases import Grid, arrange, reads
from workflow.cli._studies import _lines as plan_lines
from workflow.models._sparse_pair import SparsePair
from workflow.plan import plan, plan_study, template
from workflow.plan._plan import order_of_time
from workflow.reduction import reduce_structure
from workflow.schemes import Status, names
from workflow.solve import _operators, model_seconds, solve, tasks
from workflow.solve import _tasks as cutting
from workflow.solve._variables import metrics_of


def grid_of(rest: str, scene: str = SCENE) -> Grid:
    return arrange(parsed(f"study: a\n{scene}{rest}\n"))


def test_operators_lie_outermost_and_what_is_varied_finely_innermost() -> None:
    grid = arrange(parsed(SMALL))
    assert grid.dims == (("model", 2), ("h", 2), ("e", 3), ("alpha", 5))
    assert (grid.outer_count, grid.inner_count) == (4, 15)
    cell = grid.settings(3)
    assert (cell.h, cell.mechanical_modes, cell.thermal_modes) == (2e-4, 3, 3)
    values = grid.inner_values(np.array([0, 7]))
    assert values["e"].tolist() == [0.0, 0.5]
    assert values["alpha"].tolist() == [0.0, 10.0]


AXES = {
    "h": [1e-4, 2e-4, 5e-5], "scheme": ["moreau", "carpenter"], "scene.chain.mass": [1e-3, 2e-3, 3e-3, 4e-3],
    "scene.chain.stiffness": [4e6, 5e6], "alpha": [0, 5, 20], "e": [0, 0.5, 0.9],
    "scene.casing.gap": [1e-5, 2e-5, 3e-5], "scene.load.frequency": [50, 60, 70], "scene.load.mean": [0, 1, 2],
}  # fmt: skip


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_the_order_of_dimensions_depends_on_what_varies_alone(data: st.DataObject) -> None:
    """Neither on the number of values, nor on where an axis is written."""
    chosen = data.draw(st.permutations(sorted(AXES)))[: data.draw(st.integers(1, 5))]
    axes = {name: AXES[name][: data.draw(st.integers(1, len(AXES[name])))] for name in chosen}
    names = [name for name, _ in grid_of(f"axes: {json.dumps(axes)}").dims]
    ranked = ["scheme", "mass", "stiffness", "h", "mean", "e", "gap", "alpha", "frequency"]
    assert names == [name for name in ranked if name in names]


def test_a_zip_of_step_and_condition_is_outer() -> None:
    grid = grid_of("axes: {alpha: [0, 1]}\nzip: {pair: {h: [1e-4, 1e-3], e: [0, 0.5]}}")
    assert grid.dims == (("pair", 2), ("alpha", 2))
    assert grid.settings(1).e == 0.5


@pytest.mark.parametrize("text", [SMALL, ILL, SINGLE], ids=["small", "ill", "single"])
@pytest.mark.parametrize("longest", [1e-9, 5.0])
def test_tasks_cover_every_case_once(text: str, longest: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """And of those that are missing no other one."""
    monkeypatch.setattr(cutting, "UNBROKEN", 0.0)
    monkeypatch.setattr(cutting, "LONGEST", longest)
    grid = arrange(parsed(text))
    for missing in (None, np.random.default_rng(0).random((grid.outer_count, grid.inner_count)) < 0.5):
        seen = np.zeros((grid.outer_count, grid.inner_count), dtype=int)
        for task in tasks(grid, missing):
            for batch in task.batches:
                seen[batch.outer, batch.inner] += 1
        assert np.all(seen == (1 if missing is None else missing))


@pytest.mark.parametrize("h", ["1e-5", "1e-6", "[1e-5, 3e-6, 1e-6]"])
@pytest.mark.parametrize("missing", [1.0, 0.3])
@pytest.mark.parametrize("threads", [1, 2, 16])
def test_threads_end_together(threads: int, missing: float, h: str) -> None:
    """Tasks are enough for each thread, and cost the same, whether all of a study is missing or some of it."""
    text = SMALL.replace("h: [1e-4, 2e-4]", f"h: {h}").replace("[0, 5, 10, 20, 50]", "{lin: [0, 50, 4000]}")
    grid = arrange(parsed(text.replace("interval: 1 ms", "interval: 20 ms")))
    mask = np.random.default_rng(0).random((grid.outer_count, grid.inner_count)) < missing
    seconds = [task.seconds for task in tasks(grid, mask, threads)]
    assert max(seconds) < 2 * min(seconds)
    assert max(seconds) < 1.5 * cutting.LONGEST
    assert len(seconds) >= 0.9 * min(8 * threads, sum(seconds) / cutting.SHORTEST)
    assert sum(seconds) == pytest.approx(cutting.model_seconds(grid, mask))


@pytest.mark.parametrize("unbroken", [0.0, 0.01, 1.0])
def test_cases_that_take_long_are_not_kept_together(unbroken: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A task that is lost is lost as a whole: none is longer than that, than others, or than a case."""
    for name, value in (("LONGEST", 1e-3), ("UNBROKEN", unbroken)):
        monkeypatch.setattr(cutting, name, value)
    text = SMALL.replace("h: [1e-4, 2e-4]", "h: [1e-8, 1e-4]").replace("[0, 5, 10, 20, 50]", "{lin: [0, 50, 100]}")
    grid = arrange(parsed(text))
    case = max(cutting.seconds_per_case(grid, outer) for outer in grid.computed.tolist())
    assert 16 * case > 1e-3
    for task in tasks(grid):
        assert task.seconds < 1.5 * max(1e-3, unbroken, 8 * case) + cutting.costs(grid).setup.max()


def test_processor_time_has_the_width_of_its_batch_beside_it() -> None:
    """Cases are timed by the batch: of three values of alpha and two of e six ran together, of carpenter's three."""
    grid = grid_of("axes: {scheme: [moreau, carpenter], h: 1e-5, alpha: [1, 2, 3], e: [0, 0.5]}")
    for outer, width in ((0, 6), (1, 3)):
        values = solve(grid, outer, np.arange(6)).values
        assert np.all(values["batch_width"] == width)
        assert np.unique(values["processor_time"]).size == 1
    assert np.all(solve(grid, 0, np.arange(2)).values["batch_width"] == 2)


def test_waiting_is_no_processor_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work of one thread counts, not what others do meanwhile: a scheme sleeps 0.3 s."""
    grid = grid_of("axes: {h: 1e-4, alpha: [1, 2]}")
    moreau = import_module("workflow.schemes.moreau")
    compute = moreau.compute

    def sleepy(*given: Any) -> Any:
        time.sleep(0.3)
        return compute(*given)

    monkeypatch.setattr(moreau, "compute", sleepy)
    seconds = solve(grid, 0, np.arange(2)).values["processor_time"]
    assert 0 < seconds.sum() < 0.15


def test_plan_says_what_it_comes_to() -> None:
    """Issue figures: implicit Euler at 1.09 kHz and 1e-4 s damps by 0.32 against 0.0014."""
    schemes = "schemes: {early: {method: moreau, theta: 0.45}}\n"
    axes = "axes: {scheme: [moreau, early], h: [1e-4, 1e-3], e: [0, 0.5]}\n"
    grid = grid_of(f"{schemes}{axes}output: {{interval: 1 ms}}", HEAVY_SCENE)
    planned = plan(grid)
    assert (planned.cases, planned.unique, planned.batches) == (8, 8, 4)
    assert planned.steps == 2 * 2 * (3000 + 300)
    figures = planned.structures[0]
    assert figures.first_frequency == pytest.approx(1090.5, abs=0.1)
    assert figures.tip_stiffness == pytest.approx(1e6, rel=1e-9)
    assert figures.critical_alpha == pytest.approx(1.071, abs=5e-4)
    assert 0 < figures.fastest < figures.slowest
    warnings = "\n".join(planned.warnings)
    assert "moreau damps the first mode (1090 Hz) numerically; its own damping ratio is 0.0014" in warnings
    assert "0.3 at h = 0.0001 s, 0.8 at h = 0.001 s" in warnings
    assert "early diverges, its free step grows" in warnings
    assert planned.bytes > 8 * 301 * 3 * 8


@pytest.mark.parametrize("given", ["tip_stiffness: 2.1e8", "youngs_modulus: 210 GPa"])
def test_a_plan_says_by_which_parameter_a_blade_is_how_stiff(given: str) -> None:
    """A rod has K = EA/L, f1² = K/(16 m) and, without convection, α_c = 2 λA/(K a L²)."""
    blade = "length: 40 mm, width: 40 mm, thickness: 1 mm, density: 7800, specific_heat: 460, conductivity: 45"
    scene = f"{{blade: {{nodes: 100, {blade}, expansion: 1.2e-5, {given}}}, casing: {{gap: 1 um}}, duration: 1 ms}}"
    planned = plan_study(f"study: stiff\nscene: {scene}\n")
    [figures] = planned.structures
    stiffness, mass, area = 2.1e8, 7800 * 0.04 * 40e-6, 40e-6
    assert figures.tip_stiffness == pytest.approx(stiffness, rel=1e-9)
    assert figures.first_frequency == pytest.approx((stiffness / (16 * mass)) ** 0.5, rel=1e-4)
    assert figures.critical_alpha == pytest.approx(2 * 45 * area / (stiffness * 1.2e-5 * 0.04**2), rel=1e-9)
    [line] = [line for line in plan_lines(planned) if "f1" in line]
    assert f"tip stiffness 2.1e+08 N/m by {given.partition(':')[0]}, " in line
    assert f"critical alpha {figures.critical_alpha:.4g} W/N" in line


def test_a_plan_names_every_operator_and_the_basis_a_caution_is_of() -> None:
    axes = "axes: {scheme: [moreau, event_driven, carpenter], mechanical_modes: [1, 2, 3], thermal_modes: 2, h: 3e-5}"
    planned = plan(grid_of(axes))
    sizes = [f"{name}: {n} mechanical + 3 thermal coordinates" for name in ("moreau", "carpenter") for n in (2, 3, 4)]
    assert sorted(name.partition(",")[0] for name in planned.operators) == sorted(sizes)
    assert planned.structures[0].label == "chain, 4 nodes"
    assert planned.more_structures == 0
    [diverging] = [line for line in planned.warnings if "diverges" in line]
    assert diverging.startswith("carpenter diverges, its free step grows")
    assert diverging.endswith("-fold at h = 3e-05 s (3 mechanical + 2 thermal modes)")
    [damped] = [line for line in planned.warnings if "damps the first mode" in line]
    assert damped.endswith("at h = 3e-05 s")
    [diverging] = [line for line in plan(grid_of(axes.replace("3e-5", "4e-5"))).warnings if "diverges" in line]
    assert diverging.endswith("-fold at h = 4e-05 s (worst with 3 mechanical + 2 thermal modes)")


def test_a_mode_that_does_not_swing_is_not_said_to_be_damped_numerically() -> None:
    for ratio, expected in ((0.3, 1), (5, 0)):
        scene = SCENE.replace("damping: {mass: 10, stiffness: 2.0e-7}", f"damping: {{ratio: {ratio}}}")
        warnings = plan(grid_of("axes: {h: 1e-4}", scene)).warnings
        assert sum("damps the first mode" in line for line in warnings) == expected


def test_load_periods_of_different_cases() -> None:
    """The dimension is as long as the longest; shorter cases have NaN beyond their own."""
    grid = grid_of("axes: {scene.load.frequency: [50, 100, 0]}\noutput: {interval: 1 ms}")
    solved = solve(grid, 0, np.arange(3))
    for name in ("period_impulse", "period_force", "period_temperature", "period_contact"):
        counted = np.sum(~np.isnan(solved.values[name]), axis=1)
        assert counted.tolist() == [3, 6, 0], name
    force = solved.values["contact_force"]
    assert np.array_equal(solved.values["period_force"][0, :3], force[0, 1:].reshape(3, 20).max(axis=1))
    assert np.nansum(solved.values["period_impulse"][0]) == pytest.approx(solved.values["contact_impulse"][0])


def test_a_reduced_static_start_is_at_rest_too() -> None:
    """Heated and loaded, with any number of modes: nothing swings, nothing drifts."""
    scene = SCENE.replace("amplitude: 100", "mean: 20, amplitude: 0").replace("0.02}", "0.02, heating: 0.5}")
    modes = "zip: {model: {mechanical_modes: [0, 1, full], thermal_modes: [0, 2, full]}}"
    start = scene.replace("  duration", "  initial: static\n  duration")
    grid = grid_of(f"axes: {{scheme: [moreau, event_driven]}}\n{modes}", start)
    for outer in range(grid.outer_count):
        x = solve(grid, outer, np.arange(1)).values["displacement"][0]
        assert x[0] > 2e-5
        assert np.abs(x - x[0]).max() < 1e-10 * x[0]


def test_an_axis_that_nothing_reads_gives_a_caution() -> None:
    text = "schemes: {other: {method: moreau}}\naxes: {schemes.other.theta: [0.5, 1], e: [0, 1]}\n"
    planned = plan(grid_of(text))
    assert (planned.cases, planned.unique) == (4, 2)
    assert [line for line in planned.warnings if "changes nothing" in line] == [
        "theta changes nothing: no scheme of this study reads it, its cases are the same"
    ]
    for used in (text.replace("axes: {", "axes: {scheme: [other, moreau], "), f"{text}reference: {{scheme: other}}"):
        assert not any("changes nothing" in line for line in plan(grid_of(used)).warnings)


def test_friction_is_read_beside_alpha(monkeypatch: pytest.MonkeyPatch) -> None:
    cold = replace(schemes.load("moreau"), READS=frozenset({"h"}))
    monkeypatch.setattr(schemes, "load", lambda name: cold)
    names = ("coefficient", "heat_share", "sliding_speed")
    assert [reads("moreau", "moreau", f"scene.friction.{name}") for name in names] == [True, False, False]


def test_a_reduction_does_not_depend_on_the_threads_of_blas() -> None:
    grid = grid_of("axes: {mechanical_modes: 20, thermal_modes: 50}", SCENE.replace("nodes: 4", "nodes: 200"))
    _operators.model_on.cache_clear()
    with threadpool_limits(limits=2, user_api="blas"):
        next(tasks(grid))
        cell = grid.settings(0)
        cached = _operators.model_on(_operators.reduced(cell))
    with threadpool_limits(limits=1, user_api="blas"):
        alone = reduce_structure(_operators.models.structure_of(cell.scene.model, cell.scene.parameters), 20, 50)
    assert _operators.model_on.cache_info().misses == 1
    for name, values in vars(alone.structure).items():
        if isinstance(values, np.ndarray):
            assert values.tobytes() == vars(cached.structure)[name].tobytes(), name


@pytest.mark.parametrize("sizes", [(400,), (14, 7, 4)])
def test_fastest_rate_of_sparse_matrices(sizes: tuple[int, ...]) -> None:
    """Of a mesh of bricks with linear temperatures it is the sum of those along its edges."""
    stiffness, inertia = scipy.sparse.csc_array(np.zeros((1, 1))), scipy.sparse.csc_array(np.ones((1, 1)))
    largest = 0.0
    for n in sizes:
        ends = np.append(np.full(n - 1, 2.0), 1.0)
        along = scipy.sparse.diags_array([-np.ones(n - 1), ends, -np.ones(n - 1)], offsets=[-1, 0, 1])
        heavy = scipy.sparse.diags_array([np.ones(n - 1), 2 * ends, np.ones(n - 1)], offsets=[-1, 0, 1]) / 6
        largest += scipy.linalg.eigvalsh(along.toarray(), heavy.toarray())[-1]
        stiffness = scipy.sparse.kron(stiffness, heavy) + scipy.sparse.kron(inertia, along)
        inertia = scipy.sparse.kron(inertia, heavy)
    pair = SparsePair(scipy.sparse.csc_array(stiffness), scipy.sparse.csc_array(inertia))
    assert 0.94 * largest < pair.spectrum()[-1] <= largest * (1 + 1e-9)


TEXT = f"study: a{HEAVY_SCENE}axes: {{h: H, alpha: {{lin: [1, 2, COUNT]}}}}\n"
PLAIN = "output: {interval: 0.1, histories: [], balances: false}\n"


def seconds_of(text: str) -> float:
    return model_seconds(arrange(parsed(text)))


def heavy(count: int, more: str = PLAIN, h: str = "1e-6") -> str:
    return TEXT.replace("H", h, 1).replace("COUNT", str(count)) + more


def test_the_model_counts_what_takes_time() -> None:
    """Whole packs, balances, and the steady rubs of the exact scheme."""
    seven, eight, many = (seconds_of(heavy(count, h="1e-7")) for count in (7, 8, 512))
    assert seven == pytest.approx(eight, rel=3e-3)  # but for the growth rate of one more alpha
    with_balances = seconds_of(heavy(512, PLAIN.replace("false", "true"), "1e-7"))
    assert 1.2 * many < with_balances < 1.5 * many
    exact = heavy(8).replace("h: 1e-6", "scheme: event_driven")
    assert seconds_of(exact.replace("histories", "steady: true, histories")) > seconds_of(exact)


def test_fast_waves_cost_the_exact_scheme_more() -> None:
    """A load harmonic of order 40 asks for forty times the certified steps of the load's own period."""
    exact = heavy(1000).replace("h: 1e-6", "scheme: event_driven, e: 0.5")
    waves = exact.replace("frequency: 20}", "frequency: 20, harmonics: [{order: 40, amplitude: 1}]}\n  speed: 20")
    assert seconds_of(waves) > 5 * seconds_of(exact)


def test_a_plan_says_an_order_of_time() -> None:
    orders = ["seconds", "minutes", "hours", "days"]
    assert [order_of_time(seconds) for seconds in (0.0, 61.0, 7200.0, 1e6)] == orders
    short, long = heavy(8, h="1e-4"), heavy(2048, h="1e-11")
    assert [plan_study(parsed(text)).time for text in (short, long)] == ["seconds", "days"]
    assert plan_study(parsed(f"{short}reference: {{scheme: moreau, h: 1e-11}}\n")).time != "seconds"


def test_a_plan_says_what_factors_take_and_warns_before_large_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("workflow.models._factors.MOST_BY_SUPERLU", 100)
    monkeypatch.setattr("workflow.plan._plan.MOST_BY_SUPERLU", 100)
    monkeypatch.setattr("workflow.models._factors._MANY_BYTES", 1e3)
    as_npz(matrices_of(blade(310)), tmp_path)
    text = "study: s\nscene:\n  matrices: {file: blade.npz, contact: 309}\n  casing: {gap: 1e-5}\n  duration: 1e-3\n"
    written(text + "axes: {mechanical_modes: 2, thermal_modes: 2}\n", tmp_path)
    status, output = told("plan", "study.yaml")
    assert status == 0, output
    for kind in ("displacements", "temperatures"):
        assert f"310 {kind}: " in output
        assert f"beware: each factorisation of a compact body of 310 {kind}" in " ".join(output.split())


LIMIT = 2 / (2 * np.sqrt(4e6 / 2.5e-3) * np.sin(7 * np.pi / 18))
"""2/ω_max of the four nodes, whose tip has a whole mass: ω_j = 2 √(k/m) sin((2j-1)π/18)."""


def test_a_plan_tells_of_limits() -> None:
    """Above 2/ω_max the free step grows; the penalty spring has a limit of its own."""
    defined = "schemes: {stiff: {method: penalty, stiffness: 2.0e7}, soft: {method: penalty, stiffness: 1.0e5}}"
    steps = (0.9 * LIMIT, 1.1 * LIMIT)
    axes = f"axes: {{scheme: [carpenter, stiff, soft], h: [{steps[0]}, {steps[1]}]}}"
    grid = grid_of(f"{defined}\n{axes}\noutput: {{interval: 1 ms}}")
    warnings = plan(grid).warnings
    for scheme in ("carpenter", "stiff", "soft"):
        (grows,) = [line for line in warnings if line.startswith(f"{scheme} diverges, its free step grows")]
        assert f"{steps[1]:.3g} s" in grows
        assert f"{steps[0]:.3g} s" not in grows
    (contact,) = [line for line in warnings if "is unstable in contact above a step of" in line]
    assert contact.startswith("stiff")
    for outer in grid.computed.tolist():
        solved = solve(grid, outer, np.arange(1))
        cell = grid.settings(outer)
        created = solved.values["energy_residual"][0]
        stiff = cell.scheme.label == "stiff"
        blown_up = cell.h > LIMIT or created > 1
        assert solved.values["status"][0] == (Status.DIVERGED if blown_up else Status.OK), cell
        if cell.h < LIMIT:  # growth in contact throws the tip out, with energy from nowhere
            assert created > 0.5 if stiff else abs(created) < 0.1, cell.scheme.label


def test_contact_stiffness_is_an_axis() -> None:
    options = "schemes.soft.stiffness: [1.0e6, 1.0e7 N/m], schemes.soft.damping: [0, 1]"
    axes = f"axes: {{scheme: [soft, moreau], h: 1e-5, {options}}}"
    grid = grid_of(f"schemes: {{soft: {{method: penalty}}}}\n{axes}\noutput: {{interval: 1 ms}}")
    assert {name for name, _ in grid.dims} >= {"stiffness", "damping"}
    assert plan(grid).unique == 4 + 1
    sunk = {}
    for outer in grid.computed.tolist():
        cell = grid.settings(outer)
        if cell.scheme.label == "soft":
            options = cell.scheme.options
            sunk[options.stiffness, options.damping] = solve(grid, outer, np.arange(1)).values["max_penetration"][0]
    assert sunk[1e6, 0] > 3 * sunk[1e7, 0] > 0
    assert len(set(sunk.values())) == 4


@pytest.mark.parametrize("method", names())
def test_metrics_of_some_schemes(method: str) -> None:
    """A study has them if one of its schemes gives them; where another runs they are NaN."""
    axes = "axes: {scheme: METHODS, h: 1e-5}\noutput: {interval: 1 ms}"
    grid = grid_of(axes.replace("METHODS", method))
    declared = set(template(grid).data_vars)
    assert {about.name for about in metrics_of(grid.study)} <= declared
    assert ("effective_restitution" in declared) == (method in ("carpenter", "penalty"))
    both = [method, "carpenter"] if method != "carpenter" else [method]
    mixed = grid_of(axes.replace("METHODS", f"[{', '.join(both)}]"))
    restitution = solve(mixed, 0, np.arange(1)).values["effective_restitution"]
    assert np.isnan(restitution[0]) == (method not in ("carpenter", "penalty"))
