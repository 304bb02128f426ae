"""Results of every scheme agree with the table of variables; those that do not make their cases fail."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import cases, heavy_chain, same_bits, step, watched
from workflow import schemes, variables
from workflow.schemes import Cases, ContractError, Results, Sampling, Status, checked

OVER = Sampling(0.1, 1e-3, 101, balances=True)


def batch() -> Cases:
    frequency = np.array([20.0, 40.0, 0.0])  # two, four and no load periods
    return cases(heavy_chain(), 3, alpha=50.0, e=0.5, gap=5e-5, amplitude=100.0, mean=60.0, frequency=frequency)


@pytest.mark.parametrize("method", schemes.names())
def test_every_scheme_gives_what_the_table_says(method: str) -> None:
    results = step(heavy_chain(), batch(), 1e-5, OVER, method)
    assert np.all(results.status == Status.OK)
    assert results.metrics["impacts"].min() > 0
    assert same_bits(checked(results, batch(), OVER), results)


def put(name: str, value: float, case: int = 1) -> Callable[[Results], Results]:
    """Return what puts a value in a place of some results, the second of a period or history."""

    def spoil(results: Results) -> Results:
        for place in (results.histories, results.metrics):
            if name in place:
                place[name] = place[name].copy()
                place[name][(case, 1)[: place[name].ndim]] = value
                return results
        values = getattr(results, name).copy()
        values[case, 1] = value
        return replace(results, **{name: values})

    return spoil


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (put("period_impulse", np.nan), "period_impulse"),
        (put("contact_time", -1e-9), "contact_time"),
        (put("steps", -1.0), "steps"),
        (put("impacts", np.nan), "impacts"),
        (put("displacement", np.inf), "displacement"),
        (put("impulse", -1.0), "impulse"),
        (put("period_contact", -0.1), "period_contact"),
    ],
)
def test_an_impossible_value_fails_its_case_alone(spoil: Callable[[Results], Results], named: str) -> None:
    sound = step(heavy_chain(), batch(), 1e-5, OVER)
    judged = checked(spoil(step(heavy_chain(), batch(), 1e-5, OVER)), batch(), OVER)
    assert judged.status.tolist() == [Status.OK, Status.FAILED, Status.OK]
    assert named in judged.messages[1]
    assert np.isnan(judged.histories["displacement"][1]).all()
    for name in sound.metrics:
        assert np.array_equal(judged.metrics[name][[0, 2]], sound.metrics[name][[0, 2]])


def test_a_case_that_ends_without_a_message_fails() -> None:
    results = step(heavy_chain(), batch(), 1e-5, OVER)
    status = np.array([Status.OK, Status.OK, Status.DIVERGED], dtype=np.int8)
    judged = checked(replace(results, status=status), batch(), OVER)
    assert judged.status[2] == Status.FAILED
    assert "diverged" in judged.messages[2]


def without(name: str) -> Callable[[Results], Results]:
    return lambda whole: replace(
        whole,
        histories={key: values for key, values in whole.histories.items() if key != name},
        metrics={key: values for key, values in whole.metrics.items() if key != name},
    )


ALWAYS = [
    v
    for v in variables.select(None, "scheme")
    if v.shape in ("history", "metric") and v.condition not in ("sensors", "coating")
]


@pytest.mark.parametrize("name", [v.name for v in ALWAYS])
def test_a_missing_variable_is_named(name: str) -> None:
    results = step(watched(heavy_chain()), batch(), 1e-5, OVER)
    assert same_bits(checked(results, batch(), OVER, sensors=4), results)
    with pytest.raises(ContractError, match=name):
        checked(without(name)(results), batch(), OVER, sensors=4)


ODD: dict[str, Callable[[Results], dict[str, Any]]] = {
    "samples": lambda of: {"histories": {name: values[:, 1:] for name, values in of.histories.items()}},
    "periods": lambda of: {"period_contact": of.period_contact[:, :1]},
    "status": lambda of: {"status": np.full(3, 9, dtype=np.int8)},
}


@pytest.mark.parametrize("of", ODD)
def test_another_shape_or_status_is_named(of: str) -> None:
    results = step(heavy_chain(), batch(), 1e-5, OVER)
    with pytest.raises(ContractError):
        checked(replace(results, **ODD[of](results)), batch(), OVER)


def test_names_are_distinct_and_reserved() -> None:
    names = [variable.name for variable in variables.TABLE]
    assert len(names) == len(set(names))
    assert set(names) | {"t", "message"} <= variables.reserved_names()
