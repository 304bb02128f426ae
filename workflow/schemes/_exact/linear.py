"""The linear motion of a tip that stays free or held, X' = A X + B w: propagators and steady response."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import block_diag

from workflow.kernels import Array
from workflow.schemes._exact.layout import Case, Regime
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._exact.tables import block, first


def growth(regime: Regime) -> float:
    """Return the largest real part of the poles of a regime, 1/s."""
    half, w2 = 0.5 * regime.block[block.DAMPING, : regime.blocks], regime.block[block.STIFFNESS, : regime.blocks]
    poles = np.append((np.sqrt(half**2 - w2 + 0j) - half).real, -regime.first[first.RATE, : regime.firsts])
    return float(poles.max(initial=-np.inf))


def propagators(regime: Regime, spans: Array) -> Array:
    """Return the propagators of X, of the free tip, over each of some spans [s], ``(span, N, N)``."""
    n, t = regime.blocks, spans[:, None]
    half, w2 = 0.5 * regime.block[block.DAMPING, :n], regime.block[block.STIFFNESS, :n]
    root = np.sqrt(half**2 - w2 + 0j)
    z, one, other = root * t, np.exp((root - half) * t), np.exp((-root - half) * t)
    near = np.abs(z) < 1  # sinh(z)/z is sinc(iz/π)
    still = t * np.exp(-half * t) * np.sinc(np.where(near, z, 0) * (1j / np.pi))
    S = np.where(near, still, (one - other) / np.where(near, 1.0, 2 * root)).real[:, None]
    C = ((one + other) / 2).real[:, None]
    eta, u, xi = np.split(regime.inward[:, : len(regime.inward)], [n, 2 * n], axis=1)
    decay = np.exp(-regime.first[first.RATE, : regime.firsts] * t)[:, None]
    moved = [eta * (C + half * S) + u * S, u * (C - half * S) - eta * (w2 * S), xi * decay]
    inner = np.concatenate(moved, axis=2) @ regime.outward
    heats = len(regime.inward) - 2 * regime.entry.shape[1]
    changes = _twice(regime.entry, heats) @ inner @ _twice(regime.exit, heats)
    return np.asarray(changes.swapaxes(1, 2))


@dataclass(frozen=True, eq=False)
class Linear:
    """A regime, free or held, in its modes Z = [z, z', τ], and the transform to X = [y, y', τ] of the free tip."""

    A: Array
    B: Array
    """Z' per w = [f̄, q, F, d, d', d'']."""
    signal: Array
    signal_inputs: Array
    """Signal, the gap or the contact force, per Z and w: see :class:`ModalSystem`."""
    exit: Array
    """X per Z …"""
    place: Array
    """… and per d and d' of the casing, ``(N, 2)``."""

    def steady(self, case: Case, t: float) -> tuple[Array, float]:
        """Return X and the signal of the steady response to the loads at t.

        Raises
        ------
        numpy.linalg.LinAlgError
            There is none: a pole is that of a load.
        """
        sources = [(0.0, np.concatenate([case.steady, case.heating, [case.mean, case.gap, 0.0, 0.0]]), 1.0 + 0.0j)]
        still = np.zeros(case.steady.size + case.heating.size)
        for omega, phase, force, casing in case.waves:
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
    heats, n = system.rate.size, system.entry.shape[0] - 1
    place = np.zeros((2 * n + heats, 2))
    place[:n, 0] = place[n : 2 * n, 1] = system.exit[-1]
    return Linear(A, B, row, signal_inputs(system), _twice(system.exit, heats).T, place)


def _twice(rows: Array, heats: int) -> Array:
    """Return the transform of displacements, velocities and temperatures, by rows of modes and one of the gap."""
    return np.asarray(block_diag(rows[:-1], rows[:-1], np.eye(heats)))
