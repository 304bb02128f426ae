"""Bodies that nothing holds, under fast loads: the matrix exponential in 50 digits."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from scenes import cases, chain, sampling, step
from workflow.schemes import Status


@pytest.mark.parametrize("amplitude", [0.0, 5.0])
@pytest.mark.parametrize("dashpot", [0.0, 1e-20, 1e-9, 1e-7, 1e-3, 1.0, 30.0])
@pytest.mark.parametrize("springs", [[0.0, 1e6, 1e6], [0.0, 0.0, 1e6]])
def test_dashpots_to_ground_from_none_to_strong(springs: list[float], dashpot: float, amplitude: float) -> None:
    """One rigid motion, and two, beside the matrix exponential of [x, v, sin, cos, 1]."""
    structure = replace(
        chain(nodes=3, mass=0.01, stiffness=springs).matrices(),
        damper=dashpot * np.array([[3.0, -1.0, 0.0], [-1.0, 1.5, 0.0], [0.0, 0.0, 0.5]]),
    )
    over, w = sampling(0.02, 1e-3), 2 * np.pi * 300
    case = cases(structure, gap=1.0, mean=1.0, amplitude=amplitude, frequency=300.0, velocity=[[0.1, 0.2, -0.3]])
    results = step(structure, case, 0.0, over, "event_driven")
    assert results.status[0] == Status.OK
    with mp.workdps(50):
        A = mp.zeros(9)
        for i in range(3):
            A[i, 3 + i] = 1
            for j in range(3):
                A[3 + i, j] = -mp.mpf(structure.stiffness_matrix[i, j]) / structure.mass[i, i]
                A[3 + i, 3 + j] = -mp.mpf(structure.damper[i, j]) / structure.mass[i, i]
        A[5, 6], A[5, 8] = mp.mpf(amplitude) / structure.mass[2, 2], mp.mpf(1) / structure.mass[2, 2]
        A[6, 7], A[7, 6] = w, -w
        state, turn = mp.matrix([0, 0, 0, 0.1, 0.2, -0.3, 0, 1, 1]), mp.expm(A * mp.mpf(over.times[1]))
        places, speeds = [0.0], [-0.3]
        for _ in over.times[1:]:
            state = turn * state
            places.append(float(state[2]))
            speeds.append(float(state[5]))
    for name, exact in (("displacement", places), ("velocity", speeds)):
        np.testing.assert_allclose(results.histories[name][0], exact, rtol=0, atol=1e-10 * np.abs(exact).max())
