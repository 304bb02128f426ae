"""A scheme with a `compute` of its own that does not say that it takes several contacts."""

from typing import Any

from workflow.models import Cases
from workflow.schemes import Results, Sampling, step_central
from workflow.schemes.carpenter import READS, Options, init

__all__ = ["READS", "Options", "compute", "init"]


def compute(operator: Any, cases: Cases, sampling: Sampling) -> Results:
    """Step as carpenter does."""
    return step_central(operator, cases, sampling)
