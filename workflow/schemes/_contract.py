"""Check of a scheme's results against the table of variables: complete, of the right shapes, of possible values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import variables
from workflow.kernels import Array
from workflow.models import Cases
from workflow.schemes._interface import Results, Sampling, Scheme, Status, complete_periods

PERIODS = tuple(about.name for about in variables.select("period", "scheme", "always"))


_STATUSES = frozenset(map(int, Status))


class ContractError(ValueError):
    """A scheme's results lack a variable or have a wrong shape, or the scheme does not take its cases."""


def refuse(scheme: Scheme, cases: Cases) -> None:
    """Raise where a scheme would ignore the harmonics, the friction or the coating of some cases.

    Raises
    ------
    ContractError
        The scheme does not take harmonics of their load, their moving casing, their friction or their coating.
    """
    if cases.friction.any() and "friction" not in scheme.GENERAL:
        raise ContractError("the scheme does not take friction along the direction in which the casing slides")
    if cases.coating is not None and "coating" not in scheme.GENERAL:
        raise ContractError("the scheme does not take a casing with a coating")
    reason = scheme.cannot_take(cases.load_harmonics.width > 1, cases.casing_harmonics.width > 0)
    if reason is not None:
        raise ContractError(f"the scheme {reason}")


def arrays_by_name(results: Results) -> dict[str, Array]:
    """Return all arrays of results by the names that the table of variables gives them."""
    periods = {name: getattr(results, name) for name in PERIODS}
    return {**results.histories, **results.metrics, **periods, **results.sections, **results.wear}


def checked(results: Results, cases: Cases, sampling: Sampling, sensors: int = 0) -> Results:
    """Return the results, with so many sensors, checked against the table, with impossible cases ``failed``.

    A case that ended ok with an impossible value (not finite, or negative where the table allows no sign) becomes
    ``failed``, with NaN everywhere and a message that names the variable; so does one that is not ok without a message.

    Raises
    ------
    ContractError
        A variable is missing, or does not have the shape of the cases.
    """
    arrays = arrays_by_name(results)
    expected = [about for about in variables.select(None, "scheme") if about.shape != "flag"]
    expected = [about for about in expected if about.condition != "balances" or sampling.balances]
    expected = [about for about in expected if about.condition != "sections" or results.sections]
    expected = [about for about in expected if about.condition != "sensors" or sensors]
    expected = [about for about in expected if about.condition != "coating" or cases.coating is not None]
    expected = [about for about in expected if about.condition != "wear" or sampling.wear_every]
    periods = complete_periods(cases.period_frequency, sampling)
    least = int(periods.max(initial=0))
    for about in expected:
        _check_shape(about, arrays.get(about.name), _sizes(about, cases, sensors), sampling, least)
    if results.status.shape != (cases.count,) or not _STATUSES.issuperset(results.status.tolist()):
        raise ContractError("`status` is not one Status for each case")
    counted = np.arange(1, results.period_impulse.shape[-1] + 1) <= periods[:, None]
    wrong: dict[int, str] = {}
    for about in expected:
        possible = _possible(about, arrays[about.name], counted)
        for case in np.flatnonzero((results.status == Status.OK) & ~possible):
            wrong.setdefault(int(case), f"the scheme gave an impossible `{about.name}`: {about.meaning}")
    for case in np.flatnonzero(results.status != Status.OK):
        if not results.messages.get(int(case)):
            wrong[int(case)] = f"the scheme ended a case as {Status(int(results.status[case])).name.lower()} in silence"
    return _with_failed(results, wrong) if wrong else results


def _sizes(about: variables.Variable, cases: Cases, sensors: int) -> tuple[int, ...]:
    """Return the sizes of a variable's dimensions before those of time."""
    own = (sensors,) if about.is_of_sensor else cases.contact_shape if about.is_of_contact else ()
    return cases.count, *own


def _check_shape(
    about: variables.Variable, values: Array | None, each: tuple[int, ...], sampling: Sampling, least: int
) -> None:
    """Raise where a variable is missing or has not the shape of the table: ``each`` case's, the ``least`` periods."""
    if values is None:
        raise ContractError(f"the scheme gives no `{about.name}`: {about.meaning}")
    shape = (*each, sampling.count) if about.shape == "history" else each
    if about.shape == "period":
        sound = values.shape[:-1] == each and values.shape[-1] >= least
        expected = f"({', '.join(map(str, each))}, at least {least})"
    else:
        count = {"sector": 1, "revolution sector": 2}.get(about.shape, 0)
        sound, expected = values.shape[: values.ndim - count] == shape, str(shape)
    if not sound:
        raise ContractError(f"the scheme gives `{about.name}` the shape {values.shape} where it is {expected}")


def _possible(about: variables.Variable, values: Array, counted: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which cases have possible values, ``(case,)``; ``counted`` are their complete load periods."""
    fine = np.ones(values.shape, bool) if about.may_be_undefined else np.isfinite(values)
    if not about.signed:
        fine &= ~(values < 0)
    if about.shape == "period":
        fine = np.moveaxis(fine, -1, 1)[:, : counted.shape[1]]  # before contacts
        fine |= ~counted.reshape(*counted.shape, *(1,) * (fine.ndim - 2))
    return np.asarray(fine.all(axis=tuple(range(1, fine.ndim))))


def _with_failed(results: Results, messages: dict[int, str]) -> Results:
    """Return results in which some cases are failed: NaN everywhere and a message."""
    lost = np.array(sorted(messages), dtype=np.int64)

    def blank(values: Array) -> Array:
        marked = np.array(values, dtype=np.float64)
        marked[lost] = np.nan
        return marked

    status = results.status.copy()
    status[lost] = Status.FAILED
    periods: dict[str, Any] = {name: blank(getattr(results, name)) for name in PERIODS}
    return replace(
        results,
        histories={name: blank(values) for name, values in results.histories.items()},
        metrics={name: blank(values) for name, values in results.metrics.items()},
        **periods,
        status=status,
        messages={**results.messages, **messages},
        sections={name: blank(values) for name, values in results.sections.items()},
        events={name: blank(values) for name, values in results.events.items()},
        wear={name: blank(values) for name, values in results.wear.items()},
    )
