"""Speed against error: observed orders, limits, and who is fastest, on lines whose answer is known."""

import numpy as np
import pytest
import xarray as xr

from errors_over_steps import H as LONG
from errors_over_steps import over_steps
from workflow.analysis import hidden, lines, observed_order
from workflow.report._sections import _limit

H = np.logspace(-6, -3, 7)


def test_errors_as_large_as_the_solution_are_of_no_order() -> None:
    error = np.minimum(5e4 * LONG, 1.0)
    assert observed_order(over_steps({"one": error}), "impulse_error")["order"].item() == pytest.approx(1.0)


def test_the_scatter_of_an_order_is_that_of_the_points_about_the_line() -> None:
    """Points a factor 2 above and below a line of slope 1, which mirror each other and leave the slope as it is."""
    about = np.array([1.0, 2.0, 0.5, 0.5, 1.0, 0.5, 0.5, 2.0, 1.0])
    expected = np.sqrt(np.mean((np.log10(about) - np.log10(about).mean()) ** 2))
    (line,) = lines(over_steps({"one": 10 * LONG * about}))
    assert line.orders["impulse_error"] == pytest.approx((1.0, expected))


def test_limits_of_stability() -> None:
    lost, stable = lines(over_steps({"lost": LONG, "stable": LONG}, {"lost": LONG < 1e-4}))
    assert (_limit(lost), _limit(stable)) == (f"{10**-4.5:.6g}", "every h")


def test_a_scheme_without_contact_is_not_exact() -> None:
    """Where the tip stays clear no scheme errs in the impulse."""
    dataset = over_steps({"one": 0 * LONG})
    (exact,), (clear,) = lines(dataset), lines(dataset.assign(displacement_error=dataset["impulse_error"] + 0.05))
    assert exact.exact
    assert not clear.exact


def study(e_matters: float) -> xr.Dataset:
    """Two schemes, three steps, e and alpha; errors h for ``rough`` and 0 for ``exact``."""
    h, e, alpha = np.array([1e-4, 1e-3, 1e-2]), np.array([0.0, 0.5, 0.9]), np.array([0.0, 1.0])
    dims, shape = ("scheme", "h", "e", "alpha"), (2, 3, 3, 2)
    error = np.zeros(shape)
    error[0] = h[:, None, None]
    impulse = np.broadcast_to(1 + e_matters * e[:, None] + 0.5 * alpha, shape) * (1 + error)
    names = ("impulse_error", "temperature_error", "displacement_error")
    return xr.Dataset(
        {
            "status": (dims, np.zeros(shape, dtype=np.int8)),
            "contact_impulse": (dims, impulse),
            "max_temperature": (dims, np.zeros(shape)),
            **dict.fromkeys(names, (dims, error)),
            "processor_time": (dims, np.broadcast_to(1e-3 / h[:, None, None], shape)),
            "max_penetration": (dims, error),
            "predictability": (dims, np.full(shape, 1e-13)),
        },
        coords={"scheme": ["rough", "exact"], "h": h, "e": e, "alpha": alpha},
        attrs={"duration": 2.0},
    )


def test_an_axis_below_the_error_is_named() -> None:
    effects = [one for one in hidden(study(1.5e-3)) if one.metric == "contact_impulse"]
    assert [one.dim for one in effects] == ["e"]
    assert effects[0].effect == pytest.approx(0.9 * 1.5e-3 / (1.5 + 0.9 * 1.5e-3))
    assert effects[0].within == {"rough": "h = 0.001 s and more"}
    nothing = [one for one in hidden(study(0.0)) if one.metric == "contact_impulse"]
    assert nothing[0].effect == 0.0
    assert nothing[0].within == {"rough": "every h"}


def test_cases_that_diverged_hide_no_axis() -> None:
    dataset = study(0.5)
    dataset["status"][0, 1:] = 1
    for name in ("impulse_error", "temperature_error", "displacement_error"):
        dataset[name][0, 1:] = 1e280
    assert not [one for one in hidden(dataset) if one.metric == "contact_impulse"]


