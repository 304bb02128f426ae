"""Decorators of kernels: numba is imported at the first call of a kernel, and machine code is cached by its sources.

The decorators return a :class:`Deferred`, which numba compiles when it is first called: reading a study or an archive
needs no kernel, and importing numba takes longer than either.

Kernels inline functions, constants and named tuples of other modules, so that machine code is valid as long as none of
the sources changes that its module imports, directly or not. Its directory is named by a digest of these, and of the
versions of Python and numba; for a module from outside by all physics packages and its own package. Directories that no
process has used for a day are removed, so that a switch between two states needs no new compilation.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import shutil
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, update_wrapper
from importlib.metadata import version
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast
from uuid import uuid4

from workflow.registry import source_digest

if TYPE_CHECKING:
    from numba.core.caching import FunctionCache

F = TypeVar("F", bound=Callable[..., Any])
N = TypeVar("N", bound=tuple[Any, ...])

PLAIN = "WORKFLOW_PLAIN_NUMBA"
"""Environment variable that selects numba's own compiler."""

TESTED = ("0.68",)
"""Minor versions of numba with which :mod:`workflow.kernels.whole_program`, which uses its internals, was tested."""

UNUSED_SECONDS = 24 * 3600.0

_WITHOUT_KERNELS = {"judges", "study", "cases", "solve", "plan", "archive", "run", "analysis", "plots"}
_WITHOUT_KERNELS |= {"report", "cli", "examples"}
"""Directories of the package that no module with kernels imports."""

_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+)?import[ \t]+(\([^)]*\)|.*)", re.MULTILINE)
"""An import: the package, and the names. A syntax tree of all sources takes a tenth of a second longer."""

_LOADING = RLock()


def _read_sources() -> dict[str, str]:
    """Return the sources of this package by the names of their modules."""
    root, sources = Path(__file__).parents[1], {}
    for path in root.rglob("*.py"):
        place = path.relative_to(root.parent)
        if place.parts[1] not in _WITHOUT_KERNELS:
            module = place.parent if place.name == "__init__.py" else place.with_suffix("")
            sources[".".join(module.parts)] = path.read_text(encoding="utf-8")
    return sources


_SOURCES = _read_sources()
"""Sources at the start of the process: one that changes later is not the one that was imported."""


@cache
def _imported(module: str) -> frozenset[str]:
    """Return the modules of this package that a module imports."""
    found = set()
    for package, names in _IMPORT.findall(_SOURCES[module]):
        found |= {package, *(f"{package}.{name}".lstrip(".") for name in re.findall(r"[\w.]+", names))}
    return frozenset(found & _SOURCES.keys())


def _closure(module: str) -> set[str]:
    """Return the modules of this package that a module imports, directly or not, and itself."""
    found: set[str] = set()
    due = {module}
    while due:
        found |= due
        due = {name for each in due for name in _imported(each)} - found
    return found


@cache
def directory_of(module: str) -> Path | None:
    """Return the cache directory for the kernels of an imported module; ``None`` where there is none.

    It is below ``NUMBA_CACHE_DIR`` where that is set, else next to the sources or in the user's cache. There is none
    where the module's source is no file, or no directory can be written.
    """
    is_ours = module in _SOURCES
    source = module if is_ours else source_digest(module.split(".")[0])
    if source is None:
        return None
    used = [(name, _SOURCES[name]) for name in sorted(_closure(module) if is_ours else _SOURCES)]
    state = used, source, sys.version_info[:3], version("numba"), bool(os.environ.get(PLAIN))
    name = hashlib.sha256(repr(state).encode()).hexdigest()[:16]
    of_user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    for parent in [Path(chosen)] if chosen else [Path(__file__).parent / "__pycache__", of_user]:
        with suppress(OSError, RuntimeError):  # it cannot be written, or the user has no home
            directory = parent.expanduser() / "rotor-stator-workflow" / name
            directory.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=directory):
                os.utime(directory)
            _remove_unused(directory.parent)
            return directory
    return None


def _remove_unused(root: Path) -> None:
    """Remove the directories that no process has used for :data:`UNUSED_SECONDS`."""
    for directory in root.iterdir():
        with suppress(OSError):  # another process removes it
            if time.time() - directory.stat().st_mtime > UNUSED_SECONDS:
                shutil.rmtree(directory, ignore_errors=True)


