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
from workflow.cases import COMPILING, waiting_for
from workflow.kernels.compiled import directory_of
from workflow.models import Cases, Coating, Contacts, Harmonics
from workflow.schemes import Sampling, load


@dataclass(frozen=True)
class KernelVariant:
    """A scheme with options, on a small structure of a kind, with balances or without: what its kernels depend on."""

    method: str
    options: Any
    balances: bool
    harmonics: bool = False
    """Whether load or casing have harmonics."""
    slides: bool = False
    """Whether friction acts along a tangent."""
    coupled: bool = False
    """Whether the structure has to be stepped by its matrices."""
    contacts: bool = False
    """Whether it has several contacts."""
    compliant: bool = False
    """Whether contacts have no mass, or an elastic casing."""
    coated: bool = False
    """Whether its casing has a coating."""

    @property
    def words(self) -> tuple[Any, ...]:
        """What kernels depend on: names and types of options, not their numbers."""
        options = ((field.name, getattr(self.options, field.name)) for field in fields(self.options))
        kinds = (getattr(self, field.name) for field in fields(self) if field.name != "options")
        return (*kinds, *(option for option in options if not isinstance(option[1], float)))


_HELPER: list[tuple[subprocess.Popen[bytes], Sequence[KernelVariant]]] = []
"""The helper process while it runs, and what it compiles, in this order."""


@cache
def compile_scheme(variant: KernelVariant) -> None:
    """Run a scheme once: it compiles the kernels that are not in the cache, and loads the others.

    What the helper compiles of the scheme is waited for.
    """
    with waiting_for(COMPILING):
        for process, variants in _HELPER:
            same = [helped for helped in variants if helped.method == variant.method]
            while process.poll() is None and any(map(is_missing, same)):
                time.sleep(0.02)
        _compile(variant)


@contextmanager
def compiled_ahead(variants: Sequence[KernelVariant]) -> Iterator[None]:
    """Compile all but the first of what is missing in a helper process, which ends with the context."""
    helped = [variant for variant in variants if is_missing(variant)][1:]
    if helped:
        with suppress(Exception):
            _HELPER.append((_started(helped), helped))
    try:
        yield
    finally:
        while _HELPER:
            process, _ = _HELPER.pop()
            process.kill()
            process.communicate()


def _started(variants: Sequence[KernelVariant]) -> subprocess.Popen[bytes]:
    """Start the helper process."""
    content, null = pickle.dumps(variants), subprocess.DEVNULL
    code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import main; main()"
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=null, stderr=null)
    assert process.stdin is not None
    with suppress(OSError):  # it has ended
        process.stdin.write(content)
        process.stdin.flush()
    return process


def main() -> None:
    """Compile what the parent sends, and end with its pipe."""
    variants = pickle.load(sys.stdin.buffer)
    threading.Thread(target=lambda: (sys.stdin.buffer.read(), os._exit(0)), daemon=True).start()
    gc.disable()  # a tenth of the time of a compiler that leaves little garbage; this process does nothing else
    for variant in variants:
        _compile(variant)


def _compile(variant: KernelVariant) -> None:
    """Run a scheme for one small case, and note that its kernels are in the cache.

    Nothing is raised: the case may be another than the one that is refused, and says itself why it fails.
    """
    with suppress(Exception, SystemExit):
        _run(variant)
        note = _note(variant)
        if note is not None:
            note.touch()


def _run(variant: KernelVariant) -> None:
    """Run a scheme for one small case of a kind."""
    chain = models.load("chain")
    parameters = chain.Parameters(1, mass=1.0, stiffness=1.0, heat_capacity=1.0, spacing=1.0, expansion=1.0)
    whole = chain.assemble(parameters).matrices()
    one, node, rows = np.ones(1), np.zeros((1, 1)), np.array([[1.0], [-1.0]] if variant.contacts else [[1.0]])
    labels, slides = ("tip", "other stop")[: len(rows)], float(variant.slides)
    contacts = Contacts(labels, rows, slides * rows, np.abs(rows), np.zeros(len(rows)))
    contacts = replace(contacts, casing_flexibility=float(variant.compliant))
    structure = replace(whole, load=np.ones(1) if variant.coupled else None, contacts=contacts)
    scheme, none = load(variant.method), np.zeros(1)
    harmonics, friction = Harmonics(*np.zeros((3, 1, int(variant.harmonics)))), np.full(1, 0.5 * variant.slides)
    cases = Cases(none, one, np.ones((1, len(rows))), none, node, node, node, node, node, casing_harmonics=harmonics)
    if variant.coated:
        cases = replace(
            cases, coating=Coating(one, none, one, none, np.zeros((1, len(rows))), np.zeros((1, len(rows), 1)))
        )
    operator, over = scheme.init(structure, 0.5, variant.options), Sampling(1.0, 0.5, 3, balances=variant.balances)
    scheme.compute(operator, replace(cases, friction=friction), over)


def is_missing(variant: KernelVariant) -> bool:
    """Tell whether a scheme's kernels could be in the cache and are not."""
    note = _note(variant)
    return note is not None and not note.exists()


def _note(variant: KernelVariant) -> Path | None:
    """Return the file whose presence says that kernels are in the cache; ``None`` where none are kept."""
    import llvmlite.binding

    directory = directory_of(type(variant.options).__module__)
    name = hashlib.sha256(repr((variant.words, llvmlite.binding.get_host_cpu_name())).encode()).hexdigest()[:16]
    return None if directory is None else directory / f"{name}.compiled"
