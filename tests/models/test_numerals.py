"""Numbers of text files in every notation of Fortran, C, MATLAB and spreadsheets: whole, or refused with a line."""

import re
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic_core import ValidationError

from workflow.declare import File, Quantity
from workflow.models import UnusableMatricesError
from workflow.models._matrix_files import read_entries
from workflow.models.modes import COLUMNS, read_matrix, read_table
from workflow.study.quantities import read_quantity

WHOLE: dict[str, Callable[[float], str]] = {
    "shortest": repr,
    "C": "{:.16e}".format,
    "C, capital and signed": "{:+.16E}".format,
    "%g": "{:.17g}".format,
    "MATLAB": "{:.15g}".format,
    "short": "{:.4e}".format,
    "point last": lambda x: f"{x:.0f}.",
    "point first": lambda x: f"{x:.5f}".replace("0.", ".", 1) if abs(x) < 1 else repr(x),
    "three digits of exponent": lambda x: re.sub(r"E([-+])", r"E\g<1>0", f"{x:.15E}"),
    "Fortran's double": lambda x: f"{x:.15e}".replace("e", "D"),
    "Fortran's double, small": lambda x: f"{x:.15e}".replace("e", "d"),
    "no letter": lambda x: f"{x:.15e}".replace("e", ""),
    "leading zeros": lambda x: f"{x:012.3f}",
}
"""A number as text, which is the same number to every reader that takes it."""

OTHER: dict[str, Callable[[float], str]] = {
    "decimal comma": lambda x: f"{x:.6f}".replace(".", ","),
    "decimal comma and exponent": lambda x: f"{x:.6e}".replace(".", ","),
    "comma of thousands": lambda x: f"{abs(x) + 1e3:,.2f}",
    "gap of thousands": lambda x: f"{abs(x) + 1e3:,.2f}".replace(",", " "),
    "apostrophe": lambda x: f"{abs(x) + 1e3:,.2f}".replace(",", "'"),
    "Python's underscore": lambda x: f"{abs(x) + 1e3:_.2f}",
    "cut behind E": lambda x: f"{x:.3e}".partition("e")[0] + "E",
    "cut behind the sign": lambda x: f"{x:.3e}".partition("e")[0] + "E+",
    "four words": lambda x: f"{x:.3e}".replace("e", "Q"),
    "hexadecimal": float.hex,
    "single in C": lambda x: f"{x:.6e}f",
    "percent": lambda x: f"{x:.3f}%",
    "fraction": lambda x: f"{x:.0f}/3",
    "repeated": lambda x: f"3*{abs(x):.3f}",
    "powers of ten": lambda x: f"{x:.3f}*10^3",
    "complex": lambda x: f"{x:.3f}+2.0i",
    "pair": lambda x: f"({x:.3f},0.0)",
    "two points": lambda x: f"{x:.3f}.5",
    "two signs": lambda x: f"--{abs(x):.3f}",
    "broken exponent": lambda x: f"{x:.3e}.5",
    "minus sign of typesetters": lambda x: f"\N{MINUS SIGN}{abs(x):.3f}",
    "asterisks": lambda x: "*" * 12,
    "not a number": lambda x: "NaN",
    "infinite": lambda x: "-Infinity",
    "infinite in C": lambda x: "1.#INF",
    "gap in the exponent": lambda x: re.sub("e[-+]", "E ", f"{x:.3e}"),
    "currency": lambda x: f"${x:.2f}",
    "nothing": lambda x: '""',
}


def market(kind: str, *rows: str) -> str:
    return "\n".join((f"%%MatrixMarket matrix {kind}", "% a comment", *rows)) + "\n"


def coordinates(number: str, path: Path) -> tuple[Any, int]:
    (path / "mass.mtx").write_text(
        market("coordinate real general", "2 2 3", "1 1 1.0", "", f"1 2 {number}", "2 2 1.0"), encoding="utf-8"
    )
    return lambda: read_entries(path)["mass"].toarray()[0, 1], 6


def array(number: str, path: Path) -> tuple[Any, int]:
    (path / "mass.mtx").write_text(market("array real general", "", "2 1", "1.0", number), encoding="utf-8")
    return lambda: read_entries(path)["mass"][1, 0], 6


def calculix(number: str, path: Path) -> tuple[Any, int]:
    (path / "a.dof").write_text("1.1\n1.2\n")
    (path / "a.mas").write_text("1 1 1.0\n2 2 1.0\n")
    (path / "a.sti").write_text(f"1 1 1.0\n1 2 {number}\n2 2 1.0\n", encoding="utf-8")
    return lambda: read_entries(path / "a.sti")["stiffness"].toarray()[1, 0], 2