class CompilerError(Exception):
    """Numba cannot be used in this process, whatever it is to compile; the message says why."""


class Deferred:
    """A function that numba compiles or translates at its first use."""

    def __init__(self, function: Callable[..., Any], make: Callable[[Callable[..., Any]], Any]):
        self._function, self._make, self._dispatcher = function, make, None
        update_wrapper(self, function)

    @property
    def dispatcher(self) -> Any:
        """Numba's dispatcher of the function; its first use imports numba, or raises :class:`CompilerError`."""
        if self._dispatcher is None:
            with _LOADING:
                try:
                    _extend_numba()
                    self._dispatcher = self._dispatcher or self._make(self._function)
                except Exception as error:
                    given = [f"{name}={value}" for name, value in os.environ.items() if name.startswith("NUMBA_")]
                    where = f"the environment has {', '.join(given) or 'no NUMBA_ variable'}"
                    raise CompilerError(f"numba cannot be used here: {error}; {where}") from error
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        """Numba's type of the function, for kernels that call it."""
        return self.dispatcher._numba_type_

    def __call__(self, *args: Any) -> Any:
        """Run the compiled function."""
        return (self._dispatcher or self.dispatcher)(*args)


@cache
def _whole_program() -> ModuleType | None:
    """Return the module that compiles kernels and their parts as one program; ``None`` without a tested numba."""
    import numba

    if os.environ.get(PLAIN) or ".".join(numba.__version__.split(".")[:2]) not in TESTED:
        return None
    from workflow.kernels import whole_program

    return whole_program


def _options(**options: Any) -> dict[str, Any]:
    """Return numba's options: those given and those of all kernels and parts, which count no references of arrays."""
    program = _whole_program()
    if program is not None:
        options["pipeline_class"] = program.KernelCompiler
    usual = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False, "forceinline": False}
    return {**usual, **options}  # forceinline is given, else numba takes that of the function that is being compiled


_PART = {"no_cpython_wrapper": True}
"""Options of functions that only kernels call: no entry from Python."""


class _CacheLocator:
    """Where numba finds a kernel's machine code, see :func:`directory_of`: it is never out of date."""

    def __init__(self, directory: Path, module: str, file: str):
        self._directory, self._module, self._py_file = directory, module, file  # numba names the file in its warnings

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> Self | None:
        directory = directory_of(function.__module__)
        return None if directory is None else cls(directory, function.__module__, file)

    def ensure_cache_path(self) -> None:
        self._directory.mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(self._directory)

    def get_source_stamp(self) -> str:
        return self._directory.name

    def get_disambiguator(self) -> str:
        return self._module  # instead of the function's first line: numba itself stores only a module's last name


class _Checked:
    """A pickle that is compared with its checksum before it is read: changed machine code ends the process."""

    def __init__(self, image: bytes):
        self._image = image

    def __reduce__(self) -> tuple[Any, ...]:
        return _unchanged, (zlib.crc32(self._image), self._image)


def _unchanged(crc: int, image: bytes) -> Any:
    """Return what a pickle holds that has this checksum."""
    if zlib.crc32(image) != crc:
        raise ValueError("checksum")
    return pickle.loads(image)


@cache
def _cache_type() -> type[FunctionCache]:
    """Return the type of numba's function cache with our location and checksums."""
    from numba.core.caching import CompileResultCacheImpl, FunctionCache, dumps

    class Results(CompileResultCacheImpl):
        _locator_classes: list[type[object]] = [_CacheLocator]  # noqa: RUF012 - as numba declares it

    class KeyedCache(FunctionCache):
        _impl_class = Results

        def __init__(self, function: Callable[..., Any]) -> None:
            super().__init__(function)  # type: ignore[no-untyped-call]
            file: Any = self._cache_file
            stem = file._data_name_pattern.partition(".{number")[0]
            # numba numbers files: two processes that save at once may both take a number, and load each other's code
            file._data_name = lambda number: f"{stem}.{uuid4().hex}.nbc"
            file._dump = lambda content: dumps(_Checked(dumps(content)))  # type: ignore[no-untyped-call]

        @contextmanager
        def _guard_against_spurious_io_errors(self) -> Iterator[None]:  # around numba's loading and saving
            try:
                yield
            except Exception:  # a full disk, or a file that was changed: compile again, cache if possible
                with suppress(OSError):
                    self.flush()  # type: ignore[no-untyped-call]

    return KeyedCache


