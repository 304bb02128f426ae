"""What to beware of in a study, before anything runs: of its axes, its scene, and each scheme at each step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices
from workflow.grid._choice_words import choice_cautions
from workflow.grid._conditions import friction_of
from workflow.grid._frequencies import fastest
from workflow.grid._operators import Reduced, reduced, reduced_structure, structure_on
from workflow.grid._reason import reason_of
from workflow.grid._scene_cautions import scene_cautions
from workflow.models import (
    Array,
    frequencies,
    mechanical_modes,
    modal_damping,
    rates,
)
from workflow.reduction import DEFAULT
from workflow.schemes import Scheme
from workflow.study import Cell

_GROWS = 1e-12
"""Growth of a free step above which a warning is printed: below, a million steps grow by less than a millionth."""

_COARSE = 20
"""Steps per load period below which a plan says so: implicit Euler then errs by about a sixth."""

_RINGS = 0.9
"""What a step leaves of a disturbance of a tip without mass, from which on a plan says that it rings."""

_REPEATED = 10
"""Lines of warnings that a run prints and its archive keeps, at most."""

_LOOKED_AT = 5000
"""Settings of the operators that are judged for what to beware of, at about 0.2 ms each."""


def warnings(grid: Grid) -> tuple[str, ...]:
    """Return what to beware of, one sentence each, none twice."""
    computed = grid.places.computed
    choices = [grid.settings(int(k)).scheme for k in np.unique(grid.alike(computed, lambda path: path == "scheme"))]
    idle = (
        f"{dimension.name} changes nothing: no scheme of this study reads it, its cases are the same"
        for dimension in (*grid.outer, *grid.inner)
        if all(grid.unread(dimension, one) and grid.uncompared(dimension, one) for one in choices)
    )
    cells = [grid.settings(outer) for outer in looked_at(computed)]
    cautions = [caution for cell in cells for caution in _beware(grid, cell)]
    told = (*idle, *choice_cautions(grid), *scene_cautions(grid), *_sentences(cautions, len(set(map(_basis, cells)))))
    return tuple(dict.fromkeys(told))


def warning_lines(grid: Grid) -> tuple[str, ...]:
    """Return what a run repeats of :func:`warnings`: the first of them, and how many more ``workflow plan`` names."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):  # matrices are small
        try:
            told = warnings(grid)
        except (Exception, SystemExit) as error:  # of a foreign scheme's amplification, say: no run fails by it
            told = (f"what to beware of could not be found: {reason_of(error)}",)
    if len(told) <= _REPEATED:
        return told
    return (*told[: _REPEATED - 1], f"… and {len(told) - _REPEATED + 1} more, which `workflow plan` names")


def looked_at(computed: Indices) -> list[int]:
    """Return outer indices to judge: all of them, or of very many a fixed random choice."""
    if computed.size > _LOOKED_AT:
        computed = np.sort(np.random.default_rng(0).choice(computed, _LOOKED_AT, replace=False))
    return [int(outer) for outer in computed]


@lru_cache(maxsize=64)
def _free_modes(by: Reduced) -> tuple[Array, Array, Array]:
    """Return ω, c and μ of a structure's modes, of a long chain those of the lowest and the highest.

    The last ω is infinite where the tip has no mass, and its c says nothing.
    """
    structure = structure_on(by)
    omega = frequencies(structure)
    damping = structure.damping.of_modes(np.where(np.isinf(omega), 0.0, omega))
    if structure.damper is not None:
        damping = modal_damping(structure, mechanical_modes(structure))
    return omega, damping, rates(structure)


@dataclass(frozen=True)
class _Caution:
    """One thing to beware of: ``what`` it is, for which scheme and step, and how much of it (empty for any step).

    ``basis`` names the reduced model of which it is said.
    """

    basis: str
    scheme: str
    what: str
    h: float
    amount: str
    size: float


