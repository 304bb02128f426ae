"""Values of coordinates are printed so that they select what they name."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from workflow.analysis import exact, labels_of


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_a_printed_number_is_the_number(value: float) -> None:
    """Up to the rounding of a sum: an opened archive finds it, and nobody reads 3.0000000000000004."""
    assert float(exact(value)) == pytest.approx(value, rel=1.01e-14, abs=0)
    assert exact(np.float64(value)) == exact(value)


@pytest.mark.parametrize(
    ("value", "text"), [(0.1 * 3 + 2.7, "3"), (1.1 * 3, "3.3"), (-0.1 - 0.2, "-0.3"), (1e-6 * 3, "3e-06")]
)
def test_rounding_of_a_sum_is_not_printed(value: float, text: str) -> None:
    assert exact(value) == text


def test_numbers_are_as_short_as_they_can_be() -> None:
    values = [1e-6, 3.16227766017e-05, 1e-4, 0.5, 30.0, 1e9]
    assert [exact(value) for value in values] == ["1e-06", "3.16227766017e-05", "0.0001", "0.5", "30", "1e+09"]
    assert exact(np.int64(3)) == "3"
    assert exact("moreau") == "moreau"


def test_pictures_round_to_digits_that_tell_values_apart() -> None:
    alike = [1.00001e-5, 1.00002e-5], ["1.00001e-05 s", "1.00002e-05 s"]
    for values, texts in (([3.16227766017e-05], ["3.162e-05 s"]), alike):
        dataset = xr.Dataset(coords={"h": ("h", values, {"units": "s"})})
        assert labels_of(dataset, "h", named=False, rounded=True) == texts
        assert labels_of(dataset, "h", rounded=True) == [f"h {text}" for text in texts]