def test_a_smaller_error_at_a_larger_step_ends_what_is_said_of_steps() -> None:
    dataset = study(1.5e-3)
    dataset["impulse_error"][0] = np.array([0.1, 1e-5, 0.1])[:, None, None]
    (one,) = (one for one in hidden(dataset) if one.metric == "contact_impulse")
    assert one.within == {"rough": "h = 0.01 s and more"}


def test_lines_of_an_archive() -> None:
    rough, exact = lines(study(0.1))
    assert (rough.scheme, exact.scheme) == ("rough", "exact")
    assert exact.exact
    assert not rough.exact
    assert rough.seconds == pytest.approx(1e-3 / rough.h / 2.0)
    assert rough.errors["impulse_error"] == pytest.approx(rough.h)
    assert rough.orders["impulse_error"] == pytest.approx((1.0, 0.0))
    assert np.isnan(exact.orders["impulse_error"]).all()


def orders() -> xr.Dataset:
    """Errors of order 1 and 2 at two heat couplings; one case is lost at its largest steps, one cannot be predicted."""
    error = np.stack([0.05 * (H / H[-1]), 0.05 * (H / H[-1]) ** 2])[:, None] * np.array([1.0, 0.5])[:, None]
    status = np.zeros(error.shape, dtype=np.int8)
    status[1, 1, -5:] = 1
    dims = ("scheme", "alpha", "h")
    return xr.Dataset(
        {
            "impulse_scheme_error": (dims, error),
            "impulse_error": (dims, error + 1e-2),
            "status": (dims, status),
            "predictability": (dims, np.broadcast_to([[[1e-14], [1e-14]], [[1.0], [1e-14]]], error.shape)),
        },
        coords={"scheme": ["one", "two"], "alpha": [0.0, 1.0], "h": H},
    )


def test_observed_orders_of_effects() -> None:
    observed = observed_order(orders())["order"]
    assert observed.dims == ("scheme", "alpha")
    assert observed.values == pytest.approx(np.array([[1.0, 1.0], [np.nan, np.nan]]), nan_ok=True)
    two = orders().isel(scheme=1, alpha=1, h=slice(None, 3)).assign(status=0)
    assert float(observed_order(two)["order"]) == pytest.approx(2)
    shuffled = orders().isel(h=[3, 0, 6, 1, 5, 2, 4]).transpose("h", "alpha", "scheme")
    assert observed_order(shuffled)["order"].sel(scheme="one").values == pytest.approx([1.0, 1.0])


def test_observed_orders_are_those_of_the_scheme_s_part() -> None:
    """A reduced model adds its own error to the whole, which bends the line."""
    whole, part = observed_order(orders(), "impulse_error"), observed_order(orders())
    assert (part["scatter"].sel(scheme="one") < 1e-12).all()
    assert (whole["order"].sel(scheme="one") < 0.5).all()
    assert (whole["scatter"].sel(scheme="one") > 0.05).all()
    assert part["order"].attrs["long_name"] == "observed order of the impulse scheme error in h"
    assert "log10" in part["scatter"].attrs["long_name"]


def test_a_scheme_that_does_not_read_h_has_no_order() -> None:
    """The error of the exact scheme on a reduced model is the same at every step: its slope was 4e-15."""
    same = orders().assign(impulse_error=0.003 + 0 * orders()["impulse_error"])
    observed = observed_order(same, "impulse_error")
    assert np.isnan(observed["order"].values).all()
    assert np.isnan(observed["scatter"].values).all()


def test_an_order_needs_errors_and_steps() -> None:
    with pytest.raises(ValueError, match="no `temperature_error`; errors need a `reference`"):
        observed_order(orders(), "temperature_error")
    with pytest.raises(ValueError, match="one step h; an order needs three"):
        observed_order(orders().isel(h=0))
