"""Two results of one case compared: to the bit, or within what rounding makes of that very case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.grid import Grid, Perturbation, Solved, exact_motion, solve
from workflow.schemes import Status
from workflow.variables import BY_NAME, COMPARED

Values = Mapping[str, NDArray[Any]]

TIMES = 30.0
"""Other libraries may change a result by so many times what a change of all data by 1e-12 does: the latter is one
direction of many, and roundings are made all along the way. Kernels of Nehalem for those of Haswell make up to 30
times of it in the studies of ``studies/hard``."""

ROUNDED = 1e-12
"""Added, as a share of a variable's largest value: changes of data may cancel where roundings do not, as in a rate of
conductance over capacity. Shares, errors and residuals take it as it is: small differences of large numbers."""

_SHARES = ("_error", "_residual", "predictability")
"""Ends of the names of what is relative itself."""

MOTION = ("displacement", "velocity", "temperature", "impulse", "contact_force", "contact_impulse")
"""Variables whose lost digits are reported: all others follow from them."""

FOLLOWED, CONVERGED = 1e-6, 1e-9
"""In the place of :data:`ROUNDED` along branches, whose steps are adapted, and for steady rubs, which Newton's method
approaches to 1e-10."""


def followed(values: Values) -> dict[str, float]:
    """Return by how much each number of a branch may differ elsewhere."""
    return {name: FOLLOWED * _size(name, values) for name, array in values.items() if array.dtype.kind == "f"}


def _size(name: str, values: Values) -> float:
    """Return what a variable's differences are measured by: its largest value, 1 where it is a share itself."""
    return 1.0 if name.endswith(_SHARES) else _largest(values[name])


def sensitivity(grid: Grid, outer: int, inner: NDArray[np.int64], solved: Solved) -> dict[str, float]:
    """Return by how much each number of a case may differ elsewhere: it is run twice more with its data changed.

    What errors are measured against, which is not run again, is taken to answer to the change as the case itself does,
    or, of a case that did not end ok, as the exact solution of its reduced model.
    """
    reach = _largest(solved.values["displacement"])
    blown_up = grid.study.reference is not None and int(solved.values["status"][0]) != Status.OK
    exact = exact_motion(grid, outer, inner) if blown_up else solved.values
    spread: dict[str, float] = {}
    moved: dict[str, float] = {}
    for direction in (1, -1):
        changed = solve(grid, outer, inner, Perturbation(direction, reach)).values
        for name, new in changed.items():
            if new.dtype.kind == "f":
                spread[name] = max(spread.get(name, 0.0), _largest_change(solved.values[name], new))
        changed_exact = Perturbation(direction, _largest(exact["displacement"]))
        again = exact_motion(grid, outer, inner, changed_exact) if blown_up else changed
        for name in COMPARED:
            moved[name] = max(moved.get(name, 0.0), _share_changed(exact[name], again[name]))
    own = float(np.nan_to_num(solved.values.get("predictability", np.zeros(1)))[0])
    allowed = {}
    for name, change in spread.items():
        reference = own if name.endswith("_error") or name == "predictability" else 0.0
        reference += moved.get(name.split("_")[0], 0.0) if name.endswith("_error") else 0.0  # else of a choice, stored
        steady = name in BY_NAME and BY_NAME[name].condition == "steady"
        allowed[name] = TIMES * (change + reference) + (CONVERGED if steady else ROUNDED) * _size(name, solved.values)
    return allowed


def _largest(values: NDArray[Any]) -> float:
    """Return the largest finite size of an entry, 0 without any."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _share_changed(old: NDArray[Any], new: NDArray[Any]) -> float:
    """Return the relative L2 change of a history; 0 where it or what it is measured by is no finite number."""
    size = float(np.linalg.norm(old))
    change = float(np.linalg.norm(new - old))
    return change / size if size > 0 and np.isfinite(change) and np.isfinite(size) else 0.0


def _largest_change(old: NDArray[Any], new: NDArray[Any]) -> float:
    """Return the largest change of an entry; infinite where one of the two is no finite number."""
    same = (old == new) | (np.isnan(old) & np.isnan(new))
    with np.errstate(invalid="ignore"):
        change = np.where(same, 0.0, np.abs(old - new))
    return float(np.where(np.isnan(change), np.inf, change).max(initial=0.0))


def differences(stored: Values, again: Values, allowed: Mapping[str, float] | None = None) -> Iterator[str]:
    """Yield, for each variable that differs, its stored and its new value at the first entry that does.

    ``allowed`` is what numbers may differ by, see :func:`sensitivity`; to the bit where it is not given.
    """
    for name, new in again.items():
        old = stored[name]
        same = (old == new) | (np.isnan(old) & np.isnan(new)) if old.dtype.kind == "f" else old == new
        if allowed is not None and old.dtype.kind == "f":
            single = 2.0**-23 * np.abs(new) if old.dtype.itemsize == 4 else 0.0  # stored in single precision
            with np.errstate(invalid="ignore"):
                same |= np.abs(old - new) <= allowed[name] + single
            same |= np.isinf(allowed[name])
        if not np.all(same):
            at = int(np.argmax(~same.ravel()))
            yield f"{name} is {old.ravel()[at].item()!r} in the archive, {new.ravel()[at].item()!r} now"


def without_digits(again: Values, allowed: Mapping[str, float]) -> list[str]:
    """Return which of the stored numbers of a case rounding changes by as much as they are."""
    names = []
    for name in MOTION:
        if name in again:
            scale = _largest(again[name])
            if scale > 0 and allowed[name] >= scale:
                names.append(name)
    return names
