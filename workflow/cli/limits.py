"""``workflow limits``."""

from __future__ import annotations

import dataclasses
from contextlib import suppress
from typing import Annotated

import typer

from workflow.cli._failures import NOT_OK
from workflow.cli._terminal import say, write_json
from workflow.cli._words import ArchiveFile, AsJson

_Bound = Annotated[
    str | None,
    typer.Option(metavar="QUANTITY", help="Bound of steady rubs, in SI or with its unit: 40K, 0.1mm, '0.1 N*s'."),
]

_NAMED = 12
"""Limits of single branches or combinations of axes that are named."""


def limits(
    archive: ArchiveFile,
    max_temperature: _Bound = None,
    max_displacement: _Bound = None,
    max_impulse: _Bound = None,
    as_json: AsJson = False,
) -> None:
    """Name the range of each axis in which every rub settles within bounds, and what ends it.

    Exit status: 0 answered, 1 no case is within, 2 the archive has no steady rubs.
    """
    from workflow.analysis import NothingSteadyError, count_sentence, limit_sentence
    from workflow.analysis import limits as find
    from workflow.archive import ArchiveError, open_archive

    bounds = {
        "temperature": _read("--max-temperature", "K", max_temperature),
        "displacement": _read("--max-displacement", "m", max_displacement),
        "impulse": _read("--max-impulse", "N*s", max_impulse),
    }
    with open_archive(archive) as dataset:
        try:
            found = find(dataset, **bounds)
        except NothingSteadyError as error:
            raise ArchiveError(f"{archive}: {error}") from None
        lines = [limit_sentence(limit, dataset, bounds) for limit in found.limits]
        if len(found.each) > 1:
            lines += [limit_sentence(limit, dataset, bounds, of_one=True) for limit in found.each[:_NAMED]]
        if len(found.each) > _NAMED:
            lines.append(f"… and {len(found.each) - _NAMED} more, which --json lists")
    if as_json:
        answer = dataclasses.asdict(found)
        for limit in (*answer["limits"], *answer["each"]):
            limit["from"], limit["to"] = limit.pop("start"), limit.pop("stop")
        write_json(answer, indent=2)
    else:
        for line in lines:
            say(line)
        say(count_sentence(found))
    if not found.within:
        raise typer.Exit(NOT_OK)


def _read(option: str, unit: str, text: str | None) -> float | None:
    """Return a bound in SI; a number without unit is in SI."""
    if text is None:
        return None
    from pydantic_core import ValidationError

    from workflow.declare import Quantity
    from workflow.study.mistakes import faults_of
    from workflow.study.quantities import read_quantity

    value: float | str = text
    with suppress(ValueError):
        value = float(text)
    try:
        return read_quantity(value, Quantity(unit, option, above=0))
    except ValidationError as error:
        ((_, problem, remedy),) = faults_of(error)
        raise typer.BadParameter(f"{option}: {problem}; {remedy}") from None
