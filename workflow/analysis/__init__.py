"""What an archive says: contact phases, how cases ended, who stays stable and accurate, which axes matter."""

from __future__ import annotations

from workflow.analysis._cases import (
    Failures,
    case_dims,
    contact_phases,
    failures,
    finest,
    labels_of,
    shown_dim,
)
from workflow.analysis._effects import Hidden, effect, hidden
from workflow.analysis._motion import contact_loss, energy_kept, growth, impact_speeds
from workflow.analysis._precision import ERRORS, SENSELESS, TARGETS, Line, Winner, has_lines, lines, winners
from workflow.analysis._standing import ACCURATE, RULE, Range, Standing, ranges, standings

__all__ = [
    "ACCURATE",
    "ERRORS",
    "RULE",
    "SENSELESS",
    "TARGETS",
    "Failures",
    "Hidden",
    "Line",
    "Range",
    "Standing",
    "Winner",
    "case_dims",
    "contact_loss",
    "contact_phases",
    "effect",
    "energy_kept",
    "failures",
    "finest",
    "growth",
    "has_lines",
    "hidden",
    "impact_speeds",
    "labels_of",
    "lines",
    "ranges",
    "shown_dim",
    "standings",
    "winners",
]
