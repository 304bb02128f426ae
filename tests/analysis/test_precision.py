"""Speed against error: observed orders, limits, who is fastest, and who stays stable, on archives made for it."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

from errors_over_steps import H as LONG
from errors_over_steps import archive_of, over_steps
from workflow.analysis import hidden, lines, observed_order, ranges, standings
from workflow.report._sections import _limit
from workflow.schemes import Status

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
    error = np.array([h, 0 * h])[:, :, None, None]
    return archive_of(
        error,
        {"scheme": ["rough", "exact"], "h": h, "e": e, "alpha": alpha},
        contact_impulse=(1 + e_matters * e[:, None] + 0.5 * alpha) * (1 + error),
        max_temperature=0.0,
        processor_time=1e-3 / h[:, None, None],
        max_penetration=error,
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
    known = np.array([[[1e-14], [1e-14]], [[1.0], [1e-14]]])
    coords = {"scheme": ["one", "two"], "alpha": [0.0, 1.0], "h": H}
    dataset = archive_of(error + 1e-2, coords, impulse_scheme_error=error, predictability=known)
    dataset["status"][1, 1, -5:] = 1
    return dataset.drop_vars("temperature_error")


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


STEPS = [1e-5, 1e-4, 1e-3]


def one_scheme(status: Any, error: Any, residual: Any = 0.0, depth: Any = 0.0) -> xr.Dataset:
    """One scheme at three steps with two cases each."""
    status, error, residual, depth = (np.asarray(of_step)[..., None] for of_step in (status, error, residual, depth))
    dataset = archive_of(
        0.0,
        {"scheme": ["one"], "h": STEPS, "e": [0.0, 0.5], "gap": 1e-3},
        status=status,
        impulse_error=error,
        processor_time=1.0,
        energy_residual=residual,
        max_penetration=depth,
    )
    dataset["h"].attrs["units"] = "s"
    return dataset


@pytest.mark.parametrize(
    ("status", "error", "residual", "verdict"),
    [
        (Status.OK, 0.01, 0.0, "within 1 %"),
        (Status.OK, 0.0101, 0.0, "within 10 %"),
        (Status.OK, 0.11, -5.0, "beyond 10 %"),
        (Status.OK, np.inf, 0.0, "beyond 10 %"),
        (Status.OK, np.nan, 0.0, "stable"),
        (Status.OK, 0.001, 0.02, "gains energy"),
        (Status.DIVERGED, 0.0, 0.0, "diverged"),
        (Status.ILL_POSED, 0.0, 0.0, "ill-posed"),
        (Status.FAILED, 0.0, 0.0, "failed"),
    ],
)
def test_verdicts_follow_the_rule(status: Status, error: float, residual: float, verdict: str) -> None:
    assert {row.verdict for row in standings(one_scheme(status, error, residual))} == {verdict}


def test_a_part_that_is_lost_is_reported() -> None:
    dataset = one_scheme(Status.OK, 0.0)
    dataset["status"][0, 1, 1] = Status.DIVERGED
    assert [row.verdict for row in standings(dataset)] == ["within 0.1 %", "diverged in part", "within 0.1 %"]
    assert [row.counts for row in standings(dataset)][1] == {"ok": 1, "diverged": 1}


def test_a_gain_shows_beside_a_larger_loss() -> None:
    dataset = one_scheme(Status.OK, 0.001)
    dataset["energy_residual"][0, 0] = [-0.4, 0.03]
    dataset["energy_residual"][0, 1] = [-0.4, 0.0]
    assert [row.verdict for row in standings(dataset)] == ["gains energy", "within 0.1 %", "within 0.1 %"]
    assert standings(dataset)[0].residual == -0.4


def test_ranges_end_before_the_first_step_that_is_not_good() -> None:
    dataset = one_scheme([Status.OK, Status.OK, Status.DIVERGED], [0.001, 0.05, 7.0], depth=[1e-6, 4e-4, 3.0])
    (row,) = ranges(dataset)
    assert (row.stable, row.accurate) == ("0.0001 s", "1e-05 s")
    assert (row.ok, row.cases) == (4, 6)
    assert (row.finest, row.coarsest) == (0.001, 0.05)  # what diverged has no error
    assert row.penetration == pytest.approx(0.4)
    assert row.verdicts == ("within 0.1 %", "within 10 %", "diverged")


def test_steps_near_a_limit_are_told_apart() -> None:
    """Four digits named both 0.00010028 s, the last that holds, and 0.00010031 s, which diverges."""
    dataset = one_scheme([Status.OK, Status.OK, Status.DIVERGED], 0.0)
    near = dataset.assign_coords(h=("h", [1e-4, 1.0028e-4, 1.0031e-4], {"units": "s"}))
    assert ranges(near)[0].stable == "0.00010028 s"


def test_every_and_no_step() -> None:
    (good,) = ranges(one_scheme(Status.OK, 0.0))
    (bad,) = ranges(one_scheme(Status.DIVERGED, 0.0))
    assert (good.stable, good.accurate) == ("every h", "every h")
    assert (bad.stable, bad.accurate) == ("no h", "")


def test_steps_in_any_order() -> None:
    dataset = one_scheme([Status.OK, Status.OK, Status.DIVERGED], [0.001, 0.05, 7.0])
    assert ranges(dataset.isel(h=[2, 0, 1])) == ranges(dataset)


def test_an_archive_without_scheme_step_and_errors() -> None:
    dataset = one_scheme(Status.OK, 0.0).drop_vars(["impulse_error", "energy_residual"]).isel(scheme=0, h=0)
    (row,) = standings(dataset)
    assert (row.scheme, row.step, row.verdict) == ("one", "", "stable")
    assert np.isnan(row.error)
