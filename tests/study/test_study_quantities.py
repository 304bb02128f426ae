"""Numbers with units: exact, of the right dimension, and never evaluated."""

import re
from decimal import Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic_core import ValidationError

from workflow.declare import Quantity
from workflow.study import udunits
from workflow.study.mistakes import faults_of
from workflow.study.quantities import COMMON, parse_unit, pint_unit, read_quantity

METRE = Quantity("m", "length")
DECIMALS = st.decimals(allow_nan=False, allow_infinity=False, min_value=-(10**9), max_value=10**9, places=6)
PREFIXES = {"n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "": 0, "k": 3, "M": 6}


@given(DECIMALS, st.sampled_from(sorted(PREFIXES)))
def test_powers_of_ten_are_exact(number: Decimal, prefix: str) -> None:
    assert read_quantity(f"{number} {prefix}m", METRE) == float(number * Decimal(10) ** PREFIXES[prefix])


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_come_back_bit_for_bit(number: float) -> None:
    assert read_quantity(number, METRE) == number
    assert read_quantity(f"{number!r} m", METRE) == number
    assert read_quantity(repr(number), Quantity("1", "ratio")) == number


OTHER_NOTATION = re.compile(r"[-+]?(\d|\.\d)[\d.eE]*[dDqQ_',+-]+ ?\d")
"""How numbers of Fortran, of spreadsheets and of people begin that YAML does not read."""


@pytest.mark.parametrize(
    ("written", "unit", "value"),
    [
        ("50 um", "m", 5e-5),
        (" 1e1\tinch ", "m", 0.254),
        ("5 Hz", "Hz", 5.0),
        ("5 1/s", "Hz", 5.0),
        ("300 rpm", "Hz", 5.0),
        ("180 deg", "rad", 3.141592653589793),
        ("1 mil", "m", 2.54e-5),
        ("20 delta_degC", "K", 20.0),
        ("4.43 g/cm^3", "kg/m**3", 4430.0),
        ("400 W·m^-2·K^-1", "W/m**2/K", 400.0),
        ("30 m/s", "W/N", 30.0),
        ("1e-6", "1", 1e-6),
        ("1%", "1", 0.01),
        ("460 J/(kg*K)", "J/kg/K", 460.0),
        ("7 W/(m K)", "W/m/K", 7.0),
        ("400 W/(m^2 · K)", "W/m**2/K", 400.0),
        ("400 W/(m²·K)", "W/m**2/K", 400.0),
        ("4.43e-6 kg/mm³", "kg/m**3", 4430.0),
        ("2 m/(s/rad)/rad", "m/s", 2.0),
        ("180°", "rad", 3.141592653589793),
        ("180 º", "rad", 3.141592653589793),
        ("180 °/s", "rad/s", 3.141592653589793),
        ("2d", "s", 172800.0),
        (f"1e-{'9' * 20} m", "m", 0.0),
    ],
)
def test_units(written: str, unit: str, value: float) -> None:
    assert read_quantity(written, Quantity(unit, "")) == value


@pytest.mark.parametrize(
    ("written", "unit"),
    [
        ("5 rad/s", "Hz"),
        ("1 N m", "J/K"),
        ("1 dB", "1"),
        ("1 %", "m"),
        ("20 °C", "K"),
        ("20 °F", "K"),
        ("1 J/(kg K)**2", "J/kg/K"),
        ("1 J/(kg", "J/kg"),
    ]
    + [(number, "1") for number in ("1.0d1", "1.0D-03", "2d+1", "1.5+06", "1.5-103", "1,5", "1'000", "1_000", "1q2")]
    + [(number, "s") for number in ("1.0d1", "5D-1 s", "5d-1")]
    + [("5d-1", "Hz"), ("1.0-2 mm", "m"), ("1,5 mm", "m"), ("1d2 K", "K")]
    + [
        (f"1 {text}", "m")
        for text in ("m**999", "m**-1e9", "m m", "m; m", "m+m", "(m)", "m//m", "m" * 50, "5", "m 2", "m/1", "m*1")
    ]
    + [(text, "m") for text in ("", "m", "nan m", "inf m", "0x1 m", "1_0 m", "1e9999 m", "9**9**9 m", "1 2 m", "٣ m")],
)
def test_refused(written: str, unit: str) -> None:
    with pytest.raises(ValidationError):
        read_quantity(written, Quantity(unit, ""))


@pytest.mark.parametrize(
    ("written", "unit", "meant"),
    [("9000 RPM", "Hz", "rpm"), ("2 KHZ", "Hz", "kHz"), ("1 KG", "kg", "kg"), ("3 UM", "m", "um")],
)
def test_a_unit_in_other_letters_is_offered(written: str, unit: str, meant: str) -> None:
    with pytest.raises(ValidationError, match=f"did you mean `{meant}`"):
        read_quantity(written, Quantity(unit, ""))


@given(st.text(max_size=30))
@example("0Q0")
def test_any_text_is_a_number_or_a_mistake(text: str) -> None:
    try:
        assert isinstance(read_quantity(text, METRE), float)
    except ValidationError as error:
        ((_, _, remedy),) = faults_of(error)
    else:
        return
    if remedy != "write metres, e.g. `0.5 mm`":
        assert remedy == "write a point and an e, as in 1500 or -1.5e-3, or a list in brackets"
        assert OTHER_NOTATION.match(text.strip())


@pytest.mark.parametrize(
    ("declared", "cf"),
    [("1", "1"), ("m", "m"), ("W/N", "W N-1"), ("W/m**2/K", "W m-2 K-1"), ("1/s", "s-1"), ("kg/m**3", "kg m-3")],
)
def test_cf_units(declared: str, cf: str) -> None:
    assert udunits(declared) == cf
    assert parse_unit(cf if cf != "1" else "1") == parse_unit(declared)


@pytest.mark.parametrize("name", sorted(COMMON))
def test_what_is_known_of_the_common_names_is_what_pint_says(name: str) -> None:
    assert COMMON[name] == pint_unit(name)
