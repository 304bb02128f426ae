"""The θ-method with several contacts in plain matrices, as a scheme."""

from dataclasses import dataclass
from typing import NamedTuple

from plain_steps import march, results
from workflow.declare import quantity
from workflow.models import Cases, Structure
from workflow.schemes import Results, Sampling

READS = frozenset({"e", "h", "alpha"})
HARMONICS = frozenset({"load", "casing"})
GENERAL = frozenset({"contacts", "damping", "load", "friction", "massless"})


@dataclass(frozen=True)
class Options:
    """Weight of the end of a step."""

    theta: float = quantity("1", "weight of a step's end", default=1.0, above=0, at_most=1)


class Operator(NamedTuple):
    """Structure, step and weight."""

    structure: Structure
    h: float
    theta: float


def init(structure: Structure, h: float, options: Options) -> Operator:
    """Keep what a batch shares."""
    return Operator(structure, h, options.theta)


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step every case."""
    structure, h, theta = operator
    return results(structure, h, cases, sampling, lambda one, steps: march(structure, one, h, theta, steps))
