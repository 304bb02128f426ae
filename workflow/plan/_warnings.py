"""What to beware of in a study before anything runs: of axes, scene, mesh, chosen modes, each scheme at each step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from random import Random
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow import schemes
from workflow.cases import (
    OF_REFERENCE,
    TOLERANCE,
    ChosenModes,
    Grid,
    Reduced,
    alpha_of,
    cases_of,
    corner_text,
    decides_structure,
    friction_of,
    full_structure,
    model_on,
    reduced,
    reduced_structure,
    reference_settings,
)
from workflow.judges import cautions
from workflow.judges.trials import EXACT, reason_of
from workflow.kernels import Array
from workflow.models import Cases, Chain, Structure, frequencies, one_thread, project
from workflow.plan._coating import coating_cautions
from workflow.plan._figures import size_text
from workflow.reduction import DEFAULT, Reduction
from workflow.solve import observed_structure, projection_residual_of
from workflow.study import MODES, CaseSettings

_CONTACT_SHARE = 0.1
"""Time of a contact, over the load's period, before a run has measured it."""

_TENTH = "a tenth of the shortest period"
"""The same in words."""


def tip_cells(grid: Grid) -> dict[str, Any]:
    """Return what an archive says of the tip temperature of blades: depths [m] and diffusivity [m²/s].

    It is the mean over half the cell at the tip; few thermal modes amount to a larger cell, of the capacity
    1/(e_nᵀ C2⁻¹ e_n) that heat at the tip warms at once.
    """
    rows = []
    for outer in grid.kinds(decides_structure)[:MOST_OUTER] if grid.study.scene.model == "blade" else ():
        full, structure = (of(grid.settings(outer)) for of in (full_structure, reduced_structure))
        assert isinstance(full, Chain)
        half, capacity = full.lengths[-1] / 2, full.heat_capacities[-1]
        warmed = np.linalg.inv(structure.heat_capacity)[-1, -1]
        rows.append((half / (capacity * warmed), half, 2 * full.conduction[-1] * half**2 / capacity))
    if not rows:
        return {}
    depth, mesh, diffusivity = zip(*rows, strict=True)
    return {"depth": [min(depth), max(depth)], "depth_of_mesh": max(mesh), "thermal_diffusivity": min(diffusivity)}


def coarse_tip(grid: Grid) -> Iterator[str]:
    """Yield that the cell at the tip is thicker than heat enters in a contact of a tenth of the shortest period."""
    about, frequency, scene = tip_cells(grid), grid.fastest, grid.study.scene
    heated = scene.makes_alpha or any(grid.study.each("alpha"))
    if about and frequency > 0 and heated:
        yield from too_thick(about, _CONTACT_SHARE / frequency, _TENTH)


def too_thick(about: Mapping[str, Any], seconds: float, words: str) -> Iterator[str]:
    """Yield that heat does not enter the whole cell at the tip in some time, by what :func:`tip_cells` returns."""
    cell, mesh = 2e3 * float(np.max(about["depth"])), 2e3 * float(about["depth_of_mesh"])
    entered = 1e3 * math.sqrt(float(about["thermal_diffusivity"]) * seconds)
    if mesh > entered > 0:
        remedy = f"max_temperature is too low; `tip_cell: {entered / 4:.1g} mm` would do"
        yield f"the cell at the tip is {mesh:.3g} mm thick, and heat enters {entered:.2g} mm in {words}: {remedy}"
    elif cell > entered > 0:
        kept = f"the thermal modes kept amount to a cell of {cell:.3g} mm at the tip"
        remedy = "max_temperature depends on their number; keep more, or use krylov"
        yield f"{kept}, and heat enters {entered:.2g} mm in {words}: {remedy}"


