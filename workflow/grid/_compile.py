"""Kernels of schemes compiled before they run, in shares that several processes may take.

numba compiles one function at a time in a process. A share is what one process compiles at a time: a kernel that the
scheme names apart, or all kernels of a scheme. Helper processes (:mod:`workflow.grid._helpers`) compile shares into the
cache of kernels; a run takes those that nobody has begun, waits for the others, and loads what they left.
"""

from __future__ import annotations

import hashlib
import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from workflow import models
from workflow.grid._costs import Part, compiling_part, compiling_parts, measured
from workflow.grid._waiting_for import COMPILING, waiting_for
from workflow.kernels.cache import directory_of, is_lasting
from workflow.models import Cases, Harmonics
from workflow.schemes import Sampling, Scheme, load


@dataclass(frozen=True)
class KernelVariant:
    """A scheme with options, on a small structure of a kind, with balances or without: what decides on its kernels."""

    method: str
    options: Any
    balances: bool
    massless_tip: bool = False
    harmonics: bool = False
    """Whether load or casing have harmonics."""
    slides: bool = False
    """Whether friction acts along a tangent."""
    coupled: bool = False
    """Whether the structure has to be stepped by its matrices."""

    @property
    def words(self) -> tuple[Any, ...]:
        """What kernels depend on: names and types of options, not their numbers."""
        options = ((field.name, getattr(self.options, field.name)) for field in fields(self.options))
        kinds = {"harmonics": self.harmonics, "sliding": self.slides, "coupled": self.coupled}
        driven = [name for name, holds in kinds.items() if holds]
        others = (option for option in options if not isinstance(option[1], float))
        return (self.method, self.balances, self.massless_tip, *driven, *others)


@dataclass(frozen=True, eq=False)
class Share:
    """Kernels of one scheme that one process compiles: those of a call that the scheme names, or of some variants."""

    variants: tuple[KernelVariant, ...]
    call: str = ""
    """One of the scheme's ``KERNEL_CALLS``, made for the first variant; empty where the scheme names none."""
    is_done: threading.Event = field(default_factory=threading.Event)

    @property
    def method(self) -> str:
        """The scheme's name."""
        return self.variants[0].method

    def compile(self) -> None:
        """Compile into the cache of kernels, but for what the scheme refuses."""
        if self.call:
            with suppress(Exception):
                scheme, arguments = _example(self.variants[0])
                with measured(compiling_parts(self.method)[self.call]):
                    scheme.KERNEL_CALLS[self.call](*arguments)
            return
        for variant in self.variants:
            _compile(variant)


def shares_of(variants: Sequence[KernelVariant]) -> list[Share]:
    """Return what processes can compile apart of one scheme's variants.

    Where the scheme names calls they are those of one variant, with balances if any has them: two processes that
    compile variants of a scheme would compile most kernels twice.
    """
    calls = load(variants[0].method).KERNEL_CALLS
    fullest = max(variants, key=lambda variant: variant.balances)
    return [Share((fullest,), call) for call in calls] or [Share(tuple(variants))]


class _Shares:
    """The shares of runs in this process: some that nobody has begun, some being compiled, some done."""

    def __init__(self) -> None:
        self._all: list[Share] = []
        self._unbegun: deque[Share] = deque()

    def add(self, shares: Iterable[Share]) -> None:
        """Add shares, those that are needed first first."""
        for share in shares:
            self._all.append(share)
            self._unbegun.append(share)

    def of(self, method: str) -> list[Share]:
        """Return the shares of a scheme."""
        return [share for share in list(self._all) if share.method == method]

    def take(self, share: Share) -> bool:
        """Take a share to compile it; tell whether nobody had begun it."""
        with suppress(ValueError):
            self._unbegun.remove(share)
            return True
        return False

    def take_next(self) -> Share | None:
        """Take the first share that nobody has begun."""
        with suppress(IndexError):
            return self._unbegun.popleft()
        return None

    def drop(self, shares: Iterable[Share]) -> None:
        """Drop shares: nobody waits for them any more."""
        for share in shares:
            self.take(share)
            self._all.remove(share)
            share.is_done.set()


