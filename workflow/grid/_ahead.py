"""What a study's cases need compiled."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial

from workflow.grid._arrangement import Grid
from workflow.grid._compile import KernelVariant
from workflow.grid._operators import kernel_variant
from workflow.grid._reference_solutions import exact_settings, reference_settings
from workflow.study import CaseSettings


def kernel_variants(grid: Grid) -> list[KernelVariant]:
    """Return what the first case of each scheme needs, and its references; what others need is compiled for them.

    A case that cannot even be set up needs nothing: it will say so itself.
    """
    every: list[tuple[Callable[[], CaseSettings], bool]] = [
        (partial(grid.settings, outer), grid.sampling.balances) for outer in grid.kinds(lambda path: path == "scheme")
    ]
    if grid.study.reference is not None:
        every += [(partial(reference_settings, grid, 0), False), (partial(exact_settings, grid, 0), False)]
    variants: dict[object, KernelVariant] = {}
    for settings, balances in every:
        with suppress(Exception):
            variant = kernel_variant(settings(), balances)
            if variant is not None:
                variants.setdefault(variant.words, variant)
    return list(variants.values())
