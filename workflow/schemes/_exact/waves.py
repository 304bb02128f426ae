"""Where the waves of load and casing are at a time."""

from __future__ import annotations

from workflow.kernels import elementary
from workflow.kernels.compiled import inlined, part
from workflow.models import Array
from workflow.schemes._exact import wave_table as wave


@part
def _turn(waves: Array, i: int, t: float) -> None:
    """Put cosine and sine of the phase Ω t + φ of a wave into its table."""
    waves[i, wave.TIME] = t
    waves[i, wave.SIN], waves[i, wave.COS] = elementary.sine_cosine(waves[i, wave.OMEGA] * t + waves[i, wave.PHASE])


@inlined
def wave_phase(waves: Array, i: int, t: float) -> tuple[float, float]:
    """Return cosine and sine of the phase of a wave; those of the last time asked for are kept."""
    if waves[i, wave.TIME] != t:
        _turn(waves, i, t)
    return waves[i, wave.COS], waves[i, wave.SIN]


@part
def casing_at(waves: Array, gap: float, t: float) -> tuple[float, float]:
    """Return the place of the casing d = d0 + Σ a sin ψ, m, and its velocity, m/s; ``gap`` is d0."""
    place, speed = gap, 0.0
    for i in range(waves.shape[0]):
        cos, sin = wave_phase(waves, i, t)
        place += waves[i, wave.CASING] * sin
        speed += waves[i, wave.OMEGA] * (waves[i, wave.CASING] * cos)
    return place, speed
