"""Real blocks make the matrix again that they separate, and its exponential, where poles coincide too."""

from itertools import permutations

import mpmath
import numpy as np
import pytest
import scipy.linalg
from numpy.typing import NDArray

from workflow import poles
from workflow.poles import RealBlocks, real_blocks, relative_residual

Array = NDArray[np.float64]


def chained(pole: complex, count: int) -> Array:
    """A matrix with one pole, or one pair, so many times, and one eigenvector of it."""
    one = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]]) if pole.imag else np.array([[pole.real]])
    return np.kron(np.eye(count), one) + np.kron(np.diag(np.ones(count - 1), 1), np.eye(one.shape[0]))


MATRICES = {
    "apart": [chained(-1, 1), chained(-0.1 + 2j, 1), chained(-3, 1)],
    "two real ones coincide": [chained(-1, 2), chained(-0.1 + 2j, 1)],
    "three alike with eigenvectors of their own": [chained(-1, 1)] * 3 + [chained(-0.1 + 2j, 1)],
    "three coincide": [chained(-1, 3), chained(-0.1 + 2j, 1)],
    "two pairs coincide": [chained(-0.1 + 2j, 2)],
}


def turned(name: str) -> Array:
    form = scipy.linalg.block_diag(*MATRICES[name])
    basis = np.random.default_rng(0).normal(size=form.shape)
    return np.asarray(basis @ form @ np.linalg.inv(basis))


@pytest.mark.parametrize("name", list(MATRICES)[:3])
def test_blocks_make_the_matrix_again(name: str) -> None:
    assert relative_residual(turned(name), real_blocks(turned(name))) < 1e-12


@pytest.mark.parametrize(("name", "parting"), [("three coincide", 1e-8), ("two pairs coincide", 1e-11)])
def test_one_eigenvector_of_several_poles_is_parted(name: str, parting: float) -> None:
    """A small change of the matrix gives each its own."""
    assert relative_residual(turned(name), real_blocks(turned(name), 0.1, parting)) < 100 * max(parting, 1e-9)


CLUSTERS: dict[str, list[tuple[complex, int]]] = {
    "three real ones": [(-1, 1)] * 3 + [(-0.1 + 2j, 1)],
    "four real ones": [(-1, 1)] * 4 + [(-3, 1)],
    "three pairs": [(-0.1 + 2j, 1)] * 3 + [(-1, 1)],
    "a double one beside others": [(-1, 2), (-1, 1), (-1, 1), (-0.1 + 2j, 1)],
    "two double ones": [(-1, 2), (-1, 2), (-0.1 + 2j, 1)],
    "two double ones beside others": [(-1, 2), (-1, 2), (-1, 1), (-1, 1)],
    "zeros": [(0, 1)] * 3 + [(-1, 1), (-0.1 + 2j, 1)],
}
"""Poles, each with the number of times that it has one eigenvector."""


def exponential(blocks: RealBlocks, t: float) -> Array:
    """Return exp(A t) by the blocks of A."""
    n, still = blocks.damping.size, np.zeros(blocks.inward.shape)
    still[:n, n : 2 * n], still[n : 2 * n, :n] = np.eye(n), -np.diag(blocks.stiffness)
    still[n : 2 * n, n : 2 * n], still[2 * n :, 2 * n :] = -np.diag(blocks.damping), -np.diag(blocks.rate)
    return np.asarray(blocks.outward @ scipy.linalg.expm(still * t) @ blocks.inward)


