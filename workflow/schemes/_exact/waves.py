"""Phases of the waves of load and casing."""

from __future__ import annotations

from workflow.kernels import Array, elementary
from workflow.kernels.compiled import inlined, part
from workflow.schemes._exact.tables import wave


@part
def _evaluate(waves: Array, i: int, t: float) -> None:
    """Store cosine and sine of the phase Ω t + φ of a wave in its table, and keep those of the last time."""
    cos, sin = waves[i, wave.COS_BEFORE], waves[i, wave.SIN_BEFORE]
    if waves[i, wave.TIME_BEFORE] != t:
        sin, cos = elementary.sine_cosine(waves[i, wave.OMEGA] * t + waves[i, wave.PHASE])
    waves[i, wave.TIME_BEFORE] = waves[i, wave.TIME]
    waves[i, wave.COS_BEFORE], waves[i, wave.SIN_BEFORE] = waves[i, wave.COS], waves[i, wave.SIN]
    waves[i, wave.TIME], waves[i, wave.COS], waves[i, wave.SIN] = t, cos, sin


@inlined
def wave_phase(waves: Array, i: int, t: float) -> tuple[float, float]:
    """Return cosine and sine of the phase of a wave; those of the last two times are cached."""
    if waves[i, wave.TIME] != t:
        _evaluate(waves, i, t)
    return waves[i, wave.COS], waves[i, wave.SIN]
