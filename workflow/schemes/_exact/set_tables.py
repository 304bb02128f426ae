"""Tables of the sets of closed contacts that the cases of a structure have met, at all α together."""

from __future__ import annotations

from threading import Lock

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.models import ContactBasis
from workflow.schemes._exact.between import between
from workflow.schemes._exact.closed_sets import ClosedSet, SetAnyAlpha, closed_set_of, row_length
from workflow.schemes._exact.events import INSEPARABLE, Sets

FULL = -3
"""What a table says that has no room for a set; a case goes on with a new one, in which it meets its sets again."""

MOST_BYTES = 2**29
"""Memory of the sets of a table."""

ROOM = 4
"""Sets for which a table has room at first."""

_AHEAD = 2**24
"""Memory of a set at α of cases to come, where all are made by one call."""


class SharedSets:
    """What the sets of closed contacts of a structure at one µ, duration and hardening have at all α."""

    def __init__(self, basis: ContactBasis, friction: float, *conditions: float):
        self.basis, self.friction, self._conditions, self._lock = basis, friction, conditions, Lock()
        self.between = between(basis, friction)
        self._sets: dict[bytes, SetAnyAlpha] = {}
        self._variants: dict[float, int] = {}

    def at_any_alpha(self, closed: NDArray[np.int8]) -> SetAnyAlpha:
        """Return a set at all α."""
        known = self._sets.get(closed.tobytes())
        if known is None:
            known = self._sets[closed.tobytes()] = SetAnyAlpha(self.basis, closed, self.friction, *self._conditions)
        return known

    def forget(self) -> None:
        """Free the memory of all sets; what a table has of them stays."""
        self._sets.clear()

    def variants(self, alpha: Array) -> NDArray[np.int64]:
        """Return the number of each α; those that are met first get the next ones."""
        values, which = np.unique(alpha, return_inverse=True)
        with self._lock:
            numbers = [self._variants.setdefault(value, len(self._variants)) for value in values.tolist()]
        return np.array(numbers)[which]

    @property
    def alphas(self) -> int:
        """Number of α that were met."""
        return len(self._variants)


class SetTable:
    """The sets of closed contacts that are known of a structure at one µ and duration; threads add in turns.

    A set stays where it is. Row 0 is that with all contacts open, which knows no α; none where it is not separable.
    """

    def __init__(self, shared: SharedSets):
        self.shared, self._lock, length = shared, Lock(), row_length(shared.basis)
        self.most = max(ROOM, MOST_BYTES // (8 * length))
        self._rows = np.empty((ROOM, length))
        self._closed = np.zeros((ROOM, shared.basis.contacts.count), dtype=np.int8)
        self._following = np.full(ROOM, -1)
        self._first: dict[int, int] = {}
        self._known: dict[tuple[bytes, float], int] = {}
        self.count = int(shared.at_any_alpha(self._closed[0]).fill(self._rows[:1], np.zeros(1))[0])

    def known(self) -> Sets:
        """Return all sets; they do not change."""
        with self._lock:
            first = np.full(self.shared.alphas, -1)
            first[list(self._first)] = list(self._first.values())
            return Sets(self._rows[: self.count], self._closed[: self.count], first, self._following[: self.count])

    def add(self, closed: NDArray[np.int8], alphas: Array) -> int:
        """Add a set at the first of some α, if it is not there; return 0, FULL, or how a case ends that cannot have it.

        Where one call makes it at all α it is added at the others too.
        """
        alpha, key = float(alphas[0]), closed.tobytes()
        with self._lock:
            if self.count == 0:
                return INSEPARABLE
            if not closed.any() or (key, alpha) in self._known:
                return 0
            if self.count == self.most:
                self.shared.forget()
                return FULL
            a_set, length = self.shared.at_any_alpha(closed), self._rows.shape[1]
            due = [value for value in dict.fromkeys(alphas.tolist()) if value > 0 and (key, value) not in self._known]
            ahead = max(1, min(self.most - self.count, _AHEAD // (8 * length))) if a_set.is_rank_one else 1
            self._fill(a_set, closed, np.array(due[:ahead] if alpha > 0 else [alpha]))
            return 0 if (key, alpha) in self._known else INSEPARABLE

    def find(self, closed: NDArray[np.int8], alpha: float) -> ClosedSet | None:
        """Return a set, which is added where it is not there; ``None`` where it cannot be had."""
        fault = self.add(closed, np.array([alpha]))
        if fault:
            return SetTable(self.shared).find(closed, alpha) if fault == FULL else None
        return closed_set_of(self._rows[self._known[closed.tobytes(), alpha] if closed.any() else 0])

    def _fill(self, a_set: SetAnyAlpha, closed: NDArray[np.int8], alphas: Array) -> None:
        """Add a set at those α at which its poles can be separated."""
        begin = self.count
        self._grow(begin + alphas.size)
        rows = self._rows[begin : begin + alphas.size]
        found = a_set.fill(rows, alphas)
        if not found.all():
            rows[: found.sum()] = rows[found]
        for value, variant in zip(alphas[found].tolist(), self.shared.variants(alphas[found]).tolist(), strict=True):
            self._closed[self.count], self._following[self.count] = closed, self._first.get(variant, -1)
            self._first[variant] = self.count
            self._known[closed.tobytes(), value] = self.count
            self.count += 1

    def _grow(self, count: int) -> None:
        """Make room for so many sets; those that are known are copied, others are not touched."""
        room = len(self._rows)
        if count > room:
            for name in ("_rows", "_closed", "_following"):
                old = getattr(self, name)
                new = np.empty((max(count, 2 * room), *old.shape[1:]), dtype=old.dtype)
                new[: self.count] = old[: self.count]
                setattr(self, name, new)
