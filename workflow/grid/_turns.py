"""Threads that take turns at the processors: while one waits for others' results, another computes."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType


class Over(BaseException):
    """There are no more turns: a run was interrupted. No :class:`Exception`, which would become a case's result."""


class Turns:
    """As many threads at a time within this context as there are turns."""

    def __init__(self, count: int):
        self._free = threading.BoundedSemaphore(count)
        self._over = False

    def end(self) -> None:
        """Give no more turns: threads that wait for one end by :class:`Over`."""
        self._over = True

    def lend(self) -> None:
        """Let one thread fewer have a turn, until it is taken back."""
        self._free.acquire()

    def take_back(self) -> None:
        """End what :meth:`lend` began."""
        self._free.release()

    def __enter__(self) -> None:
        self._free.acquire()
        if self._over:
            self._free.release()
            raise Over
        _OWN.turns = self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if _OWN.turns is self:  # not where it was given away and none came back
            _OWN.turns = None
            self._free.release()


class _Own(threading.local):
    turns: Turns | None = None


_OWN = _Own()
"""The turns of which this thread has one."""


@contextmanager
def waiting() -> Iterator[None]:
    """Let another thread have the turn of this one, where it has one, and take one again."""
    turns = _OWN.turns
    if turns is None:
        yield
        return
    turns.__exit__(None, None, None)
    try:
        yield
    finally:
        turns.__enter__()
