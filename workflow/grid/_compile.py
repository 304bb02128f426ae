"""Compilation of kernels before cases run, so that no case's processor time includes it; one process helps.

numba compiles one function at a time in a process. The helper is a process of this very module: it compiles what it is
given into the cache of kernels and notes it there; a run loads what it left. Where it fails the run compiles.
"""

from __future__ import annotations

import gc
import hashlib
import os
import pickle
import subprocess
import sys
import threading
import time
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
        kinds = (getattr(self, field.name) for field in fields(self) if field.name != "options")
        return (*kinds, *(option for option in options if not isinstance(option[1], float)))


_Part = tuple[KernelVariant, str]
"""A variant and the call that needs one of its large kernels alone, empty for all of it."""

_HELPER: list[tuple[subprocess.Popen[bytes], list[_Part]]] = []
"""The helper process while it runs, and what it compiles, in this order."""


@cache
def compile_scheme(variant: KernelVariant) -> None:
    """Run a scheme once: it compiles the kernels that are not in the cache, and loads the others.

    Of what the helper compiles the calls that it leaves are compiled here, then the helper is waited for.
    """
    with waiting_for(COMPILING), untimed():
        for process, parts in _HELPER:
            notes = [_note(*part) for part in parts if part[0].method == variant.method]
            for call in list(load(variant.method).KERNEL_CALLS)[1:] if notes else ():
                _compile(variant, call)
            while process.poll() is None and not all(note is None or note.exists() for note in notes):
                time.sleep(0.02)
        _compile(variant)


@contextmanager
def compiled_ahead(variants: Sequence[KernelVariant]) -> Iterator[None]:
    """Compile what the run does not begin with in a helper process, which ends with the context.

    Of a scheme that names its large kernels apart (``KERNEL_CALLS``) the helper takes the first, the run the others.
    """
    missing = [variant for variant in variants if is_missing(variant)]
    parts = [(variant, next(iter(load(variant.method).KERNEL_CALLS), "")) for variant in missing]
    parts = [part for place, part in enumerate(parts) if place > 0 or part[1]]
    if parts:
        with suppress(Exception):
            _HELPER.append((_started(parts), parts))
    try:
        yield
    finally:
        while _HELPER:
            process, _ = _HELPER.pop()
            process.kill()
            process.communicate()


def _started(parts: list[_Part]) -> subprocess.Popen[bytes]:
    """Start the helper process."""
    content = pickle.dumps(parts)
    paths = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])])
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", f"from {__name__} import main; main()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": paths},
    )
    with suppress(OSError):
        assert process.stdin is not None
        process.stdin.write(content)
        process.stdin.flush()
    return process


def main() -> None:
    """Compile what the parent sends, and end with its pipe."""
    parts = pickle.load(sys.stdin.buffer)
    threading.Thread(target=lambda: (sys.stdin.buffer.read(), os._exit(0)), daemon=True).start()
    gc.disable()  # a tenth of the time of a compiler that leaves little garbage; this process does nothing else
    for part in parts:
        _compile(*part)


def _compile(variant: KernelVariant, call: str = "") -> None:
    """Compile a scheme, or what one of its calls needs, and note that it is in the cache.

    Nothing is raised: the case may be another than the one that is refused, and says itself why it fails.
    """
    with suppress(Exception, SystemExit):
        scheme, arguments = _example(variant)
        (scheme.KERNEL_CALLS[call] if call else scheme.compute)(*arguments)
        note = _note(variant, call)
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


def is_missing(variant: KernelVariant) -> bool:
    """Tell whether a scheme's kernels could be in the cache and are not."""
    note = _note(variant)
    return note is not None and not note.exists()


def _note(variant: KernelVariant, call: str = "") -> Path | None:
    """Return the file whose presence says that kernels are in the cache; ``None`` without a lasting one."""
    import llvmlite.binding

    directory = directory_of(type(variant.options).__module__) if is_lasting() else None
    if directory is None:
        return None
    words = (*variant.words, call, llvmlite.binding.get_host_cpu_name())
    return directory / f"{hashlib.sha256(repr(words).encode()).hexdigest()[:16]}.compiled"
