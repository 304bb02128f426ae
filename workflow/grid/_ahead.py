"""What a study's cases need compiled, and its compilation while a run gets ready."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from functools import partial
from typing import Any

from workflow.grid._arrangement import Grid
from workflow.grid._compile import KernelVariant
from workflow.grid._helpers import at_work, compiled_ahead
from workflow.grid._operators import kernel_variant
from workflow.grid._reference import exact_cell, reference_cell
from workflow.grid._turns import Turns
from workflow.study import Cell


def compiling(grid: Grid, processes: int) -> AbstractContextManager[None]:
    """Compile the schemes of a study but for the first that runs, in up to so many processes beside this one."""
    return compiled_ahead(list(kernel_variants(grid)) if processes > 0 else [], processes)


def is_compiling() -> bool:
    """Tell whether some kernels are being compiled beside this process: tasks may have to wait for them."""
    return bool(at_work())


def lend_turns(turns: Turns, most: int) -> None:
    """Lend so many turns to the processes that compile until they are done: sooner or later all wait for them."""
    for helper in at_work()[-most:] if most > 0 else []:
        turns.lend()
        helper.add_done_callback(lambda _: turns.take_back())


def kernel_variants(grid: Grid) -> Iterator[KernelVariant]:
    """Yield what the first case of each scheme needs, and its references; what other cases need is compiled for them.

    A case that cannot even be set up needs nothing: it will say so itself.
    """
    cells: list[tuple[Callable[[], Cell], bool]] = []
    labels = [value for dim in grid.outer for axis in dim.axes if axis.path == "scheme" for value in axis.values]
    for label in labels or [grid.base["scheme"]]:
        cells.append((partial(grid.settings, 0, {"scheme": label}), grid.sampling.balances))
    if grid.study.reference is not None:
        cells += [(partial(reference_cell, grid, 0), False), (partial(exact_cell, grid, 0), False)]
    seen: set[tuple[Any, ...]] = set()
    for cell, balances in cells:
        with suppress(Exception):
            variant = kernel_variant(cell(), balances)
            if variant is not None and variant.words not in seen:
                seen.add(variant.words)
                yield variant
