"""Commands whose options are fields of dataclasses."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, get_type_hints


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command as typer reads it: a parameter that is a dataclass stands for the options that are its fields.

    Fields are annotated as parameters of a command are, and have defaults.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if dataclasses.is_dataclass(kind)}
    parameters: list[inspect.Parameter] = []
    for name, parameter in inspect.signature(command).parameters.items():
        if name not in groups:
            parameters.append(parameter.replace(kind=parameter.KEYWORD_ONLY, annotation=hints[name]))
            continue
        options = get_type_hints(groups[name], include_extras=True)
        for entry in dataclasses.fields(groups[name]):
            about: dict[str, Any] = {"default": entry.default, "annotation": options[entry.name]}
            parameters.append(inspect.Parameter(entry.name, parameter.KEYWORD_ONLY, **about))

    @wraps(command)
    def flat(**values: Any) -> None:
        grouped = {
            name: kind(**{entry.name: values.pop(entry.name) for entry in dataclasses.fields(kind)})
            for name, kind in groups.items()
        }
        command(**values, **grouped)

    flat.__dict__["__signature__"] = inspect.Signature(parameters)
    flat.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return flat