@pytest.mark.parametrize("apart", [0.0, 1e-15, 1e-13, 1e-11, 1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("name", CLUSTERS)
def test_clusters_of_poles_have_the_exponential_of_the_matrix(name: str, apart: float) -> None:
    """Members are ``apart``, relatively; where that is √ε half of the digits go, as poles of one eigenvector part."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        parts = [chained(pole * (1 + apart * k), count) for k, (pole, count) in enumerate(CLUSTERS[name])]
        form = scipy.linalg.block_diag(*parts)
        basis = np.linalg.qr(rng.normal(size=form.shape))[0] + 0.2 * rng.normal(size=form.shape)
        A = 10.0 ** rng.integers(-3, 6) * basis @ form @ np.linalg.inv(basis)
        t = 2.0 / np.abs(np.linalg.eigvals(A)).max()
        assert np.abs(exponential(real_blocks(A), t) - scipy.linalg.expm(A * t)).max() < 1e-7


@pytest.mark.parametrize("apart", [0.0, 1e-12])
def test_a_propagated_state_shows_a_wrong_separation(apart: float) -> None:
    """By eigenvectors alone poles that repeat are separated wrongly; those that pass have the exponential."""
    T, wrong, form = 2e-3, 0, -np.diag(1 + apart * np.arange(4)) + np.diag([1.0, 0.0, 0.0], 1)
    for seed in range(10):
        basis = np.random.default_rng(seed).normal(size=(4, 4))
        A = 1e3 * basis @ form @ np.linalg.inv(basis)
        try:
            blocks = poles._beside_rigid_motions(A, poles._by_eigenvectors)
        except np.linalg.LinAlgError:
            continue
        if poles.propagated_error(A, blocks, T) > 1e-7:
            wrong += 1
            continue
        moved = scipy.linalg.expm(A * T)
        assert exponential(blocks, T) == pytest.approx(moved, abs=1e-6 * np.abs(moved).max())
    assert wrong


def poles_of(A: Array) -> NDArray[np.complex128]:
    """Return the poles of the blocks of a matrix, of a pair the upper one."""
    blocks = real_blocks(A)
    half = blocks.damping / 2
    return np.concatenate([-half + np.sqrt(half**2 - blocks.stiffness + 0j), -blocks.rate])


def test_a_slow_pole_beside_fast_ones_has_its_own_accuracy() -> None:
    """Heat of a second, driven by vibrations of ten microseconds, which it drives."""
    A = np.zeros((5, 5))
    A[0, 2] = A[1, 3] = 1.0
    A[2], A[3], A[4] = [-4e9, 1e9, -20.0, 1.0, 3e4], [1e9, -9e9, 1.0, -50.0, 1e4], [7e3, 5e3, 0.0, 0.0, -0.3]
    with mpmath.workdps(40):
        exact = np.array([complex(s) for s in mpmath.eig(mpmath.matrix(A.tolist()), left=False, right=False)])
    for order in permutations(range(5)):  # which coordinate comes first is no matter
        B = A[np.ix_(order, order)]
        found, blocks = poles_of(B), real_blocks(B)
        assert (np.abs(found[:, None] - exact).min(1) / np.abs(found)).max() < 1e-14
        rate, right, left = blocks.rate[0], blocks.outward[:, -1], blocks.inward[-1]
        assert np.all(np.abs(B @ right + rate * right) < 1e-13 * (np.abs(B) @ np.abs(right)))
        assert np.all(np.abs(left @ B + rate * left) < 1e-13 * (np.abs(left) @ np.abs(B)))


@pytest.mark.parametrize("drag", [0.0, 1e-20, 1e-9, 1e-3, 30.0])
def test_rigid_motions_drift_without_a_constant(drag: float) -> None:
    """Two of them, dragged together with a vibration: X = [y, z, y', z']."""
    damping = drag * np.array([[3.0, -1.0, 0.4], [-1.0, 1.5, 0.2], [0.4, 0.2, 0.5]])
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.diag([0.0, 0.0, 1e8]), -damping]])
    blocks = real_blocks(A)
    assert blocks.stiffness[:2].tolist() == [0.0, 0.0]
    assert relative_residual(A, blocks) < 1e-15
    assert np.sum(np.abs(blocks.inward) * np.abs(blocks.outward.T), 1).max() < 2.0


def test_a_badly_scaled_matrix() -> None:
    """A chain of soft heat and stiff springs whose reaction at one end warms it: eleven decades of eigenvalues."""
    n, k, m, c = 20, 2e7, 2.5e-3, 1.3
    line = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    a = np.zeros((3 * n, 3 * n))
    x, v, heat = slice(0, n), slice(n, 2 * n), slice(2 * n, None)
    a[x, v], a[v, x], a[v, v] = np.eye(n), -k / m * line, -10 * np.eye(n) - 2e-7 * k / m * line
    a[v, heat], a[heat, heat] = -k * 2e-8 / m * (np.eye(n) - np.eye(n, k=1)), -0.6 / c * line
    a[-1, n - 1] = 0.3 * k / c
    blocks = real_blocks(a)
    assert relative_residual(a, blocks) < 1e-14
    assert np.abs(blocks.inward @ blocks.outward - np.eye(60)).max() < 1e-10  # velocities are 1e5 times places


@pytest.mark.parametrize("seed", range(20))
def test_random_matrices(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n := int(rng.integers(1, 15)), n))
    blocks = real_blocks(A)
    assert 2 * blocks.damping.size + blocks.rate.size == n
    assert np.all(np.diff(blocks.stiffness) >= 0.0)
    assert relative_residual(A, blocks) < 1e-12