def fast_samples(grid: Grid) -> Iterator[str]:
    """Yield that contact forces are means over less than a wave takes through two cells of a chain, 4/ω_max."""
    every = (full_structure(grid.settings(outer)) for outer in grid.kinds(decides_structure)[:MOST_OUTER])
    two = max((4 / frequencies(one)[-1] for one in every if isinstance(one, Chain) and one.springs.all()), default=0.0)
    if "contact_force" in grid.study.output.histories and grid.sampling.interval < two:
        mean = f"contact_force is a mean over {grid.sampling.interval:g} s"
        yield f"{mean}, shorter than a wave takes through two cells ({two:.2g} s): it shows the mesh"


LOST = 1e-3
"""Share of initial states and constant loads that a basis may lose without a word, see ``projection_residual``."""

_SPEEDS = 100.0, 20e3
"""Least and largest speed of sound of a blade, m/s: of soft rubber and above diamond's."""

_FASTEST = 2000.0
"""Speed above which nothing but a turbocharger or a spindle turns, 120 000 rpm, rev/s."""

_LIGHTEST = 100.0
"""Density below which nothing is a blade, kg/m³: that of cork or foam."""

MOST_CASES, MOST_OUTER = 500, 64
"""Cases of an outer index and outer indices that are looked at; of more cases a regular choice."""

_MOST_STRUCTURES = 16
"""Structures on which steps are judged, a regular choice with both ends: each takes some milliseconds."""


def cautions_of_scene(grid: Grid) -> Iterator[str]:
    """Yield what to beware of in springs, structures with the conditions of their cases, and bases."""
    parameters = f"scene.{grid.study.scene.model}."
    is_exact = any(choice.method == EXACT for choice in grid.study.schemes.values())  # that of a reference, too
    for settings in _distinct_settings(grid, "scheme", "schemes.", parameters):
        scheme, structure = schemes.load(settings.scheme.method), reduced_structure(settings)
        if scheme.contact_stiffness_of is not None and not scheme.refusal(structure, settings.scheme.options):
            stiffness = scheme.contact_stiffness_of(structure, settings.scheme.options)
            yield from cautions.soft_spring(full_structure(settings), stiffness, settings.scheme.label)
    yield from _units([one.scene.parameters for one in _distinct_settings(grid, parameters)])
    yield from _units_of_scene(grid)
    for settings in _distinct_settings(grid, parameters):
        structure, duration = full_structure(settings), grid.sampling.duration
        is_static, cases = settings.scene.initial == "static", _cases(grid, settings)
        if not isinstance(structure, Chain) or structure.has_matrices:  # of others the modes are not at hand
            model = model_on(reduced(settings))
            yield from cautions.scene_cautions(structure, model, cases, duration, is_static=is_static)
            yield from cautions.flutter(model.structure, cases)
            if is_exact:
                yield from cautions.endless_bounces(model.structure, cases)
    worst: dict[str, tuple[float, float]] = {}
    for settings in _distinct_settings(grid, "reduction", "mechanical_modes", "thermal_modes", parameters):
        basis, cases, full = basis_text(settings), _cases(grid, settings), full_structure(settings)
        model = model_on(reduced(settings))
        if model.reduction is not None:
            friction = float(cases.friction.max())
            yield from cautions.flutter_of_basis(model.structure, friction, basis, *_model_to_compare(settings))
            if grid.fastest > 0 and cases.alpha.max() > 0 and grid.study.scene.model != "blade":
                yield from cautions.coarse_heat(full, model.structure, _CONTACT_SHARE / grid.fastest, _TENTH, basis)
        if model.reduction is not None:
            lost = float(np.nanmax(projection_residual_of(settings, cases), initial=0.0))
            worst[basis] = max(worst.get(basis, (0.0, 0.0)), (lost, _lost_at_contacts(full, model.reduction, cases)))
    lossy = [(*lost, basis) for basis, lost in worst.items() if lost[0] > LOST]
    if lossy:
        lost, at_contacts, basis = max(lossy)
        worst_of = f", the worst of {len(lossy)} such bases," if len(lossy) > 1 else ""
        yield (
            f"{basis}{worst_of} lose {100 * lost:.2g} % of an initial state or of the static answer to constant loads, "
            f"over the whole structure (projection_residual), and {100 * at_contacts:.2f} % of it at the contacts; if "
            "that matters there, or at a sensor, keep more modes, or `full`"
        )


