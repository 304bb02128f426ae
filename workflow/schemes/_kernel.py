"""numba as every kernel here uses it, with a cache that notices a change in any of the sources.

numba checks its cache against the file of the compiled function alone. Kernels inline each other
across files, so a change in one file would leave old machine code running in another; the cache
therefore lies in a directory named by the hash of all of them. Where nothing lasting is writable
it is a temporary one.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from workflow.schemes._whole import InlinedCompiler, KernelCompiler, PartCompiler, RareCompiler, typed_alike

F = TypeVar("F", bound=Callable[..., Any])


_NAME = "kernels-"


@cache
def cache_directory() -> Path:
    """Return where compiled kernels of this very source are kept: ``NUMBA_CACHE_DIR`` or our own."""
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for source in sorted(here.glob("*.py")):
        digest.update(source.name.encode() + source.read_bytes())
    name = f"{_NAME}{digest.hexdigest()[:16]}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "rotor-stator-workflow"
    for parent in [Path(chosen)] if chosen else [here / "__pycache__", home]:
        directory = parent / name
        try:
            directory.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=directory):
                return directory
        except OSError:
            continue
    return Path(tempfile.mkdtemp(prefix="rotor-stator-workflow-"))


def is_lasting() -> bool:
    """Tell whether other processes find the same directory."""
    return cache_directory().name.startswith(_NAME)


def _compiled(function: F, **options: Any) -> F:
    """Compile at the first call; nothing but our own functions is sent to our cache."""
    config: Any = numba.config
    before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_directory())
    options |= {"nogil": True, "cache": True, "error_model": "numpy", "pipeline_class": KernelCompiler}
    options |= {"no_cfunc_wrapper": True}
    try:
        return cast(F, numba.njit(**options)(function))
    finally:
        config.CACHE_DIR = before


def _translated(function: F, compiler: type[InlinedCompiler], **options: Any) -> F:
    """Translate where a kernel calls it first: without an entry from Python and a cache of its own."""
    options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
    options |= {"nogil": True, "error_model": "numpy", "pipeline_class": compiler}
    return cast(F, typed_alike(numba.njit(**options)(function)))


def kernel(function: F) -> F:
    """Compile a kernel: cached, without the global interpreter lock, no fastmath, no prange.

    Divisions by zero give infinities as in NumPy: a kernel never raises, it sets a status.
    """
    return _compiled(function)


def inlined(function: F) -> F:
    """Translate a part of a kernel that is called in every step and must cost no call.

    It allocates nothing, and its arrays are not counted, see :func:`part`.
    """
    return _translated(function, InlinedCompiler, forceinline=True)


def uncounted(function: F) -> F:
    """Compile a kernel that allocates nothing: its arrays are not counted, see :func:`part`."""
    return _compiled(function, _nrt=False)


def part(function: F) -> F:
    """Translate a part of a kernel that only kernels call, and that allocates nothing.

    Its arrays are not counted: the two locked additions per array and call took longer than the
    arithmetic on rows of 20.
    """
    return _translated(function, PartCompiler)


def rare(function: F) -> F:
    """Translate a :func:`part` that runs rarely: apart from those that call it, and short rather than fast."""
    return _translated(function, RareCompiler)
