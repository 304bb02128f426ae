"""The motion of a tip that stays free, or stays held: X' = A X + B w in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from workflow.kernels.algebra import Complex, Eigen, eigenvalues, eigenvectors
from workflow.models import Array
from workflow.schemes._exact.layout import Load
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space

_DEPENDENT = 1e8
"""Condition of eigenvectors above which propagators are no longer made of them: they would lose half the digits."""


@dataclass(frozen=True, eq=False)
class Linear:
    """A regime, free or held, in its own modes Z = [z, z', τ], and what makes it of X = [y, y', τ] of the free tip."""

    A: Array
    B: Array
    """Per w = [f̄, q, F, d, d', d'']."""
    signal: Array
    signal_inputs: Array
    """Signal, the gap or the contact force, per Z and w: see :class:`ModalSystem`."""
    entry: Array
    """Z per X, both relative to the casing."""
    exit: Array
    """X per Z …"""
    place: Array
    """… and per d and d' of the casing, ``(N, 2)``."""
    eigen: Eigen | None
    """Of A; ``None`` where eigenvectors nearly coincide."""

    def propagators(self, spans: Array) -> Array:
        """Return the derivatives of X by X before each of some spans [s], ``(span, N, N)``."""
        if self.eigen is None:
            inner = np.array([expm(self.A * span) for span in spans])
        else:
            values, right, left = self.eigen
            inner = ((right * np.exp(values * spans[:, None])[:, None, :]) @ left).real
        return np.asarray(self.exit @ inner @ self.entry)

    @property
    def poles(self) -> Complex:
        """Eigenvalues of A, 1/s."""
        return eigenvalues(self.A) if self.eigen is None else self.eigen.values

    @property
    def growth(self) -> float:
        """Their largest real part, 1/s."""
        return float(self.poles.real.max(initial=-np.inf))

    def steady(self, load: Load, t: float) -> tuple[Array, float]:
        """Return X and the signal of the motion that repeats with the loads, at t.

        Raises
        ------
        numpy.linalg.LinAlgError
            There is none: a pole is that of a load.
        """
        sources = [(0.0, np.concatenate([load.steady, load.heating, [load.mean, load.gap, 0.0, 0.0]]), 1.0 + 0.0j)]
        still = np.zeros(load.steady.size + load.heating.size)
        for omega, phase, force, casing in load.waves:
            rates = casing * np.array([1.0, 1j * omega, -(omega**2)])
            sources.append((omega, np.concatenate([still, [force], rates]), -1j * np.exp(1j * (omega * t + phase))))
        Z, w = np.zeros(self.A.shape[0]), np.zeros(still.size + 4)
        for omega, inputs, turn in sources:
            Z += (np.linalg.solve(1j * omega * np.eye(Z.size) - self.A, self.B @ inputs) * turn).real
            w += (inputs * turn).real
        X = self.exit @ Z + self.place @ w[-3:-1]
        return np.asarray(X), float(self.signal @ Z + self.signal_inputs @ w)


@lru_cache(maxsize=8)
def linear(system: ModalSystem, alpha: float) -> Linear:
    """Return a regime at α."""
    A, row, B = state_space(system, alpha)
    modes, heats, n = system.frequency.size, system.rate.size, system.entry.shape[0] - 1
    size = 2 * modes + heats
    entry, out, place = np.zeros((size, 2 * n + heats)), np.zeros((2 * n + heats, size)), np.zeros((2 * n + heats, 2))
    for k in range(2):
        mine, theirs = slice(k * modes, (k + 1) * modes), slice(k * n, (k + 1) * n)
        entry[mine, theirs], out[theirs, mine], place[theirs, k] = (
            system.entry[:-1].T,
            system.exit[:-1].T,
            system.exit[-1],
        )
    entry[2 * modes :, 2 * n :] = out[2 * n :, 2 * modes :] = np.eye(heats)
    return Linear(A, B, row, signal_inputs(system), entry, out, place, _separated(A))


def _separated(A: Array) -> Eigen | None:
    """Return eigenvalues and eigenvectors of A, ``None`` where those nearly coincide."""
    try:
        eigen = eigenvectors(A)
    except np.linalg.LinAlgError:
        return None
    rows = np.abs(eigen.right).max(axis=1, initial=0.0)
    condition = np.linalg.norm(eigen.right / rows[:, None]) * np.linalg.norm(eigen.left * rows)
    return eigen if condition < _DEPENDENT else None
