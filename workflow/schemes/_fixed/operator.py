"""What the schemes with a fixed step share: the operator of a batch, its run, and the status and messages of its cases.

A scheme is a :class:`Method`, the θ-method or central differences, with a contact law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, ContactBasis, Structure, analyse_contacts, needs_matrices
from workflow.schemes._fixed.blocks import ROUNDING, Blocks, Step, separate
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.loads import Start, start_of
from workflow.schemes._fixed.march import step_batch
from workflow.schemes._fixed.step_limits import limit_text
from workflow.schemes._fixed.stepping import collect
from workflow.schemes._fixed.unsolved import explained
from workflow.schemes._interface import Results, Sampling, Status, merge

Outcome = tuple[NDArray[np.int8], dict[int, str]]
"""Status of each case, and the message of each that is not ok."""


class Method(Protocol):
    """How a scheme steps the modes of a structure."""

    @property
    def limit_is(self) -> str:
        """The beginning of a sentence that ends with the largest stable step."""
        ...

    def step(self, modal: ContactBasis, h: float) -> Step:
        """Return the coefficients of the step."""
        ...

    def first_velocity(self, modal: ContactBasis, h: float, cases: Cases, begins: Start, force: Array) -> Array:
        """Return the velocity of the modes with which the march begins, ``(case, mode)``.

        ``force`` is that of the contacts' springs at t = 0, N, ``(case, contact)``.
        """
        ...

    def amplification(self, frequency: Array, damping: Array, h: float) -> Any:
        """Return the eigenvalues of the free step of each mode."""
        ...

    def decay(self, h: float, rate: Array) -> Array:
        """Return the factor of the free step of each thermal mode."""
        ...

    def largest_stable_step(self, frequency: Array, damping: Array, rate: Array) -> float:
        """Return the step up to which no free mode grows, s."""
        ...


@dataclass(frozen=True, eq=False)
class Operator:
    """Common data of a batch: structure, step h [s], method, the structure in blocks, and its contact."""

    structure: Structure
    h: float
    method: Method
    blocks: Blocks
    contact: Contact

    def run(self, cases: Cases, sampling: Sampling, heated: bool) -> Results:
        """Step cases that all carry thermal states, or that all carry none."""
        h, contact, blocks = self.h, self.contact, self.blocks if heated else self.blocks.without_heat()
        flexibility = 1 / contact.stiffness if contact.stiffness > 0 else 0.0
        drive, begins = start_of(self.structure, cases, h, blocks.step.theta, sampling.duration, flexibility)
        # a contact without mass starts in balance with its spring alone
        speed = np.zeros_like(begins.speed) if self.structure.contacts.is_compliant else begins.speed
        force = contact.force(begins.displacement - begins.gap, speed)
        velocity = self.method.first_velocity(blocks.modal, h, cases, begins, force)
        ended = step_batch(self.structure, blocks, contact, cases, velocity, force, sampling, drive, begins)
        # squared: the state of a growing contact may be finite where its energy is not
        last = [ended.watched.contact[name] for name in ("displacement", "velocity", "temperature", "impulse")]
        finite = np.asarray(np.isfinite(np.square(last)).all(axis=(0, 1)))
        explain = explained(self, cases.alpha, cases.friction, sampling.duration, ended.unsolved)
        return collect(ended, *self._judged(blocks, finite, ended.ambiguous, explain))

    def _judged(
        self, blocks: Blocks, finite: NDArray[np.bool_], ambiguous: NDArray[np.bool_], explain: Callable[[int], str]
    ) -> Outcome:
        """Return status and message of each case."""
        modal, h, free, grown = blocks.modal, self.h, blocks.spectral_radius, None
        if blocks.outward is None:
            free = float(np.abs(self.method.amplification(modal.frequency, modal.damping, h)).max(initial=0.0))
        heat = float(np.abs(blocks.step.decay).max(initial=0.0))
        if max(free, heat) > 1 + ROUNDING:
            what = f"{'free step' if free >= heat else 'explicit heat step'} grows {max(free, heat):.6g}-fold"
            limit = limit_text(self.method.largest_stable_step(modal.frequency, modal.damping, modal.rate), 7)
            remedy = f"{self.method.limit_is} {limit} s" if modal.damping_matrix is None else "take a smaller step"
            grown = f"the {what} at h = {h:.6g} s; {remedy}"
        left = f"the state left the finite numbers at h = {h:.6g} s"
        return judged(finite, ambiguous & (grown is None), explain, grown, left)


def init(structure: Structure, h: float, method: Method, contact: Contact) -> Operator:
    """Separate a structure into blocks, once for a batch."""
    modal = analyse_contacts(structure)
    return Operator(structure, h, method, separate(modal, method.step(modal, h)), contact)


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    heated = cases.heated
    groups = [(np.flatnonzero(heated), True), (np.flatnonzero(~heated), False)]
    with np.errstate(over="ignore", invalid="ignore"):  # the status reports a case that is not finite
        return merge([(which, operator.run(cases.take(which), sampling, hot)) for which, hot in groups if which.size])


def operator_name(structure: Structure) -> str:
    """Return the coordinates in which a structure is stepped, as ``plan`` prints them."""
    coupled = ", coupled by damping or by where the load acts" if needs_matrices(structure) else ""
    sizes = f"{structure.mechanical_size} mechanical + {structure.thermal_size} thermal coordinates"
    return f"{sizes}, those of the contact among them{coupled}"


def amplification(frequency: Array, damping: Array, h: float, options: Any) -> Any:
    """Return the eigenvalues of the free step of each mode by the method of a scheme's options."""
    return options.method.amplification(frequency, damping, h)


def thermal_amplification(rate: Array, h: float, options: Any) -> Array:
    """Return the factor of the free step of each thermal mode by the method of a scheme's options."""
    factor: Array = options.method.decay(h, rate)
    return factor


def judged(
    finite: NDArray[np.bool_], ill_posed: NDArray[np.bool_], explain: Callable[[int], str], grown: str | None, left: str
) -> Outcome:
    """Return status and message of each case: by theory where there is one, else by whether its last state is finite.

    Parameters
    ----------
    finite, ill_posed
        Whether a case ended with finite numbers; whether its contact has no unique solution, ``(case,)``.
    explain
        ``explain(case)``: message of an ill-posed case that is not finite.
    grown
        Message of all others where the free step is unstable, ``None`` where it is stable.
    left
        Message of cases that are not finite for neither reason.
    """
    lost = ill_posed & ~finite
    status = np.where(lost, Status.ILL_POSED, np.where(finite & (grown is None), Status.OK, Status.DIVERGED))
    ended = map(int, np.flatnonzero(status != Status.OK))
    return status.astype(np.int8), {case: explain(case) if lost[case] else grown or left for case in ended}
