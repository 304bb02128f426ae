"""Steady rubs of a batch: the variables of an archive."""

from __future__ import annotations

from workflow.models import Array, Cases, Structure
from workflow.orbits._options import Options


def steady_rubs(
    structure: Structure, cases: Cases, duration: float, options: Options
) -> tuple[dict[str, Array], list[str]]:
    """Return the steady rubs to which the transients of cases lead, and a message for each.

    Each transient lasts ``duration`` [s], completed to a whole number of common periods T, and at most 1 000 T more. Variables,
    ``(case,)``: ``steady_state`` (int8, index in :data:`STATES`), ``steady_periods`` k, ``steady_residual``,
    ``floquet_multiplier`` (largest modulus), ``floquet_angle`` [rad], ``settling_time`` [s], ``lyapunov`` [1/s];
    over kT, divided by k, ``steady_impulse`` [N s], ``steady_impacts``, ``steady_contact`` [s]; extremes and means over kT
    ``steady_max_temperature``, ``steady_mean_temperature`` [K], ``steady_max_displacement``, ``steady_min_displacement``,
    ``steady_closing`` (mean quasi-static growth) [m]. Of the tip at s kT/samples from the start of a period,
    ``(case, samples)``: ``orbit_displacement`` [m], ``orbit_velocity`` [m/s], ``orbit_temperature`` [K]; under
    constant loads all samples are the equilibrium. NaN (``steady_periods`` 0) where there is no steady rub.
    A message is '' or begins with ``steady:``.
    """
    raise NotImplementedError
