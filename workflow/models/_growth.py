"""Growth rate of a tip in permanent contact: the rightmost eigenvalue of the contact-closed system.

Of up to 300 states all eigenvalues are computed. Of more, the eigenvalues of a part of the modes are approximations,
and those that could be the rightmost are improved as roots of the characteristic function of the whole structure
(:mod:`workflow.models._characteristic`): what is returned is an eigenvalue of the structure itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import eigenvalues
from workflow.models._chain import Chain
from workflow.models._characteristic import Complexes, improve
from workflow.models._contact_closed import ContactClosed, contact_closed
from workflow.models._modes import magnitudes
from workflow.models._structure import Structure

_ALL_STATES = 300
"""States up to which all eigenvalues are computed."""

_STRONGEST = 60
"""Modes of each kind of a larger structure whose eigenvalues are computed together: those that contact heat moves
most. The eigenvalues of all others start where the first order in α puts them."""

_LOWEST_OF_A_LONG_CHAIN = 12
"""Lowest modes of each kind of a chain without matrices, each of which costs passes along it."""

_NEXT_TO_THE_TIP = 60
"""Nodes at the tip of such a chain whose own eigenvalues are tried as well: light ones answer to contact heat first."""

_IMPROVED, _IMPROVED_OF_A_LONG_CHAIN = 24, 6
"""Eigenvalues of largest real part that are improved at first; more, while the next one could lie further right."""

_UNCERTAIN = 1e-12
"""Uncertainty of an eigenvalue as a share of the largest."""

_WEAK = 1e-3
"""Share of a pole by which contact heat may move an eigenvalue at most, to first order, for the first order and a part
of the modes to tell which eigenvalues can be the rightmost; where it moves one further all are improved."""

_ALL_IMPROVED = 1500
"""States up to which that is done: all of 1200 take 0.03 to 0.7 s, with the square of their number."""

_CONVERGED = 1e-7
"""Share of an eigenvalue by which the last step of its improvement may change it: a tenth of what is promised."""

_ZERO = 1e-13
"""Share of the slowest pole below which an eigenvalue is 0: what rounding leaves of one that is, and α within 1e-13 of
α_c."""

_APART = 1e-9
"""Share by which real eigenvalues are moved off the real axis before they are improved: two of an approximate
system may be a complex pair of the whole structure, and real numbers stay real."""

_FIRST_ORDER = 0.1
"""Share of a pole by which the first order in α may move an eigenvalue to begin with."""


class Growth(NamedTuple):
    """Largest real part of the eigenvalues with the tip in permanent contact, and its uncertainty, 1/s."""

    rate: float
    uncertainty: float

    @property
    def is_positive(self) -> bool:
        """Whether it is positive by more than its uncertainty."""
        return self.rate > self.uncertainty


class _Trial(NamedTuple):
    """A part of a system whose eigenvalues are computed, and poles whose eigenvalues start at the first order in α.

    ``missing`` is what ds/dα at each pole of the part lacks of that of the whole system. ``is_all`` tells that the part
    is the system, so that its eigenvalues need no improvement to be right.
    """

    part: ContactClosed
    missing: Complexes
    others: Complexes
    first_orders: Complexes
    is_all: bool


@dataclass(frozen=True, eq=False)
class InContact:
    """What the growth rate of a structure is computed from, the same for every α.

    Attributes
    ----------
    system
        The contact-closed system whose characteristic function counts.
    trials
        Parts of the structure whose eigenvalues approximate those of the whole.
    sliding
        The system with what friction drives beside, where there is a direction of it.
    """

    system: ContactClosed
    trials: tuple[_Trial, ...]
    sliding: ContactClosed | None = None


def in_contact(structure: Structure) -> InContact:
    """Prepare the growth rates of a structure."""
    none = np.zeros(0, dtype=np.complex128)
    if isinstance(structure, Chain) and not structure.has_matrices:
        system = contact_closed(structure, _LOWEST_OF_A_LONG_CHAIN)
        tip = contact_closed(structure.last(_NEXT_TO_THE_TIP))
        return InContact(system, (_Trial(system, none, none, none, False), _Trial(tip, none, none, none, False)))
    system = contact_closed(structure)
    sliding = None if structure.tangent is None else contact_closed(structure, slides=True)
    if system.is_coupled or system.poles().size <= _ALL_STATES:
        return InContact(system, (_Trial(system, none, none, none, True),), sliding)
    return InContact(system, (_strongest(system),), sliding)


def _strongest(system: ContactClosed) -> _Trial:
    """Choose the modes that contact heat moves most, by ds/dα as a share of the pole."""
    poles, orders, modes = system.poles(), system.first_orders(), system.modes.shape[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(magnitudes(orders) / magnitudes(poles), posinf=np.inf)
    of_modes, of_heats = share[: 2 * modes].reshape(modes, 2).max(axis=1), share[2 * modes :]
    chosen = np.sort(np.argsort(-of_modes, kind="stable")[:_STRONGEST])
    heats = np.sort(np.argsort(-of_heats, kind="stable")[:_STRONGEST])
    others = np.ones(poles.size, dtype=bool)
    others[np.concatenate([2 * chosen, 2 * chosen + 1, 2 * modes + heats])] = False
    part = system.part(chosen, heats)
    return _Trial(part, orders[~others] - part.first_orders(), poles[others], orders[others], False)


def growth(prepared: InContact, alpha: float, friction: float = 0.0) -> Growth:
    """Return the largest real part of the eigenvalues of the contact-closed system, 1/s; negative: all decays.

    With friction along the structure's tangent all eigenvalues are computed, and none is improved.

    NaN where the improvement of an eigenvalue that could be the rightmost came to no end. Of chains without matrices
    it is the rightmost eigenvalue among those that its 12 lowest modes and its last 60 nodes lead to.
    """
    system = prepared.system
    if friction != 0 and prepared.sliding is not None:
        return _of_all(prepared.sliding, alpha, friction)
    if system.is_coupled:
        return _of_all(system, alpha)
    rigid = 0.0 if system.has_rigid else -np.inf
    if alpha == 0.0:
        poles = system.poles()
        return Growth(max(float(poles.real.max()), rigid) + 0.0, _UNCERTAIN * float(magnitudes(poles).max()))
    alone = len(prepared.trials) == 1
    outcomes = [_rightmost(system, trial, alpha, alone) for trial in prepared.trials]
    rate, last, _ = max(outcomes, key=lambda one: -np.inf if np.isnan(one[0]) else one[0])
    largest = max(largest for _, _, largest in outcomes)
    return Growth(rate if np.isnan(rate) else max(rate, rigid), max(_UNCERTAIN * largest, last))


def _of_all(system: ContactClosed, alpha: float, friction: float = 0.0) -> Growth:
    """Return the growth rate where damping or friction couples the modes, from all eigenvalues, not improved."""
    spectrum = eigenvalues(system.matrix(alpha, friction))
    largest = float(magnitudes(spectrum).max(initial=0.0))
    rate = max(float(spectrum.real.max(initial=-np.inf)), 0.0 if system.has_rigid else -np.inf)
    return Growth(rate, _UNCERTAIN * largest)


def _rightmost(system: ContactClosed, trial: _Trial, alpha: float, alone: bool) -> tuple[float, float, float]:
    """Return the largest real part, its last change and the largest |eigenvalue| of what a trial leads to.

    NaN where it did not converge; where the trial is not ``alone``, where none did.
    """
    approximate, reach, is_exact = _approximate(trial, alpha)
    poles = np.concatenate([trial.part.poles(), trial.others])
    largest = float(max(magnitudes(approximate).max(), magnitudes(poles).max()))
    count = min(_IMPROVED if alone else _IMPROVED_OF_A_LONG_CHAIN, approximate.size)
    if trial.missing.size and poles.size <= _ALL_IMPROVED and not _is_weak(trial, alpha):
        count = approximate.size
    while True:
        roots, left = _improved(system, alpha, poles, approximate, count)
        converged = left <= np.maximum(_CONVERGED * magnitudes(roots), _UNCERTAIN * largest)
        values = np.where(converged, roots.real, approximate[:count].real if alone else -np.inf)
        best = int(np.argmax(values))
        if count == approximate.size or values[best] >= reach[count]:
            break
        count = min(2 * count, approximate.size)
    if not converged[best]:
        return (float(values[best]) if is_exact else np.nan), 0.0, largest
    scale = magnitudes(poles)
    is_zero = abs(values[best]) <= _ZERO * scale[scale > 0].min(initial=largest)
    return 0.0 if is_zero else float(values[best]), float(left[best]), largest


def _is_weak(trial: _Trial, alpha: float) -> bool:
    """Tell whether contact heat hardly moves what a trial knows to first order only."""
    poles = np.concatenate([trial.part.poles(), trial.others])
    moved = alpha * magnitudes(np.concatenate([trial.missing, trial.first_orders]))
    return bool(np.all(moved <= _WEAK * magnitudes(poles)))


def _approximate(trial: _Trial, alpha: float) -> tuple[Complexes, Array, bool]:
    """Return the eigenvalues that a trial starts from, how far to the right each may lie, and whether they are exact.

    The one that may lie furthest comes first. Where the eigenvalue solver does not converge all start at first order.
    An eigenvalue of the part may lie further right by what the part lacks, to first order at the pole nearest to it.
    """
    others, is_exact = _first_order(trial.others, trial.first_orders, alpha), trial.is_all
    try:
        computed = eigenvalues(trial.part.matrix(alpha))
        reach = computed.real
        if trial.missing.size:
            poles = trial.part.poles()
            nearest = np.argmin(magnitudes(computed[:, None] - poles), axis=1)
            reach = reach + magnitudes(_limited(alpha * trial.missing, poles)[nearest])
    except np.linalg.LinAlgError:
        computed, reach = _first_order(trial.part.poles(), trial.part.first_orders(), alpha)
        is_exact = False
    approximate, reach = np.concatenate([computed, others[0]]), np.concatenate([reach, others[1]])
    order = np.argsort(-reach, kind="stable")
    return approximate[order], reach[order], is_exact


def _first_order(poles: Complexes, orders: Complexes, alpha: float) -> tuple[Complexes, Array]:
    """Return where the first order in α puts the eigenvalues of some poles, and how far to the right they may lie."""
    step = _limited(alpha * orders, poles)
    approximate = poles + step
    return approximate, approximate.real + magnitudes(step)


def _limited(steps: Complexes, poles: Complexes) -> Complexes:
    """Return steps from poles that are at most a share of the pole long."""
    size, most = magnitudes(steps), _FIRST_ORDER * magnitudes(poles)
    return np.asarray(steps * np.divide(most, size, out=np.ones_like(size), where=size > most))


def _improved(
    system: ContactClosed, alpha: float, poles: Complexes, approximate: Complexes, count: int
) -> tuple[Complexes, Array]:
    """Return the first ``count`` approximate eigenvalues improved on the whole structure, and the last step of each."""
    roots = approximate.copy()
    real = np.flatnonzero(approximate.imag == 0)
    roots.imag[real] = _APART * magnitudes(approximate[real]) * np.where(real % 2, 1.0, -1.0)
    is_chain = system.lumps.shape[1] > 0
    arrays = (system.lumps,) * 3 if is_chain else (system.modes, system.heat, system.coupling)
    damping = (system.mass_damping, system.stiffness_damping)
    left = np.empty(count)
    improve(alpha, arrays, is_chain, damping, poles, roots, left)
    return roots[:count], left


def growth_rate(structure: Structure, alpha: float, friction: float = 0.0) -> float:
    """Return the growth rate of a structure at ``alpha``, 1/s, see :func:`growth`."""
    return growth(in_contact(structure), alpha, friction).rate
