"""``workflow limits``."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import typer

from workflow.cli._failures import NOT_OK
from workflow.cli._terminal import say, write_json
from workflow.cli._words import ArchiveFile

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
    as_json: Annotated[bool, typer.Option("--json", help="Write JSON instead of text.")] = False,
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
    from workflow.declare import Quantity
    from workflow.study.mistakes import WrongValueError
    from workflow.study.quantities import read_quantity

    try:
        return None if text is None else float(read_quantity(_number_or_text(text), Quantity(unit, option, above=0)))
    except WrongValueError as error:
        raise typer.BadParameter(f"{option}: {error}") from None


def _number_or_text(text: str) -> float | str:
    """Return a text that is a number as one."""
    try:
        return float(text)
    except ValueError:
        return text
