"""Numbers with units: ``20 um`` is exactly 2e-5 m, and nothing in a string is ever evaluated.

A string is a number, matched here, and a unit as ``declare.unit_factors`` splits it. The most common names
stand in a table; pint resolves others, one bare name at a time. Their factors are multiplied in decimal
arithmetic. Two units are of the same quantity when their root units agree, in which the radian counts:
``rad/s`` is no frequency.
"""

from __future__ import annotations

import re
import sys
from decimal import Context, Decimal
from functools import cache, lru_cache
from typing import Any

from workflow.declare import NUMBER, Quantity, UnitError, unit_factors
from workflow.study.mistakes import quoted, wrong

_NUMBER = re.compile(NUMBER)
_NOT_WHOLE = re.compile(r"[dDqQ][-+]?[0-9]|[-+'_][0-9]|, ?[0-9]")
"""What follows a number in other notations: ``1.0d1`` are no days, and a comma is no point."""

_DEGREES = "°º˚"
_DEGREE = re.compile(rf"[{_DEGREES}](?![A-Za-z])")
"""An angle's, also as keyboards write it; a scale of temperature follows another's."""

_EXACT = Context(prec=60, traps=[])

_SPOKEN = {
    "1": ("a pure number", "a number", "0.5"),
    "m": ("a length", "metres", "0.5 mm"),
    "s": ("a time", "seconds", "1 ms"),
    "kg": ("a mass", "kilograms", "2.5 g"),
    "K": ("a temperature difference", "the rise above the root in kelvin", "20 K"),
    "Hz": ("a frequency", "hertz or rpm", "5 Hz"),
    "rad": ("an angle", "radians", "90 deg"),
    "N": ("a force", "newtons", "24 N"),
    "W": ("a heat load", "watts", "2 W"),
    "m/s": ("a velocity", "metres per second", "0.1 m/s"),
    "Pa": ("a modulus", "pascals", "114e9 Pa"),
    "N/m": ("a stiffness", "newtons per metre", "1e6 N/m"),
}

Unit = tuple[Decimal, dict[str, float]]
"""Factor to pint's root units, and the exponents of those."""

_PREFIXES = {"": 0, "k": 3, "M": 6, "G": 9, "c": -2, "m": -3, "u": -6, "µ": -6, "n": -9}
_SYMBOLS: dict[str, tuple[str, dict[str, float]]] = {
    "m": ("1", {"meter": 1}),
    "s": ("1", {"second": 1}),
    "g": ("1", {"gram": 1}),
    "K": ("1", {"kelvin": 1}),
    "Hz": ("1", {"second": -1}),
    "N": ("1e3", {"gram": 1, "meter": 1, "second": -2}),
    "J": ("1e3", {"gram": 1, "meter": 2, "second": -2}),
    "W": ("1e3", {"gram": 1, "meter": 2, "second": -3}),
    "Pa": ("1e3", {"gram": 1, "meter": -1, "second": -2}),
    "rad": ("1", {"radian": 1}),
}

COMMON: dict[str, Unit] = {
    prefix + symbol: (Decimal(worth).scaleb(power), roots)
    for prefix, power in _PREFIXES.items()
    for symbol, (worth, roots) in _SYMBOLS.items()
}
"""Units as pint defines them, of the names that nearly all studies use: pint takes half a second to load."""

_OF_ENGINEERS: dict[str, Unit] = {
    "rpm": (_EXACT.divide(Decimal(1), Decimal(60)), {"second": -1}),
    "mil": (Decimal("2.54e-5"), {"meter": 1}),
    "percent": (Decimal("0.01"), {}),
}
"""What pint has otherwise: ``rpm`` counts cycles and ``mil`` is a thou; and what ``%`` stands for."""


@lru_cache(maxsize=1024)
def parse_unit(unit: str) -> Unit:
    """Return what a unit is worth in root units; raises :class:`UnitError` if it has none, or an offset (``degC``)."""
    worth, roots = Decimal(1), dict[str, float]()
    for name, exponent in unit_factors(unit):
        factor, units = _OF_ENGINEERS.get(name) or COMMON.get(name) or pint_unit(name)
        worth = _EXACT.multiply(worth, _EXACT.power(factor, Decimal(exponent)))
        for root, power in units.items():
            roots[root] = roots.get(root, 0) + power * exponent
    return worth, {root: power for root, power in roots.items() if power}


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@lru_cache(maxsize=1024)
def pint_unit(name: str) -> Unit:
    """Return what pint says a bare name is worth in its root units; raises :class:`UnitError` if it is no factor."""
    import pint
    from pint.util import to_units_container

    try:
        factor, root = _registry().get_root_units(name)
        offset = _registry().Quantity(Decimal(0), name).to_root_units().magnitude
    except (pint.PintError, AttributeError, TypeError, ValueError, ArithmeticError):
        raise UnitError(f"{quoted(name)} is not a unit") from None
    if offset:
        raise UnitError(f"{quoted(name)} has an offset")
    exponents = {str(unit): float(str(power)) for unit, power in to_units_container(root).items()}
    return Decimal(str(factor)), exponents


