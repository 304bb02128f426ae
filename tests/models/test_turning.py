"""What is made of matrices at several speeds and of nodes at the tip of a blade that turns."""

import warnings

import numpy as np
import pytest
from scipy import sparse

from scenes import of_entries
from workflow import casing_contacts, matrices_at_speeds

K0 = np.array([[4.0, -1.0], [-1.0, 3.0]])
TURNING = np.array([[0.5, 0.1], [0.1, -0.2]])


@pytest.mark.parametrize("form", [np.asarray, sparse.csr_array, sparse.csc_matrix])
@pytest.mark.parametrize("slowest", [0.0, 0.5])
def test_two_speeds_give_the_part_that_grows_with_their_squares(form: type, slowest: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = matrices_at_speeds({2.0: form(K0 + 4 * TURNING), slowest: form(K0 + slowest**2 * TURNING)})
    assert np.allclose(np.asarray(found.todense() if sparse.issparse(found) else found), TURNING, rtol=1e-14)


def test_more_speeds_are_fitted_and_the_remainder_is_said() -> None:
    """K at 1 rad/s lies off by 0.3 of which (1 0.3)/(1 + 16) is taken; loads are vectors."""
    at = {0: K0, 1: K0 + TURNING + 0.3, 2: K0 + 4 * TURNING}
    with pytest.warns(UserWarning, match=r"leaves 0\.14 of the change up to 2 rad/s unexplained, most at 1 rad/s"):
        found = matrices_at_speeds(at)
    assert np.allclose(found, TURNING + 0.3 / 17, rtol=1e-12)
    with pytest.warns(UserWarning, match="leaves 0 of the change"):
        assert np.array_equal(matrices_at_speeds({k: k * k * np.array([1.0, 2.0]) for k in range(3)}), [1.0, 2.0])


@pytest.mark.parametrize("at", [{0: K0}, {0: K0, 1: K0[:1]}])
def test_speeds_that_give_no_part_are_refused(at: dict) -> None:
    with pytest.raises(ValueError, match=r"one shape at two speeds or more, as \{0: K0"):
        matrices_at_speeds(at)


@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_nodes_of_a_tip_touch_their_casing_outwards(turns: float) -> None:
    """Two nodes on a radius of 1 m, 30 degrees apart about z: seen from +z the blade turns against the clock."""
    angle = np.radians([90.0, 120.0])
    places = np.column_stack([0.2 + np.cos(angle), 0.1 + np.sin(angle), [5.0, 7.0]])
    found = casing_contacts(places, [[0, 1, 2], [3, 4, 5]], 7, axis=(0, 0, 3 * turns), origin=(0.2, 0.1, -4.0))
    assert np.allclose(found["contact"][0], [0, 1, 0, 0, 0, 0, 0], atol=1e-15)
    assert np.allclose(found["tangent"][0], [turns, 0, 0, 0, 0, 0, 0], atol=1e-15)  # the blade moves to -x
    assert np.allclose(found["contact"][1, 3:], [-0.5, np.sqrt(0.75), 0, 0])
    assert np.allclose(found["tangent"][1, 3:], turns * np.array([np.sqrt(0.75), 0.5, 0, 0]))
    assert np.allclose(found["angle"], [0.0, turns * np.radians(30.0)])
    contacts = of_entries({"mass": np.eye(7), "stiffness": np.eye(7), **found}).contacts
    assert np.allclose(contacts.angle, found["angle"])
