"""Compilation of kernels before cases run, so that no case's processor time includes it; one process helps.

numba compiles one function at a time in a process. The helper is a process of this very module: it compiles what it is
given into the cache of kernels and answers each with a line; a run loads what it left. Where it fails the run compiles.
"""

from __future__ import annotations

import gc
import hashlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from workflow import models
from workflow.grid._speed import untimed
from workflow.grid._waiting_for import COMPILING, waiting_for
from workflow.kernels.cache import directory_of, is_lasting
from workflow.models import Cases, Harmonics
from workflow.schemes import Sampling, Scheme, load


@dataclass(frozen=True)
class KernelVariant:
    """A scheme with options, on a small structure of a kind, with balances or without: what its kernels depend on."""

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


@cache
def compile_scheme(variant: KernelVariant) -> None:
    """Run a scheme once: it compiles the kernels that are not in the cache, and loads the others.

    Nothing is raised: the case may be another than the one that is refused, and says itself why it fails.
    """
    with waiting_for(COMPILING), untimed(), suppress(Exception, SystemExit):
        _HELPER.wait_for(variant)
        scheme, arguments = _example(variant)
        scheme.compute(*arguments)
        note = _note(variant)
        if note is not None:
            note.touch()


@contextmanager
def compiled_ahead(variants: Sequence[KernelVariant]) -> Iterator[None]:
    """Compile what the run does not begin with in a helper process, which ends with the context.

    Of a scheme that names its large kernels apart (``KERNEL_CALLS``) the helper takes the first, the run the others.
    """
    missing = [variant for variant in variants if is_missing(variant)]
    parts = [(variant, next(iter(load(variant.method).KERNEL_CALLS), "")) for variant in missing]
    parts = [(variant, call) for place, (variant, call) in enumerate(parts) if place > 0 or call]
    if not parts:
        yield
        return
    _HELPER.start(parts)
    try:
        yield
    finally:
        _HELPER.end()


class _Helper:
    """The helper process of this process, and what it compiles."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._done: dict[str, threading.Event] = {}

    def start(self, parts: list[tuple[KernelVariant, str]]) -> None:
        """Start a process that compiles variants of schemes, or one call of them; none where that fails."""
        package = Path(__file__).parents[2]
        paths = os.pathsep.join([str(package), *filter(None, [os.environ.get("PYTHONPATH")])])
        with suppress(Exception):
            content = pickle.dumps(parts)
            self._process = process = subprocess.Popen(
                [sys.executable, "-P", "-c", f"from {__name__} import main; main()"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": paths},
            )
            self._done = {variant.method: threading.Event() for variant, _ in parts}
            threading.Thread(target=self._follow, args=(process, parts, content), daemon=True).start()

    def _follow(self, process: subprocess.Popen[bytes], parts: list[tuple[KernelVariant, str]], content: bytes) -> None:
        """Set the event of each scheme that the process reports as compiled, and all events when it ends."""
        assert process.stdin is not None
        assert process.stdout is not None
        done = self._done
        with suppress(OSError):
            process.stdin.write(content)
            process.stdin.flush()
            methods = [variant.method for variant, _ in parts]
            while methods and process.stdout.readline() == _DONE:
                method = methods.pop(0)
                if method not in methods:
                    done[method].set()
        for event in done.values():
            event.set()

    def wait_for(self, variant: KernelVariant) -> None:
        """Compile the calls of a scheme that the helper does not, then wait for the helper to have compiled its own."""
        done = self._done.get(variant.method)
        if done is None:
            return
        if not done.is_set():
            for call in list(load(variant.method).KERNEL_CALLS)[1:]:
                _compile(variant, call)
        done.wait()

    def end(self) -> None:
        """End the process, which sets all events."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
        self._process = None
        self._done = {}


_HELPER = _Helper()

_DONE = b"done\n"


def main() -> None:
    """Compile what the parent sends, and end with its pipe."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what a scheme prints
    parts = pickle.load(sys.stdin.buffer)
    threading.Thread(target=lambda: (sys.stdin.buffer.read(), os._exit(0)), daemon=True).start()
    gc.disable()  # a tenth of the time of a compiler that leaves little garbage; this process does nothing else
    for variant, call in parts:
        _compile(variant, call)
        answers.write(_DONE)


def _compile(variant: KernelVariant, call: str) -> None:
    """Compile a scheme, or one of the calls that need a large kernel alone."""
    if not call:
        compile_scheme(variant)
        return
    with suppress(Exception):
        scheme, arguments = _example(variant)
        scheme.KERNEL_CALLS[call](*arguments)


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