def _compiled(function: Callable[..., Any]) -> Any:
    """Return a kernel that is compiled at the first call, or loaded from the cache."""
    import numba

    dispatcher = numba.njit(**_options())(function)
    if directory_of(function.__module__) is not None:
        dispatcher._cache = _cache_type()(function)  # as numba's option `cache`, with our location
    return dispatcher


def _translated(function: Callable[..., Any], **options: Any) -> Any:
    """Return a part that is translated when a kernel first calls it."""
    import numba

    translated = numba.njit(**_options(**_PART, **options))(function)
    program = _whole_program()
    return translated if program is None else program.translated_once(translated)


def kernel(function: F) -> F:
    """Compile a kernel: cached, without the global interpreter lock, without fastmath and prange.

    Divisions by zero give infinities as in NumPy: a kernel never raises, it sets a status. It allocates nothing, and
    references to its arrays are not counted: the two atomic additions per array and call took longer than the
    arithmetic on rows of 20.
    """
    return cast(F, Deferred(function, _compiled))


def part(function: F) -> F:
    """Translate a part of a kernel, which only kernels call."""
    return cast(F, Deferred(function, _translated))


def inlined(function: F) -> F:
    """Translate a :func:`part` that is called in every step and always inlined."""
    return cast(F, Deferred(function, lambda f: _translated(f, forceinline=True)))


_CHOICES: dict[Callable[..., Any], Callable[..., Any]] = {}
"""What returns the code of each function that is dispatched by type, until numba has it."""


def _extend_numba() -> None:
    """Register operations on packs, and functions dispatched by type, with numba."""
    import numba

    import workflow.kernels.pack_operations  # noqa: F401

    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        raise RuntimeError("its compiler is switched off")
    while _CHOICES:
        from numba.extending import overload

        options: Any = _options(**_PART, forceinline=True)
        function, choose = _CHOICES.popitem()
        overload(function, jit_options=options, strict=False)(choose)


_DEFINITIONS: dict[Callable[..., Any], dict[type, Callable[..., Any]]] = {}
"""Definitions by :func:`defines` of each function declared by :func:`by_type`, for each type of first argument."""


def by_type(function: F) -> F:
    """Declare an :func:`inlined` function dispatched at compile time by its first argument's type, a named tuple.

    :func:`defines` gives its code for a type; for all others it is the function's own body.
    """
    definitions = _DEFINITIONS[function] = {}
    _CHOICES[function] = lambda first, *others: definitions.get(getattr(first, "instance_class", type(None)), function)
    return function


def defines(function: Callable[..., Any], kind: type) -> Callable[[F], F]:
    """Return a decorator of the definition, for a type of first argument, of a function declared by :func:`by_type`."""

    def add(definition: F) -> F:
        _DEFINITIONS[function][kind] = definition
        return definition

    return add


def of_case(values: N, lane: int) -> N:
    """Return the numbers of a lane from a named tuple of numbers, rows ``(lane,)`` and such; in kernels only."""
    raise NotImplementedError


def _of_case_for(values: Any, lane: Any) -> Any:
    """Return :func:`of_case` for a type of named tuple."""
    from numba import types

    forms: list[tuple[Any, str]] = [
        (types.Array, "values[{}][lane]"),
        (types.BaseNamedTuple, "of_case(values[{}], lane)"),
    ]
    forms.append((types.Type, "values[{}]"))
    own = (next(form for of, form in forms if isinstance(kind, of)).format(k) for k, kind in enumerate(values.types))
    made: dict[str, Any] = {"Kind": values.instance_class, "of_case": of_case}
    exec(f"def chosen(values, lane):\n    return Kind({', '.join(own)})", made)
    return made["chosen"]


_CHOICES[of_case] = _of_case_for