def udunits(unit: str) -> str:
    """Return a declared unit as CF writes it: ``W/m**2/K`` is ``W m-2 K-1``, a pure number ``1``."""
    return " ".join(name if power == 1 else f"{name}{power:g}" for name, power in unit_factors(unit)) or "1"


def readable(unit: str) -> str:
    """Return a CF unit as it is written by hand: ``m s-1`` as ``m/s``, nothing for ``1``."""
    over = [word for word in unit.split() if "-" not in word and word != "1"]
    under = [word.replace("-1", "").replace("-", "") for word in unit.split() if "-" in word]
    if not under:
        return " ".join(over)
    return f"{' '.join(over) or '1'}/{'/'.join(under)}"


def expected(declared: Quantity) -> str:
    """Return the remedy for a value of the wrong kind: the unit by name, with an example."""
    _, units, example = _SPOKEN.get(declared.unit, ("", declared.unit, f"1 {declared.unit}"))
    return f"write {units}, e.g. `{example}`"


def admissible(declared: Quantity) -> str:
    """Return the bounds in words: ``above 0 and at most 1``; empty where there are none."""
    bounds = (("above", declared.above), ("at least", declared.at_least), ("at most", declared.at_most))
    return " and ".join(f"{word} {bound:g}" for word, bound in bounds if bound is not None)


def read_quantity(value: Any, declared: Quantity, whole: bool = False) -> float | int:
    """Return a value of a study in SI.

    Parameters
    ----------
    value
        A number in SI, or a string ``number unit``.
    declared
        Unit and bounds.
    whole
        Whether only whole numbers will do; the result is then an ``int``.

    Raises
    ------
    ValidationError
        With problem and remedy: no number, not finite, the wrong unit, out of bounds.
    """
    kind = "a whole number" if whole else _SPOKEN.get(declared.unit, (f"in {declared.unit}",))[0]
    remedy = "write a whole number" if whole else expected(declared)
    if value is None:
        raise wrong("has no value", remedy)
    if isinstance(value, list):
        raise wrong(f"a list is not {kind}", "write one value here, and several under `axes`, by the path of this one")
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise wrong(f"{quoted(value)} is not {kind}", remedy)
    number = _converted(value, declared, kind, remedy) if isinstance(value, str) else value
    if not abs(number) <= sys.float_info.max:  # an integer may be beyond it
        raise wrong(f"{quoted(value)} is not finite", remedy)
    if whole and number != int(number):
        raise wrong(f"{quoted(value)} is not a whole number", "write a whole number")
    below = (declared.above is not None and not number > declared.above) or (
        declared.at_least is not None and not number >= declared.at_least
    )
    if below or (declared.at_most is not None and not number <= declared.at_most):
        unit = "" if declared.unit == "1" else f" {declared.unit}"
        raise wrong(f"{quoted(value)} is out of range", f"it must be {admissible(declared)}{unit}")
    return int(number) if whole else float(number)


def _converted(text: str, declared: Quantity, kind: str, remedy: str) -> float:
    """Return a string ``number unit`` in SI, correctly rounded once."""
    stripped = text.strip()
    number = _NUMBER.match(stripped)
    if number is None:
        raise wrong(f"{quoted(text)} is not {kind}", remedy)
    if _NOT_WHOLE.match(stripped, number.end()):
        written = "write a point and an e, as in 1500 or -1.5e-3, or a list in brackets"
        raise wrong(f"{quoted(text)} is no number as YAML writes it", written)
    unit = _DEGREE.sub("deg", stripped[number.end() :].strip())
    if not unit and declared.unit != "1":
        raise wrong(f"{quoted(text)} is a string without a unit", remedy)
    if any(sign in unit for sign in _DEGREES):
        raise wrong(f"the unit {quoted(unit)} has an offset", remedy)
    target, target_roots = parse_unit(declared.unit)
    try:
        worth, roots = parse_unit({"": "1", "%": "percent"}.get(unit, unit))
    except UnitError as problem:
        known = (_OF_ENGINEERS | COMMON).items()
        meant = [f"`{name}`" for name, (_, own) in known if name.lower() == unit.lower() and own == target_roots]
        raise wrong(str(problem), f"did you mean {' or '.join(meant)}?" if meant else remedy) from None
    if roots != target_roots:
        raise wrong(f"{quoted(text)} is not {kind}", remedy)
    return float(_EXACT.divide(_EXACT.multiply(_EXACT.create_decimal(number[0]), worth), target))
