"""Functions of kernels that the type of their first argument chooses when they are compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import by_type, defines, kernel


class Line(NamedTuple):
    slope: float


class Power(NamedTuple):
    exponent: float
    factor: Array


class Other(NamedTuple):
    value: float


@by_type
def value_at(law: Any, x: float) -> float:
    return 0.0


@defines(value_at, Line)
def of_line(law: Line, x: float) -> float:
    return law.slope * x


@defines(value_at, Power)
def of_power(law: Power, x: float) -> float:
    return float(law.factor[0] * x**law.exponent)


@kernel
def total(law: Any, count: int) -> float:
    value = 0.0
    for k in range(count):
        value += value_at(law, float(k))
    return value


def test_a_type_chooses_its_definition_and_others_the_declared_body() -> None:
    assert total(Line(2.0), 4) == 12.0
    assert total(Power(2.0, np.array([3.0])), 4) == 42.0
    assert total(Other(1.0), 4) == 0.0
