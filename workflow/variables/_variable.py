"""What is said of a variable of an archive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Shape = Literal["history", "metric", "period", "flag", "phase", "point", "point phase"]
"""``history``: (…, t); ``metric``: (…) float64; ``period``: (…, period), ``phase``: (…, phase) float64; ``flag``: (…)
int8; ``point``: (…, point) float64 or int8, ``point phase``: (…, point, phase), in archives of branches alone."""

Origin = Literal["scheme", "workflow"]

Condition = Literal[
    "always", "depth", "balances", "sections", "steady", "branch", "reference", "scheme", "auto", "auto reference"
]
"""When an archive has the variable: always, with ``output.temperature_depth``, ``output.balances``,
``output.sections`` or ``output.steady``, where an axis is a branch, with a reference, if a scheme declares it, where a
tolerance decides a count of modes."""


@dataclass(frozen=True)
class Variable:
    """One variable of an archive.

    Attributes
    ----------
    name, unit, meaning
        As in the archive; the unit in CF spelling, the meaning is its long name.
    shape
        See :data:`Shape`.
    origin
        Who gives it: the scheme, or the workflow from what schemes give.
    condition
        See :data:`Condition`.
    signed
        Whether a case that ended ok may have a negative value.
    may_be_undefined
        Whether a case that ended ok may have NaN or an infinite value.
    comment
        Definition, where the meaning leaves something open.
    cell_methods
        How the values stand for the cells of a dimension, in CF's words, where they are not those at its points.
    """

    name: str
    unit: str
    meaning: str
    shape: Shape = "metric"
    origin: Origin = "workflow"
    condition: Condition = "always"
    signed: bool = False
    may_be_undefined: bool = False
    comment: str = ""
    cell_methods: str = ""