SHARES = _Shares()


def compile_scheme(variant: KernelVariant, waiting: Callable[[], AbstractContextManager[None]] = nullcontext) -> None:
    """Compile what a scheme needs, so that no case's time holds it; wait for helper processes within ``waiting``.

    Nothing is raised: the case may be another than the one that is refused, and says itself why it fails.
    """
    shares = SHARES.of(variant.method)
    for share in reversed(shares):  # helpers begin with the first
        if SHARES.take(share):
            try:
                with waiting_for(COMPILING):
                    share.compile()
            finally:
                share.is_done.set()
    if not all(share.is_done.is_set() for share in shares):
        with waiting(), waiting_for(COMPILING):
            for share in shares:
                share.is_done.wait()
    _compile(variant)


@cache
def _compile(variant: KernelVariant) -> None:
    """Run a scheme once: it compiles all kernels that are not in the cache, and loads the others.

    What raises compiles nothing and leaves no note.
    """
    with suppress(Exception, SystemExit), waiting_for(COMPILING):
        scheme, arguments = _example(variant)
        with measured(_part(variant)):
            scheme.compute(*arguments)
        note = _note(variant)
        if note is not None:
            note.touch()


def _example(variant: KernelVariant) -> tuple[Scheme, tuple[Any, Cases, Sampling]]:
    """Return a scheme, and what its ``compute`` is called with for one small case of a kind."""
    chain = models.load("chain")
    parameters = chain.Parameters(1, mass=1.0, stiffness=1.0, heat_capacity=1.0, spacing=1.0, expansion=1.0)
    structure = chain.assemble(parameters)
    if variant.massless_tip:
        whole = structure.matrices()
        structure = replace(whole, mechanical=replace(whole.mechanical, inertia=np.zeros((1, 1))))
    if variant.slides:
        structure = replace(structure.matrices(), tangent=np.ones(1))
    if variant.coupled:
        structure = replace(structure.matrices(), load=np.ones(1))
    scheme = load(variant.method)
    none, one, node = np.zeros(1), np.ones(1), np.zeros((1, 1))
    casing = Harmonics(*np.zeros((3, 1, int(variant.harmonics))))
    cases = Cases(none, one, one, none, none, none, none, node, node, node, node, node, casing_harmonics=casing)
    cases = replace(cases, friction=np.full(1, 0.5 * variant.slides))
    over = Sampling(1.0, 0.5, 3, balances=variant.balances)
    return scheme, (scheme.init(structure, 0.5, variant.options), cases, over)


def _part(variant: KernelVariant) -> Part:
    """Return loading compiled kernels, compiling the first of a scheme, or compiling others that share much with it."""
    if is_compiled(variant) or SHARES.of(variant.method):
        return Part(1.0, (f"loading {variant.method}",))
    note = _note(variant)
    if note is not None and any(note.parent.glob("*.nbi")):
        return replace(compiling_part(variant.method), keys=("compiling more",))
    return compiling_part(variant.method)


def is_compiled(variant: KernelVariant) -> bool:
    """Tell whether a scheme's kernels are in the cache."""
    note = _note(variant)
    return note is not None and note.exists()


def is_missing(variant: KernelVariant) -> bool:
    """Tell whether a scheme's kernels could be in the cache and are not."""
    note = _note(variant)
    return note is not None and not note.exists()


def _note(variant: KernelVariant) -> Path | None:
    """Return the file whose presence says that a scheme's kernels are in the cache; ``None`` without a lasting one."""
    import llvmlite.binding

    directory = directory_of(type(variant.options).__module__) if is_lasting() else None
    if directory is None:
        return None
    words = (*variant.words, llvmlite.binding.get_host_cpu_name())
    return directory / f"{hashlib.sha256(repr(words).encode()).hexdigest()[:16]}.compiled"
