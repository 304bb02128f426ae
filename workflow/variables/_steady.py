"""Variables of steady rubs, whose period is k common periods T of all loads."""

from __future__ import annotations

from collections.abc import Iterator

from workflow.variables._variable import Variable

_STEADY_STATE = (
    "settles: a periodic rub that is met and left, all Floquet multipliers below 1; no_contact, permanent_contact: a "
    "settled motion without events; unstable: a multiplier of 1 or more, on branches alone; runs_away: a contact "
    "that lasts while it grows, or a temperature that leaves every bound; not_asked: of other schemes. "
    "All other variables of steady rubs are NaN where there is none"
)


def steady_variables() -> Iterator[Variable]:
    """Yield the variables of steady rubs, whose period is k common periods T of all loads."""
    meant = "of the steady rub"
    for name, unit, meaning in (
        ("steady_periods", "1", f"number k of common periods of the loads in a period {meant}"),
        ("steady_residual", "1", f"largest change of x, v, θ over a period {meant}, each over its own maximum"),
        ("floquet_multiplier", "1", f"largest modulus of the Floquet multipliers {meant} over its period kT"),
        ("floquet_angle", "rad", f"argument of the Floquet multiplier of largest modulus {meant}"),
        ("settling_time", "s", "time in which a small disturbance falls to 1/e: -kT/ln of the largest multiplier"),
        ("lyapunov", "s-1", "largest Lyapunov exponent along the last periods, where nothing periodic was found"),
        ("steady_impulse", "N s", f"impulse of the casing {meant} over kT, divided by k"),
        ("steady_impacts", "1", f"number of impacts {meant} over kT, divided by k"),
        ("steady_contact", "s", f"time in contact {meant} over kT, divided by k"),
        ("steady_max_temperature", "K", f"largest temperature rise of the blade tip {meant}"),
        ("steady_mean_temperature", "K", f"mean temperature rise of the blade tip {meant}"),
        ("steady_max_displacement", "m", f"largest displacement of the blade tip {meant}"),
        ("steady_min_displacement", "m", f"smallest displacement of the blade tip {meant}"),
        ("steady_closing", "m", f"mean quasi-static tip growth {meant} by its temperatures"),
    ):
        yield Variable(name, unit, meaning, condition="steady", signed=True, may_be_undefined=True)
    for name, unit, meaning in (
        ("orbit_displacement", "m", f"displacement of the blade tip over a period {meant}"),
        ("orbit_velocity", "m s-1", f"velocity of the blade tip over a period {meant}"),
        ("orbit_temperature", "K", f"temperature rise of the blade tip over a period {meant}"),
    ):
        yield Variable(name, unit, meaning, "phase", condition="steady", signed=True, may_be_undefined=True)
    about = "what becomes of the rub"
    yield Variable("steady_state", "1", about, "flag", condition="steady", comment=_STEADY_STATE)
