"""The held regime with friction heat, from one α to the next: all that depends on α, in one kernel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels.compiled import kernel, part, rolled
from workflow.kernels.packs import Lane, complex_at, narrow, pack, spread, store
from workflow.models import Array
from workflow.schemes._exact import zeros as row
from workflow.schemes._exact.layout import Layout, layout
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._exact.regimes import Regime, linked, regime_of
from workflow.schemes._exact.spectrum import Uncoupled, guesses_of, solve_uncoupled, uncoupled
from workflow.schemes._exact.zeros import Scratch, scratch

_NO_GUESSES = np.zeros((2, 0))


class TwoWay(NamedTuple):
    """The held regimes at all α > 0."""

    system: Uncoupled
    mechanical: int
    """How many of the inputs w are constant loads; they come first, and those that are no heating last."""
    force: Array
    """z'' per input w, see :class:`~workflow.schemes._exact.regimes.Regime`, ``(mode, input)``."""
    heating: Array
    """τ' per input, but for friction heat, ``(thermal mode, input)``."""
    inputs: Array
    """Contact force per input, ``(input,)``."""
    heat_tip: Array
    """χ_n, ``(thermal mode,)``."""
    entry: Array
    exit: Array
    """Both see :class:`~workflow.schemes._exact.modal_system.ModalSystem`."""


class HeldRegimes:
    """The held regimes of a batch, for one α after the other."""

    def __init__(self, held: ModalSystem):
        self._held, self._linked = held, linked(held)
        system = uncoupled(self._linked)
        self._two_way = None if system is None else _two_way(self._linked, system)
        self._work = scratch(2 * self._linked.frequency.size + self._linked.rate.size)

    def at(self, alpha: float, friction: float = 0.0) -> Layout:
        """Return the regime at α [W/N], and µ along the tangent."""
        system = self._held.sliding(friction)
        if system is not self._held:
            return layout(regime_of(linked(system), alpha))
        if alpha > 0 and self._two_way is not None:
            is_solved, regime = _regime_at(self._two_way, alpha, _NO_GUESSES, self._work)
            if not is_solved:
                guesses = guesses_of(state_space(self._linked, alpha)[0])
                is_solved, regime = _regime_at(self._two_way, alpha, guesses, self._work)
            if is_solved:
                return regime
        return layout(regime_of(self._linked if alpha > 0 else self._held, alpha))


def _two_way(held: ModalSystem, system: Uncoupled) -> TwoWay:
    """Return what the kernel takes."""
    modes = held.frequency.size
    _, _, source = state_space(held, 0.0)
    arrays = source[modes : 2 * modes], source[2 * modes :], signal_inputs(held), held.heat_tip, held.entry, held.exit
    return TwoWay(system, held.signal_steady.size, *map(np.ascontiguousarray, arrays))


@kernel
@rolled
def _regime_at(h: TwoWay, alpha: float, guesses: Array, work: Scratch) -> tuple[bool, Layout]:
    """Return whether the spectrum at α can be trusted, and the regime, in the coordinates of ``regimes._two_way``."""
    pairs, count = solve_uncoupled(h.system, alpha, guesses, work)
    t, size = work.lanes, work.residue.shape[1]
    firsts, wide = size - 2 * pairs, work.lanes.shape[1]
    inward, outward, source = np.empty((size, wide)), np.empty((size, size)), np.empty((h.inputs.size, wide))
    damping, stiffness, rate = np.empty(pairs), np.empty(pairs), np.empty(firsts)
    signal, temperature = np.empty(size), np.zeros(size)
    for p in range(pairs):
        s, nu = t[row.D, p] + t[row.SHIFT, p], t[row.D_IM, p] + t[row.SHIFT_IM, p]
        damping[p], stiffness[p] = -2.0 * s, s * s + nu * nu
        signal[p] = 2.0 * (t[row.FORCE, p] - t[row.FORCE_IM, p] * (s / nu))
        signal[pairs + p] = 2.0 * t[row.FORCE_IM, p] / nu
    for j in range(firsts):
        rate[j] = -(t[row.D, pairs + j] + t[row.SHIFT, pairs + j])
        signal[2 * pairs + j] = t[row.FORCE, pairs + j]
    for i in range(size):
        _fill_inward(t, work.left, i, pairs, firsts, inward)
        _fill_outward(t, work.right, i, pairs, firsts, outward)
    heats = h.heat_tip.size
    for q in range(size):
        for j in range(heats):
            temperature[q] += h.heat_tip[j] * outward[q, size - heats + j]
    for i in range(h.inputs.size):
        for first in range(0, size, 8):
            _fill_source(h, alpha, inward, i, source, narrow(first))
        source[i, size] = h.inputs[i]
    coupling, resonant = np.zeros((3, firsts, pairs)), np.zeros(pairs)
    regime = Regime(
        damping, stiffness, rate, coupling, resonant, signal, temperature, source, inward, outward, h.entry, h.exit
    )
    return count > 0, layout(regime)


@part
def _fill_inward(t: Array, left: Array, i: int, pairs: int, firsts: int, inward: Array) -> None:
    """Fill what coordinates take from one of X; packs of a kind reach into the next kind, which is filled after it."""
    for p in range(0, pairs, 8):
        store(inward, (i, narrow(p)), pack(left, (2 * i, narrow(p))))
    for p in range(0, pairs, 8):
        lane = narrow(p)
        (pole, pole_im), (shift, shift_im) = complex_at(t, row.D, lane), complex_at(t, row.SHIFT, lane)
        real, imaginary = complex_at(left, 2 * i, lane)
        store(inward, (i, narrow(pairs + p)), (pole + shift) * real - (pole_im + shift_im) * imaginary)
    for j in range(0, firsts, 8):
        store(inward, (i, narrow(2 * pairs + j)), pack(left, (2 * i, narrow(pairs + j))))


@part
def _fill_outward(t: Array, right: Array, i: int, pairs: int, firsts: int, outward: Array) -> None:
    """Fill what one of X takes from coordinates."""
    for p in range(pairs):
        s, nu = t[row.D, p] + t[row.SHIFT, p], t[row.D_IM, p] + t[row.SHIFT_IM, p]
        turned = 2.0 * right[2 * i + 1, p] / nu
        outward[p, i], outward[pairs + p, i] = 2.0 * right[2 * i, p] - s * turned, turned
    for j in range(firsts):
        outward[2 * pairs + j, i] = right[2 * i, pairs + j]


@part
def _fill_source(h: TwoWay, alpha: float, inward: Array, i: int, source: Array, lane: Lane) -> None:
    """Fill the sources of a pack of coordinates per input ``i``."""
    (modes, inputs), heats, total = h.force.shape, h.heat_tip.size, spread(0.0, lane)
    if i < h.mechanical or i >= inputs - 4:
        for m in range(modes):
            total = total + h.force[m, i] * pack(inward, (modes + m, lane))
    else:
        for j in range(heats):
            total = total + h.heating[j, i] * pack(inward, (2 * modes + j, lane))
    if h.inputs[i] != 0.0:
        for j in range(heats):
            total = total + alpha * h.inputs[i] * h.heat_tip[j] * pack(inward, (2 * modes + j, lane))
    store(source, (i, lane), total)