def _lost_at_contacts(structure: Structure, reduction: Reduction, cases: Cases) -> float:
    """Return the largest share that a basis loses of initial states and static answers at the contacts."""
    small = reduction.project(cases)
    full, kept = _at_contacts(structure, cases), _at_contacts(reduction.structure, small)
    size = np.abs(full).max(axis=-1)
    return float(np.max(np.abs(kept - full).max(axis=-1) / np.where(size > 0, size, np.inf)))


def _at_contacts(structure: Structure, cases: Cases) -> Array:
    """Return initial displacement, velocity and temperature of contacts, and static ones: ``(5, case, contact)``."""
    normal, heat = structure.contacts.normal, structure.contacts.heat
    static = structure.mechanical.static_solutions(cases.steady + cases.mean[:, None] * structure.load_direction)
    warm = (project(heat, x) for x in (cases.temperature, structure.thermal.static_solutions(cases.heating)))
    moved = (project(normal, x) for x in (cases.displacement, cases.velocity))
    return np.stack([*moved, project(normal, static) + cases.offset, *warm])


def _model_to_compare(settings: CaseSettings) -> tuple[Callable[[], Structure], str]:
    """Return what makes the structure with which a basis is compared, and its name.

    Of a structure that is too large it is the same basis of a tenth more vectors, or fewer where so many are most.
    """
    full, by = full_structure(settings), reduced(settings)
    if full.has_matrices:
        return lambda: full, "the full structure"
    count, step = by.modes[0], by.modes[0] // 10 + 1
    count += step if count + step <= full.mechanical.most_modes else -step
    return lambda: model_on(replace(by, modes=(count, by.modes[1]))).structure, f"a basis of {count} vectors"


def _units(every: Sequence[Any]) -> Iterator[str]:
    """Yield that a density or the speed of sound is that of no blade, of parameters that have them."""
    density = min((one.density for one in every if hasattr(one, "density")), default=np.inf)
    if density < _LIGHTEST:
        yield f"a density of {density:.3g} kg/m3 is not that of a blade: check its unit, kg/m3 or e.g. `4.43 g/cm**3`"
    speeds = [one.wave_speed for one in every if getattr(one, "wave_speed", 0) > 0]
    ratio = max(getattr(one, "damping_ratio", getattr(getattr(one, "damping", None), "ratio", 0.0)) for one in every)
    if ratio >= 1:
        yield f"a damping ratio of {ratio:g} is overcritical: if per cent are meant, write {ratio / 100:g}"
    for speed in (min(speeds, default=np.inf), max(speeds, default=0.0)):
        if 0 < speed < _SPEEDS[0] or _SPEEDS[1] < speed < np.inf:
            yield f"the speed of sound would be {speed:.3g} m/s: check the units of stiffness, density and lengths"


def _units_of_scene(grid: Grid) -> Iterator[str]:
    """Yield that a speed is that of no machine, and that friction beside α acts on nothing."""
    scene, friction = grid.study.scene, grid.study.scene.friction
    fastest = max(map(float, grid.study.each("scene.speed")))
    if fastest > _FASTEST:
        yield f"a speed of {fastest:.6g} Hz is {60 * fastest:.6g} rpm: check its unit, Hz or e.g. `9000 rpm`"
    if friction is not None and not scene.makes_alpha and not full_structure(grid.settings(0)).contacts.slides:
        yield "`scene.friction.coefficient` changes nothing: alpha is given, and the structure has no `tangent`"


