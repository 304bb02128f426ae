"""Functions of kernels: chosen by the type of their first argument, and linked as parts of one program."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import by_type, defines, inlined, kernel


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


class Never(NamedTuple):
    value: float


@by_type
def turns(law: Any) -> int:
    return 1


@defines(turns, Never)
def no_turns(law: Never) -> int:
    return 0


@inlined
def shared_by_both(x: float) -> float:
    return x + 1.0


@inlined
def called_first(x: float) -> float:
    return 2.0 * shared_by_both(x)


@inlined
def called_later(x: float) -> float:
    return 3.0 * shared_by_both(x)


@kernel
def both(law: Any, x: float) -> float:
    result = 0.0
    for _ in range(0, turns(law), 1):
        result += called_first(x)
    for _ in range(int(x)):
        result += called_later(x)
    return result


def test_a_part_is_linked_where_its_first_caller_is_left_out() -> None:
    """Without it the kernel would call nothing at an address of 0."""
    assert both(Never(0.0), 2.0) == 18.0