def abaqus(number: str, path: Path) -> tuple[Any, int]:
    (path / "a_MASS1.mtx").write_text("7,1, 7,1, 1.0\n")
    (path / "a_STIF1.mtx").write_text(f"7,1, 7,1, 1.0\n7,2, 7,1, {number}\n7,2, 7,2, 1.0\n", encoding="utf-8")
    return lambda: read_entries(path / "a_STIF1.mtx")["stiffness"].toarray()[0, 1], 2


def punch(number: str, path: Path) -> tuple[Any, int]:
    """In free fields: a number longer than 16 characters has no wide field."""
    (path / "a.pch").write_text(f"DMIG,KAAX,0,6,2\nDMIG,KAAX,7,1,,7,2,{number}\n", encoding="utf-8")
    return lambda: read_entries(path / "a.pch")["stiffness"].toarray()[0, 1], 2


def harwell_boeing(number: str, path: Path) -> tuple[Any, int]:
    head = f"{'a':72}b\n{4:14}{1:14}{1:14}{2:14}{0:14}\nRUA{2:25}{2:14}{3:14}{0:14}\n"
    formats = f"{'(16I5)':16}{'(16I5)':16}{'(2E26.16)':20}\n"
    cards = f"{1:5}{2:5}{4:5}\n{1:5}{1:5}{2:5}\n{'1.0':>26}{number:>26}\n{'1.0':>26}\n"
    (path / "mass.rua").write_text(head + formats + cards, encoding="utf-8")
    return lambda: read_entries(path)["mass"].toarray()[0, 1], 7


def output4(number: str, path: Path) -> tuple[Any, int]:
    one = f"{1.0:26.16E}"
    head = f"{2:8}{2:8}{2:8}{2:8}{'MAA':8}1P,3E26.16\n"
    columns = f"{1:8}{1:8}{2:8}\n{one}{one}\n{2:8}{1:8}{2:8}\n{number:>26}{one}\n{3:8}{1:8}{1:8}\n{one}\n"
    (path / "a.op4").write_text(head + columns, encoding="utf-8")
    return lambda: read_entries(path / "a.op4")["mass"].toarray()[0, 1], 5


def modes(number: str, path: Path) -> tuple[Any, int]:
    (path / "a.csv").write_text(f"\nfrequency,damping_ratio,tip\n1,0.1,1\n,,\n2,0.1, {number}\n", encoding="utf-8")
    return lambda: read_table(File("", "a.csv", str(path / "a.csv")), COLUMNS)[1, 2], 5


def coupling(number: str, path: Path) -> tuple[Any, int]:
    (path / "a.csv").write_text(f'1,2\r\n"3","{number}"\r\n', encoding="utf-8")
    return lambda: read_matrix(File("", "a.csv", str(path / "a.csv")), (2, 2))[1, 1], 2


FORMATS = (coordinates, array, calculix, abaqus, punch, harwell_boeing, output4, modes, coupling)
NUMBERS = st.floats(-1e9, 1e9) | st.floats(-1.0, 1.0) | st.floats(-1e300, 1e300)


def checked(write: Callable[[str, Path], tuple[Any, int]], number: str, right: float | None, path: Path) -> bool:
    """Check that a number in a file is read as it is right, or refused with its line; tell whether it was read."""
    for each in path.iterdir():
        each.unlink()
    read, line = write(number, path)
    try:
        value = read()
    except UnusableMatricesError as error:
        refusal = str(error)
    else:
        assert value == right, f"{number} was read as {value!r}"
        return True
    assert re.search(rf"`\w+\.\w+`(, line {line}:| has \d+ numbers with gaps)", refusal), refusal
    return False


def in_every_notation(x: float, path: Path) -> None:
    for write in FORMATS:
        for name, notation in WHOLE.items():
            number = notation(x)
            if len(number) > 26 and write in (harwell_boeing, output4):
                continue
            right = float(re.sub(r"(?<=[0-9.])(?:[dD]|(?=[-+]))", "e", number))
            was_read = checked(write, number, right, path)
            assert was_read or write in (harwell_boeing, output4), (name, write.__name__)
        for notation in OTHER.values():
            if len(notation(x)) <= 26 or write not in (harwell_boeing, output4):
                checked(write, notation(x), None, path)


quickly = settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@quickly
@given(NUMBERS)
def test_a_number_in_a_file_is_read_whole_or_refused_with_its_line(tmp_path: Path, x: float) -> None:
    in_every_notation(x, tmp_path)


@settings(max_examples=50, deadline=None)
@given(NUMBERS, st.sampled_from([*WHOLE.values(), *OTHER.values()]))
def test_a_number_in_a_study_is_read_whole_or_refused(x: float, notation: Callable[[float], str]) -> None:
    number = notation(x)
    for unit, declared in ((" s", "s"), ("", "1"), (" Hz", "Hz"), ("", "s")):
        try:
            value = read_quantity(number + unit, Quantity(declared, ""))
        except ValidationError:
            continue
        percent = float(Decimal(number[:-1]) / 100) if number.endswith("%") else None
        assert value == (float(number) if percent is None else percent)