def _distinct_settings(grid: Grid, *beginnings: str) -> Iterator[CaseSettings]:
    """Yield settings that differ along axes whose path begins so, of many a regular choice with both ends.

    Where structures depend on the speed the fastest counts: it grows most.
    """
    speeds = map(float, grid.study.each("scene.speed"))
    fastest = {"scene.speed": max(speeds)} if grid.study.depends_on_speed else {}
    for outer in _some_of(np.array(grid.kinds(lambda path: path.startswith(beginnings))), MOST_OUTER):
        yield grid.settings(int(outer), fastest)


def _some_of(every: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return all, or of more than so many a regular choice with both ends."""
    return every[np.linspace(0, every.size - 1, min(every.size, most)).round().astype(np.int64)]


def _cases(grid: Grid, settings: CaseSettings) -> Cases:
    """Return cases to look at: all, or a regular choice that has the first and the last."""
    inner = _some_of(np.arange(grid.inner_count), MOST_CASES)
    return cases_of(settings, grid.inner_values(inner), inner.size)[1]


def basis_text(settings: CaseSettings) -> str:
    """Name the reduced model of settings."""
    modes = f"{settings.mechanical_modes} mechanical + {settings.thermal_modes} thermal modes"
    return modes if settings.reduction == DEFAULT else f"{modes} of {settings.reduction}"


def distinct_lines(lines: Iterable[str], most: int) -> tuple[str, ...]:
    """Return distinct lines in their order, at most so many, and how many more there are."""
    distinct = tuple(dict.fromkeys(lines))
    more = len(distinct) - most
    return distinct if more <= 0 else (*distinct[:most], f"… and {more} more")


_CHOICES_SHOWN = 8

_MISSED = "more modes, as far as `auto` may choose them, change less than the tolerance"

_UNTRIED = (
    "an ok case there that misses the tolerance shows it in its own errors",
    "only a `reference` would tell whether an ok case there meets the tolerance",
)
"""What corners that were left out mean for cases with a reference, and without."""


def choice_lines(grid: Grid) -> tuple[str, ...]:
    """Return a line for each count that a tolerance decides, of many the first and how many more there are."""
    return distinct_lines(
        (f"{name}: {_counts_of(choice)}, {_error_text(choice)}" for name, _, choice in _every_choice(grid)),
        _CHOICES_SHOWN,
    )


def choice_cautions(grid: Grid) -> Iterator[str]:
    """Yield counts of modes that miss their tolerance, that no trial confirms, or that only some corners decided."""
    for name, tolerance, choice in _every_choice(grid):
        if choice.untried:
            yield f"{name}: {_counts_of(choice)} are decided {choice.untried}; {_UNTRIED[grid.study.reference is None]}"
        if not choice.is_confirmed:
            yield f"{name}: {_counts_of(choice)}, {choice.against}"
        elif choice.error > tolerance:
            yield f"{name}: {_counts_of(choice)} miss it with an error of {choice.error:.2g}; {_MISSED}"


def _every_choice(grid: Grid) -> Iterator[tuple[str, float, ChosenModes]]:
    """Yield what each choice is for, its tolerance, and the choice."""
    for name, choice in grid.choices.items():
        outer, reference = int(name.removeprefix(OF_REFERENCE)), grid.study.reference
        if reference is None or not name.startswith(OF_REFERENCE):
            tolerance = float(grid.value(outer, TOLERANCE))
            yield _settings_text(grid.settings(outer), tolerance), tolerance, choice
        else:
            tolerance = float(reference.values[TOLERANCE])
            yield f"reference, {_settings_text(reference_settings(grid, outer), tolerance)}", tolerance, choice


def _settings_text(settings: CaseSettings, tolerance: float) -> str:
    """Return for which tolerance, basis and structure a choice is."""
    return f"tolerance {tolerance:g}, {settings.reduction}, {size_text(settings)}"


def _counts_of(choice: ChosenModes) -> str:
    return f"{choice.mechanical_modes} + {choice.thermal_modes} modes"


def _error_text(choice: ChosenModes) -> str:
    """Return the error of a choice, in which case, and against what."""
    if not choice.is_confirmed:
        return choice.against
    case = corner_text(choice.hardest)
    where = f"in the worst corner ({case})" if case else "in the only case"
    return f"error {choice.error:.2g} {where}, {choice.against}"


_REPEATED = 10
"""Lines of warnings that a run prints and its archive keeps, at most."""

_FEWEST_SAMPLES = 20
"""Samples of a load period of whose extremes a plan says nothing: of a sine they miss 1 %."""

_LOOKED_AT = 5000
"""Settings of the operators that are judged for what to beware of, at about 0.2 ms each."""


def warnings(grid: Grid) -> tuple[str, ...]:
    """Return what to beware of, one sentence each, none twice."""
    choices = [grid.settings(outer).scheme for outer in grid.kinds(lambda path: path == "scheme")]
    idle = (
        f"{dimension.name} changes nothing: no scheme of this study reads it, its cases are the same"
        for dimension in (*grid.outer, *grid.inner)
        if not any(grid.matters(one)(axis.path) for one in choices for axis in dimension.axes)
    )
    every = [grid.settings(outer) for outer in looked_at(_of_some_structures(grid))]
    of_steps = [caution for settings in every for caution in _cautions(grid, settings)]
    steps = _sentences(of_steps, len(set(map(basis_text, every))))
    lacks_exact = grid.study.output.steady is not None and all(choice.method != EXACT for choice in choices)
    steady = (f"no scheme of this study is {EXACT}, and only that one has steady rubs",) if lacks_exact else ()
    samples = (*_coarse_sections(grid), *fast_samples(grid))
    sentences = (
        *idle,
        *steady,
        *_stands_still(grid),
        *samples,
        *_fixed_reference(grid),
        *choice_cautions(grid),
        *cautions_of_scene(grid),
        *coating_cautions(grid),
        *steps,
    )
    return tuple(dict.fromkeys(sentences))


def _fixed_reference(grid: Grid) -> Iterator[str]:
    """Yield that a reference has fixed counts of modes, whose error nothing states."""
    reference = grid.study.reference
    if reference is None or reference.is_auto or not set(MODES) & set(reference.values):
        return
    settings = reference_settings(grid, int(grid.computed[0]))
    if model_on(reduced(settings)).reduction is not None:
        remedy = "write `auto` with a `tolerance` under `reference`, which states it, or `full`"
        yield f"nothing states the error of the reference's basis, {basis_text(settings)}: {remedy}"


def _stands_still(grid: Grid) -> Iterator[str]:
    """Yield that a structure depends on a speed that is left out."""
    if grid.study.depends_on_speed and not any(grid.study.each("scene.speed")):
        yield "the structure depends on the speed, and `scene.speed` is left out, so it stands still (Ω = 0)"


def _of_some_structures(grid: Grid) -> list[int]:
    """Return the outer indices that are computed; of many structures those of a regular choice with both ends."""
    beginnings = f"scene.{grid.study.scene.model}.", "scene.speed"
    structure = grid.alike(grid.computed, lambda path: path.startswith(beginnings))
    chosen = np.isin(structure, _some_of(np.unique(structure), _MOST_STRUCTURES))
    return [int(outer) for outer in grid.computed[chosen]]


def _coarse_sections(grid: Grid) -> Iterator[str]:
    """Yield that extremes of load periods are taken of few samples."""
    samples = 1 / max(grid.fastest * grid.sampling.interval, 1e-300)
    if grid.study.output.sections and samples < _FEWEST_SAMPLES:
        yield f"period_displacement has {samples:.2g} samples per load period: give a smaller `output.interval`"


def warning_lines(grid: Grid) -> tuple[str, ...]:
    """Return what a run repeats of :func:`warnings`: the first of them, and how many more ``workflow plan`` names."""
    with one_thread():  # matrices are small
        try:
            sentences = warnings(grid)
        except (Exception, SystemExit) as error:  # of a foreign scheme's amplification, say: no run fails by it
            sentences = (f"warnings could not be determined: {reason_of(error)}",)
    if len(sentences) <= _REPEATED:
        return sentences
    return (*sentences[: _REPEATED - 1], f"… and {len(sentences) - _REPEATED + 1} more, which `workflow plan` names")


def looked_at(outer: list[int]) -> list[int]:
    """Return outer indices to judge: all of them, or of very many a fixed random choice."""
    return outer if len(outer) <= _LOOKED_AT else sorted(Random(0).sample(outer, _LOOKED_AT))


@lru_cache(maxsize=64)
def _free_modes(by: Reduced) -> cautions.FreeModes:
    return cautions.free_modes(model_on(by).structure)


class _Caution(NamedTuple):
    """A caution about a scheme at a step on a structure, with the name of its reduced model."""

    basis: str
    scheme: str
    h: float
    said: cautions.StepCaution


def _cautions(grid: Grid, settings: CaseSettings) -> Iterator[_Caution]:
    """Yield the cautions about one scheme at one step on one structure."""
    scheme, options = schemes.load(settings.scheme.method), settings.scheme.options
    structure = observed_structure(reduced(settings), grid.study.output.temperature_depth)
    refusal = scheme.refusal(structure, options)
    if refusal is None:
        modes, ends = _free_modes(reduced(settings)), ends_of_friction(grid, settings)[0]
        said = list(cautions.step_cautions(scheme, options, settings.h, structure, modes, ends, grid.fastest))
    else:
        basis = f" with {settings.reduction}" if structure.contacts.is_massless else ""
        said = [cautions.StepCaution(f"fails{basis}, as {refusal}", "", 0.0)]
    yield from (_Caution(basis_text(settings), settings.scheme.label, settings.h, one) for one in said)


def ends_of_friction(grid: Grid, settings: CaseSettings) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the smallest and the largest friction coefficient, and α, of the cases of settings."""
    count, varying = grid.inner_count, grid.inner_values(np.arange(grid.inner_count))
    friction = friction_of(settings, full_structure(settings), varying, count)
    mu, alpha = ((float(of.min()), float(of.max())) for of in (friction, alpha_of(settings, varying, count)))
    return mu, alpha


def _sentences(every: list[_Caution], bases: int) -> tuple[str, ...]:
    """Return one sentence per scheme and kind, with the largest amount at each step.

    What holds for some of the study's ``bases`` only is said with the one, or the worst, of them.
    """
    concerned: dict[tuple[str, str, float], set[str]] = {}
    worst: dict[tuple[str, str], dict[float, _Caution]] = {}
    for caution in every:
        kind = caution.said.what.split(" (")[0]  # the same first mode differs by a hair between reductions
        at = worst.setdefault((caution.scheme, kind), {})
        concerned.setdefault((caution.scheme, kind, caution.h), set()).add(caution.basis)
        if caution.h not in at or caution.said.size > at[caution.h].said.size:
            at[caution.h] = caution

    def amount(kind: tuple[str, str], caution: _Caution) -> str:
        some = len(concerned[*kind, caution.h])
        basis = caution.basis if some == 1 else f"worst with {caution.basis}"
        return f"{caution.said.amount} at h = {caution.h:.3g} s" + (f" ({basis})" if some < bases else "")

    def sentence(kind: tuple[str, str], at: dict[float, _Caution]) -> str:
        amounts = [amount(kind, caution) for _, caution in sorted(at.items()) if caution.said.amount]
        more = f" ({len(amounts)} steps)" if len(amounts) > cautions.FEW else ""
        return f"{kind[0]} {max(at.values(), key=lambda one: one.said.size).said.what} {cautions.listed(amounts)}{more}"

    return tuple(sentence(kind, at).rstrip() for kind, at in worst.items())
