"""Schemes compiled before they run: several at a time, each in a process of its own.

numba compiles one function at a time in a process. Where a run needs several schemes and nothing is
compiled, helper processes compile all but the first into the cache of kernels meanwhile, and the run
loads what they leave there. They are processes of this very module, which end as soon as the pipe to
their parent does; whatever goes wrong with one, its scheme is compiled in the run itself.
"""

from __future__ import annotations

import gc
import hashlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from workflow import models
from workflow.grid._costs import Part, compiling_part, measured
from workflow.grid._speed import remember
from workflow.kernels.cache import directory_of, is_lasting
from workflow.models import Cases, Harmonics
from workflow.schemes import Sampling, load


@dataclass(frozen=True)
class KernelVariant:
    """A scheme with options, on a small structure of a kind, with balances or without: what decides on its kernels."""

    method: str
    options: Any
    nodes: int
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
        return (self.method, self.nodes, self.balances, self.massless_tip, *driven, *others)


LONGEST = 300.0
"""Seconds a helper is waited for: some twenty times what compiling the largest scheme takes."""

_HELPERS: dict[str, Future[None]] = {}
"""By method: what is being compiled by others, or about to be."""


def compile_scheme(variant: KernelVariant, waiting: Callable[[], AbstractContextManager[None]] = nullcontext) -> None:
    """Run a scheme once, so that no case's wall time holds compilation; wait for others within ``waiting``."""
    helper = _HELPERS.get(variant.method)
    if helper is not None and not helper.cancel():  # it has begun: it is nearer to its end than we are
        with waiting():
            helper.result()
    _compile(variant)


@cache
def _compile(variant: KernelVariant) -> None:
    nodes = variant.nodes
    chain = models.load("chain")
    parameters = chain.Parameters(nodes, mass=1.0, stiffness=1.0, heat_capacity=1.0, spacing=1.0, expansion=1.0)
    structure = chain.assemble(parameters)
    if variant.massless_tip:
        structure = replace(structure.matrices(), mass=np.zeros((nodes, nodes)))
    if variant.slides:
        structure = replace(structure.matrices(), tangent=np.ones(nodes))
    if variant.coupled:
        structure = replace(structure.matrices(), load=np.ones(nodes))
    scheme = load(variant.method)
    none, one, node = np.zeros(1), np.ones(1), np.zeros((1, nodes))
    casing = Harmonics(*np.zeros((3, 1, int(variant.harmonics))))
    cases = Cases(none, one, one, none, none, none, none, node, node, node, node, node, casing_harmonics=casing)
    cases = replace(cases, friction=np.full(1, 0.5 * variant.slides))
    over = Sampling(1.0, 0.5, 3, balances=variant.balances)
    with measured(_part(variant)):
        scheme.compute(scheme.init(structure, 0.5, variant.options), cases, over)
    note = _note(variant)
    if note is not None:
        with suppress(OSError):
            note.touch()


def _part(variant: KernelVariant) -> Part:
    """Return loading compiled kernels, compiling the first of a scheme, or compiling others that share much with it."""
    if is_compiled(variant):
        return Part(1.0, (f"loading {variant.method}",))
    note = _note(variant)
    if note is not None and any(note.parent.glob("*.nbi")):
        return replace(compiling_part(variant.method), keys=("compiling more",))
    return compiling_part(variant.method)


def at_work() -> list[Future[None]]:
    """Return what others compile, or are about to, in their order."""
    return [helper for helper in list(_HELPERS.values()) if not helper.done()]


def is_compiled(variant: KernelVariant) -> bool:
    """Tell whether a scheme's kernels are in the cache."""
    note = _note(variant)
    return note is not None and note.exists()


def _note(variant: KernelVariant) -> Path | None:
    """Return the file whose presence says that a scheme's kernels are in the cache; ``None`` without a lasting one."""
    import llvmlite.binding

    directory = directory_of(type(variant.options).__module__) if is_lasting() else None
    if directory is None:
        return None
    words = (*variant.words, llvmlite.binding.get_host_cpu_name())
    return directory / f"{hashlib.sha256(repr(words).encode()).hexdigest()[:16]}.compiled"


@contextmanager
def compiled_ahead(variants: Sequence[KernelVariant], processes: int) -> Iterator[None]:
    """Compile schemes that are not compiled yet in up to so many processes; the first is left to the caller.

    The processes are gone when the context is left.
    """
    missing: dict[str, dict[tuple[Any, ...], KernelVariant]] = {}
    for variant in variants:
        note = _note(variant)
        if note is not None and not note.exists() and variant.method not in _HELPERS:
            missing.setdefault(variant.method, {}).setdefault(variant.words, variant)
    mine = list(missing)[1:] if processes > 0 else []
    if not mine:
        yield
        return
    running = _Running()
    with ThreadPoolExecutor(processes, thread_name_prefix="compile") as pool:
        try:
            for method in mine:
                _HELPERS[method] = pool.submit(running.help_with, list(missing[method].values()))
            yield
        finally:
            helpers = [_HELPERS.pop(method) for method in mine if method in _HELPERS]
            for helper in helpers:
                helper.cancel()
            running.end()


class _Running:
    """The helper processes of a run."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._processes: list[subprocess.Popen[bytes]] = []
        self._ended = False

    def help_with(self, variants: list[KernelVariant]) -> None:
        """Compile schemes in a process and wait for its end, whatever that is."""
        package = Path(__file__).parents[2]
        environment = dict(os.environ)
        environment["PYTHONPATH"] = os.pathsep.join([str(package), *filter(None, [environment.get("PYTHONPATH")])])
        command = [sys.executable, "-P", "-c", f"from {__name__} import main; main()"]
        with suppress(Exception):  # a helper costs time only
            with self._lock:
                if self._ended:
                    return
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    env=environment,
                )
                self._processes.append(process)
            with process:  # closes the pipe last
                assert process.stdin is not None
                process.stdin.write(pickle.dumps(variants))
                process.stdin.flush()
                try:
                    process.wait(LONGEST)
                finally:
                    process.kill()

    def end(self) -> None:
        """Kill what still runs; those who wait for it go on."""
        with self._lock:
            self._ended = True
            for process in self._processes:
                process.kill()


def _end_with_parent() -> None:
    """Wait for the end of the pipe from the parent, and end."""
    sys.stdin.buffer.read()
    os._exit(1)


def main() -> None:
    """Compile what the parent sends."""
    variants = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    gc.disable()  # a tenth of the time of a compiler that leaves little garbage; this process does nothing else
    for variant in variants:
        compile_scheme(variant)
    remember()
    os._exit(0)  # without waiting for the pipe
