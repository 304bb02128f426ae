"""How far two histories are apart, and how sensitive they are to rounding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from workflow.models import Array, Cases, project
from workflow.schemes import Results, Status

GAP_SHARE = 1e-12
"""Change of the gap over a length of the motion, by whose effect ``predictability`` is defined."""


def norms(values: Array) -> Array:
    """Return the L2 norm of each case's values, of all contacts together.

    It is scaled by a power of two so that squares neither overflow nor underflow.
    """
    rows = values.reshape(len(values), -1)
    _, exponent = np.frexp(np.abs(rows).max(axis=1))
    scaled = np.ldexp(rows, -exponent[:, None])
    return np.asarray(np.ldexp(np.linalg.norm(scaled, axis=1), exponent))


def relative(distance: Array, size: Array) -> Array:
    """Return distance/size: 0 where the distance is 0, else NaN where the quotient is not finite."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.where(distance == 0.0, 0.0, distance / size)
    return np.where(np.isfinite(ratio), ratio, np.nan)


def relative_distance(values: Array, truth: Array) -> Array:
    """Return the L2 distance of each row from that of ``truth``, over the norm of ``truth``."""
    return relative(norms(values - truth), norms(truth))


def predictability(run: Callable[[Cases], Results], cases: Cases, displacement: Array, *, is_static: bool) -> Array:
    """Return the larger relative change of the displacement for a slightly wider or narrower gap, ``(case,)``.

    The gaps of all contacts change by 1e-12 of a length of the motion, the larger of the largest |d_i| and |x_i| in
    ``displacement``, ``(case, t)`` or ``(case, contact, t)``. Where narrower gaps would put the start inside the casing
    only the wider ones count; a static start moves with the gap. NaN where no perturbed run ended ok.
    """
    motion = displacement.reshape(cases.count, -1, displacement.shape[-1])
    trifle = GAP_SHARE * np.maximum(np.abs(cases.clearances).max(axis=1), np.abs(motion).max(axis=(1, 2)))
    change = np.full(cases.count, np.nan)
    outside = (motion[:, :, 0] <= cases.casing_of_contacts(0.0)[0] - trifle[:, None]).all(axis=1)
    may_close = np.ones(cases.count, dtype=bool) if is_static else outside
    for which, sign in ((np.arange(cases.count), 1.0), (np.flatnonzero(may_close), -1.0)):
        if which.size:
            part = cases.take(which)
            wider = sign * trifle[which]
            results = run(replace(part, gaps=part.gaps + wider[:, None]))
            moved = results.histories["displacement"].copy()
            moved[results.status != Status.OK] = np.nan
            change[which] = np.fmax(change[which], relative_distance(moved, displacement[which]))
    return change


def perturbed(cases: Cases, share: float, reach: float, contacts: Array) -> Cases:
    """Return cases with gaps, load and initial state perturbed by a share; no contact starts beyond the casing.

    With ``reach`` the largest displacement of a contact, m, a gap changes by the share of the larger of |gap| and it,
    the mean load by that of the larger of |mean| and the reach of harmonics: rounding decides whether a load presses
    where these are 0. A wider gap comes with a smaller mean: one sign reduces contact, the other increases it.
    ``contacts`` are the rows w_i of the displacements, ``(contact, mechanical)``.
    """
    displacement, gaps = cases.displacement * (1 + share), cases.gaps
    outside = project(contacts, cases.displacement) <= cases.casing_of_contacts(0.0)[0]
    moved = replace(cases, gaps=np.zeros_like(gaps)).casing_of_contacts(0.0)[0]
    gaps = gaps + share * np.maximum(np.abs(gaps), reach)
    gaps = np.where(outside, np.maximum(gaps, project(contacts, displacement) - moved), gaps)
    return replace(
        cases,
        gaps=gaps,
        mean=cases.mean - share * np.maximum(np.abs(cases.mean), cases.load_harmonics.reach),
        displacement=displacement,
        velocity=cases.velocity * (1 - share),
        temperature=cases.temperature * (1 + share),
        load_harmonics=cases.load_harmonics.scaled(1 - share),
    )
