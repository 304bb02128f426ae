"""What is asked of steady rubs, and what becomes of them."""

from __future__ import annotations

from dataclasses import dataclass

STATES = ("settles", "no_contact", "permanent_contact", "unstable", "runs_away", "not_found", "not_asked")
"""What becomes of a rub: the flags of ``steady_state``. ``unstable`` occurs on branches only."""

SETTLES, NO_CONTACT, PERMANENT_CONTACT, UNSTABLE, RUNS_AWAY, NOT_FOUND, NOT_ASKED = range(7)


@dataclass(frozen=True)
class Options:
    """What is looked for."""

    periods: int = 4
    """Largest order k."""
    samples: int = 100
    """Samples of an orbit over kT, the first at its start, the last before its end."""