def _beware(grid: Grid, cell: Cell) -> list[_Caution]:
    """Return the cautions about one scheme at one step on one structure."""
    scheme = schemes.load(cell.scheme.method)
    structure = reduced_structure(cell)
    refusal = scheme.refusal(structure, cell.scheme.options)
    if refusal is not None:
        basis = f" with {cell.reduction}" if structure.has_massless_tip else ""
        return [_Caution(_basis(cell), cell.scheme.label, f"fails{basis}, as {refusal}", cell.h, "", 0.0)]
    if "h" not in scheme.READS or scheme.amplification is None or scheme.thermal_amplification is None:
        return []
    omega, damping, mu = _free_modes(reduced(cell))
    free = np.abs(scheme.amplification(omega, damping, cell.h, cell.scheme.options))
    heat = np.abs(scheme.thermal_amplification(mu, cell.h, cell.scheme.options))
    growth = float(max(free.max(initial=0.0), heat.max(initial=0.0)))

    def caution(what: str, amount: str, size: float) -> _Caution:
        return _Caution(_basis(cell), cell.scheme.label, what, cell.h, amount, size)

    if growth > 1 + _GROWS:
        return [caution("diverges, its free step grows", f"{growth:.6g}-fold", growth)]
    cautions = []
    ringing = free[np.isinf(omega)].max(initial=0.0)
    if ringing >= _RINGS:
        what = (
            f"makes the tip ring, which {cell.reduction} leaves without mass (theta = 1 is advised): each step turns a"
        )
        cautions.append(caution(f"{what} disturbance over and leaves", f"{ringing:.3g} of it", ringing))
    if scheme.contact_limit is not None:
        friction = friction_of(cell, structure, grid.inner_values(np.arange(grid.inner_count)), grid.inner_count)
        ends = {float(friction.min()), float(friction.max())}
        limit = min(scheme.contact_limit(structure, cell.scheme.options, coefficient) for coefficient in ends)
        if cell.h > limit:
            measured = f"{schemes.limit_text(limit)} s (measured with contact that comes and goes)"
            cautions.append(caution("grows in contact, which is stable only up to", measured, -limit))
    if 0 < omega[0] < np.inf and damping[0] < 2 * omega[0]:  # a mode that swings
        physical = float(damping[0] / (2 * omega[0]))
        numerical = _first_mode_damping(scheme, omega[:1], damping[:1], cell) - physical
        if numerical > physical + _GROWS:
            own = f"more than its own {physical:.2g} of critical" if physical else "which has no damping of its own"
            what = f"damps the first mode ({omega[0] / (2 * np.pi):.4g} Hz) {own}, numerically by"
            cautions.append(caution(what, f"{numerical:.2g}", numerical))
    frequency = fastest(grid)
    if frequency * cell.h * _COARSE > 1:
        per_period = 1 / (frequency * cell.h)
        cautions.append(caution("takes few steps per load period,", f"{per_period:.3g}", frequency * cell.h))
    return cautions


def _first_mode_damping(scheme: Scheme, omega: Array, damping: Array, cell: Cell) -> float:
    """Return the damping ratio -ln|z|/|arg z| that the free step gives the first mode."""
    assert scheme.amplification is not None
    z = complex(scheme.amplification(omega, damping, cell.h, cell.scheme.options)[0, 0])
    turn = abs(np.angle(z))
    return float(-np.log(abs(z)) / turn) if abs(z) > 0 and turn > 0 else float("inf")


def _listed(amounts: list[str]) -> str:
    """Join a few amounts, or the ends of many."""
    return ", ".join(amounts) if len(amounts) <= 6 else f"{amounts[0]} to {amounts[-1]} ({len(amounts)} steps)"


def _basis(cell: Cell) -> str:
    """Name the reduced model of a cell."""
    modes = f"{cell.mechanical_modes} + {cell.thermal_modes} modes"
    return modes if cell.reduction == DEFAULT else f"{modes} of {cell.reduction}"


def _sentences(cautions: list[_Caution], bases: int) -> tuple[str, ...]:
    """Return one sentence per scheme and kind, with the largest amount at each step.

    What holds for some of the study's ``bases`` only is said with the one, or the worst, of them.
    """
    concerned: dict[tuple[str, str, float], set[str]] = {}
    worst: dict[tuple[str, str], dict[float, _Caution]] = {}
    for caution in cautions:
        kind = caution.what.split(" (")[0]  # the same first mode differs by a hair between reductions
        at = worst.setdefault((caution.scheme, kind), {})
        concerned.setdefault((caution.scheme, kind, caution.h), set()).add(caution.basis)
        if caution.h not in at or caution.size > at[caution.h].size:
            at[caution.h] = caution

    def amount(kind: tuple[str, str], caution: _Caution) -> str:
        some = len(concerned[*kind, caution.h])
        basis = caution.basis if some == 1 else f"worst with {caution.basis}"
        return f"{caution.amount} at h = {caution.h:g} s" + (f" ({basis})" if some < bases else "")

    sentences = (
        f"{kind[0]} {max(at.values(), key=lambda c: c.size).what} "
        + _listed([amount(kind, caution) for _, caution in sorted(at.items()) if caution.amount])
        for kind, at in worst.items()
    )
    return tuple(sentence.rstrip() for sentence in sentences)
