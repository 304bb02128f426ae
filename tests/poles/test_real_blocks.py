"""Real blocks make the matrix again that they separate, and where poles coincide that of a damping nearby."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
import scipy.linalg
from numpy.typing import NDArray

from workflow.poles import missed_share, real_blocks
from workflow.schemes._fixed.blocks import _in_blocks

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
    """The matrix in other coordinates."""
    form = scipy.linalg.block_diag(*MATRICES[name])
    basis = np.random.default_rng(0).normal(size=form.shape)
    return np.asarray(basis @ form @ np.linalg.inv(basis))


@pytest.mark.parametrize("name", list(MATRICES)[:2])
def test_blocks_make_the_matrix_again(name: str) -> None:
    assert missed_share(turned(name), real_blocks(turned(name))) < 1e-13


def test_three_poles_alike_are_separated_rightly_or_refused() -> None:
    """Their eigenvectors are independent with some of LAPACK's kernels, nearly dependent with others."""
    A = turned("three alike with eigenvectors of their own")
    with suppress(np.linalg.LinAlgError):
        assert missed_share(A, _in_blocks(A.copy(), A.shape[0] // 2)) < 3e-8


@pytest.mark.parametrize("name", list(MATRICES)[3:])
def test_poles_that_coincide_are_parted_by_a_hundred_millionth_of_damping(name: str) -> None:
    """Rounding alone parts them too little: their eigenvectors nearly depend on each other."""
    A = turned(name)
    assert missed_share(A, real_blocks(A)) > 1e-9
    assert missed_share(A, _in_blocks(A.copy(), A.shape[0] // 2)) < 3e-8
