"""The held regime with friction heat: its blocks are those of the structure's own matrix, at every α."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from test_event_driven_random import scene

from scenes import chain, heavy_chain
from workflow.models import Array, Rayleigh, Structure
from workflow.reduction import reduce_structure
from workflow.schemes._exact import held_regime
from workflow.schemes._exact.held_regime import HeldRegimes
from workflow.schemes._exact.layout import Layout
from workflow.schemes._exact.modal_system import analyse, state_space
from workflow.schemes._exact.regimes import linked
from workflow.schemes._exact.tables import block, first


def motion_of(regime: Layout) -> Array:
    """Return the matrix by which coordinates move, q' = G q."""
    blocks, size = regime.blocks, 2 * regime.blocks + regime.firsts
    moves = np.zeros((size, size))
    moves[:blocks, blocks : 2 * blocks] = np.eye(blocks)
    moves[blocks : 2 * blocks, :blocks] = -np.diag(regime.block[block.STIFFNESS, :blocks])
    moves[blocks : 2 * blocks, blocks : 2 * blocks] = -np.diag(regime.block[block.DAMPING, :blocks])
    moves[2 * blocks :, 2 * blocks :] = -np.diag(regime.first[first.RATE, : regime.firsts])
    return moves


def apart(structure: Structure, alpha: float, regime: Layout) -> tuple[float, float]:
    """Return how far coordinates are from invertible, and from what A makes of them, relative to the largest."""
    A, row, _ = state_space(linked(analyse(structure).held), alpha)
    size, blocks, moves = row.size, regime.blocks, motion_of(regime)
    inward, outward = regime.inward[:, :size], regime.outward
    inverse = np.abs(outward @ inward - np.eye(size)) / (np.abs(outward) @ np.abs(inward)).max()
    wrong = A @ outward.T - outward.T @ moves
    size_of = np.abs(A) @ np.abs(outward.T) + np.abs(outward.T) @ np.abs(moves)
    signal = np.concatenate([regime.block[block.SIGNAL_VALUE, :blocks], regime.block[block.SIGNAL_SLOPE, :blocks]])
    signal = np.append(signal, regime.first[first.SIGNAL, : regime.firsts])
    force = np.abs(outward @ row - signal) / (np.abs(outward) @ np.abs(row)).max()
    return float(inverse.max()), float(
        max((np.abs(wrong).max(1) / np.maximum(size_of.max(1), 1e-300)).max(), force.max())
    )


@pytest.mark.parametrize("alpha", [1e-6, 1.0, 50.0])
@pytest.mark.parametrize("reduced", [False, True])
def test_coordinates_are_those_of_the_matrix(alpha: float, reduced: bool) -> None:
    structure = reduce_structure(heavy_chain(), 3, 12).structure if reduced else heavy_chain()
    regime = HeldRegimes(analyse(structure).held).at(alpha, 0.0, heated=True)
    assert regime.blocks == structure.mechanical_size - 1
    inverse, wrong = apart(structure, alpha, regime)
    assert inverse < 1e-11  # rounding of velocities, 1e5 times the places
    assert wrong < 1e-12


def test_random_structures_either_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Strong friction heat of order one: where zeros do not come out distinct the general solver separates."""
    begun = []
    layout_of = held_regime.layout_of
    monkeypatch.setattr(held_regime, "layout_of", lambda *system: begun.append(system) or layout_of(*system))
    for seed in range(60):
        structure, case = scene(np.random.default_rng(seed))
        held = HeldRegimes(analyse(structure).held)
        if case.alpha[0] > 0 and held._heated is not None and structure.thermal_size > 1:
            inverse, wrong = apart(structure, 10 * case.alpha[0], held.at(10 * float(case.alpha[0]), 0.0, heated=True))
            assert inverse < 1e-9
            assert wrong < 1e-9
    assert begun


def test_a_regime_depends_on_its_own_alpha_alone() -> None:
    regimes = HeldRegimes(analyse(heavy_chain()).held)
    once, _, again = (regimes.at(alpha, 0.0, heated=True) for alpha in (50.0, 0.3, 50.0))
    for name in ("block", "first", "outward"):
        assert getattr(once, name).tobytes() == getattr(again, name).tobytes()
    size = once.outward.shape[0]
    assert once.inward[:, :size].tobytes() == again.inward[:, :size].tobytes()


def poles_held(structure: Structure, alpha: float) -> Array:
    """Return the poles of the held tip."""
    return np.linalg.eigvals(state_space(linked(analyse(structure).held), alpha)[0])


@pytest.mark.parametrize("dashpot", [0.0, 3.0])
@pytest.mark.parametrize("beside", [0.0, 1e-14, -1e-14, 1e-10, -1e-10, 1e-6, -1e-6, 1e-4, -1e-4, 1e-2, -1e-2])
def test_real_poles_that_meet_are_one_block(beside: float, dashpot: float) -> None:
    """A mode a little beyond critical damping: friction heat brings its two poles together."""
    heat = {"spacing": 1e-2, "expansion": 1e-4, "heat_capacity": 1e-3, "conductance": 1.0}
    structure = chain(nodes=3, mass=0.01, stiffness=1e5, damping=Rayleigh(2.1 * np.sqrt(1e7)), **heat)
    if dashpot:
        structure = replace(structure.matrices(), damper=np.diag([dashpot, 0.0, 0.0]))
    low, high = 1e-4, 10.0
    assert np.isreal(poles_held(structure, low)).sum() > np.isreal(poles_held(structure, high)).sum()
    for _ in range(60):
        middle = 0.5 * (low + high)
        meet = np.isreal(poles_held(structure, middle)).sum() < np.isreal(poles_held(structure, 1e-4)).sum()
        low, high = (low, middle) if meet else (middle, high)
    alpha = high * (1 + beside)
    regime = HeldRegimes(analyse(structure).held).at(alpha, 0.0, heated=True)
    A = state_space(linked(analyse(structure).held), alpha)[0]
    for t in (1e-5, 1e-4, 1e-3):
        exact = scipy.linalg.expm(A * t)
        ours = regime.outward.T @ scipy.linalg.expm(motion_of(regime) * t) @ regime.inward[:, : len(A)].T
        assert np.all(np.abs(ours - exact).max(1) <= 1e-10 * np.abs(exact).max(1))
