"""Steady rubs of the exact scheme: where a rub settles, how stable it is, and whether it runs away."""

from workflow.orbits._steady import Options, Rub, steady_rub

__all__ = ["Options", "Rub", "steady_rub"]
