"""What a module of kernels is made of: a digest of its source and of all sources that it imports.

Kernels inline functions, constants and named tuples of other modules, so the machine code of a kernel is right as long
as none of these sources changes. Docstrings, comments and line numbers change no kernel: the digest is that of the
syntax trees without them. Imports are followed within ``workflow`` and within the kernel's own package; a name that a
package only re-exports (``from workflow.models import Cases``) leads to the module that defines it, not to all that
the package imports.

Parsing all sources takes a third of a second, so the digest of each is stored in a file beside the compiled kernels,
with the modification time and size that the source had.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

_OURS = __name__.split(".")[0]


_BEGUN = time.time()
"""When this module was imported: a source that is younger may not be what this process imported."""


class ChangedSourceError(Exception):
    """A source has changed since this process began: what it compiles is not of the source as it is now."""


def digest(module: str, store: Path) -> str | None:
    """Return the digest of a module and of all that it imports, 64 hexadecimal digits; ``None`` without its source.

    Parameters
    ----------
    module
        Full name of an imported module.
    store
        JSON file with the digests of single sources; written anew where one was missing or had changed.

    Raises
    ------
    ChangedSourceError
        One of the sources was written after this process began.
    """
    sources = _sources(store, frozenset({_OURS, module.split(".")[0]}))
    digests: dict[str, str] = {}
    waiting = [(module, "")]
    while waiting:
        place = sources.defining(*waiting.pop())
        if place not in digests and sources.path(place) is not None:
            digests[place], imports = sources.facts(place)
            waiting += imports
    sources.save()
    return hashlib.sha256(repr(sorted(digests.items())).encode()).hexdigest() if module in digests else None


class _Sources:
    """Sources of some top-level packages: their digests and imports, kept in a file from one process to the next."""

    def __init__(self, store: Path, packages: frozenset[str]):
        self._store, self._packages = store, packages
        self._changed = False
        self._facts: dict[str, tuple[str, list[tuple[str, str]]]] = {}
        self._stored: dict[str, Any] = {}
        with suppress(OSError, ValueError):
            self._stored = dict(json.loads(store.read_bytes()))

    def path(self, module: str) -> Path | None:
        """Return the file of a module, ``None`` where it lies in no package that is looked at."""
        top, *parts = module.split(".")
        loaded = sys.modules.get(top) if top in self._packages else None
        if loaded is None:
            return None
        file = getattr(loaded, "__file__", None)
        if not hasattr(loaded, "__path__"):
            return Path(file) if file and not parts else None
        path = Path(next(iter(loaded.__path__)), *parts)
        return next((each for each in (path / "__init__.py", path.with_suffix(".py")) if each.is_file()), None)

    def defining(self, module: str, name: str) -> str:
        """Return the module that ``from module import name`` takes the name from; the module itself without a name."""
        passed: set[str] = set()
        while name and module not in passed:
            path = self.path(module)
            if path is None or path.name != "__init__.py":
                break
            if self.path(f"{module}.{name}") is not None:
                return f"{module}.{name}"
            passed.add(module)
            module = next((source for source, imported in self.facts(module)[1] if imported == name), module)
        return module

    def facts(self, module: str) -> tuple[str, list[tuple[str, str]]]:
        """Return the digest of one source, and what it imports: modules and names in them, ``""`` for the module."""
        if module not in self._facts:
            self._facts[module] = self._read(module)
        return self._facts[module]

    def _read(self, module: str) -> tuple[str, list[tuple[str, str]]]:
        path = self.path(module)
        assert path is not None
        about = path.stat()
        if about.st_mtime > _BEGUN:
            raise ChangedSourceError(path)
        stamp = [about.st_mtime_ns, about.st_size]
        entry = self._stored.get(str(path))
        if entry is None or entry[0] != stamp:
            tree = ast.parse(path.read_bytes())
            imports = sorted(set(_imports(tree, module, path.name == "__init__.py")))
            entry = self._stored[str(path)] = [stamp, _digest_of(tree), imports]
            self._changed = True
        return entry[1], [(place, name) for place, name in entry[2]]

    def save(self) -> None:
        """Write the facts of all sources in one step, so that other processes read all or nothing of them."""
        if not self._changed:
            return
        self._changed = False
        present = {path: entry for path, entry in self._stored.items() if os.path.exists(path)}
        with suppress(OSError):
            descriptor, name = tempfile.mkstemp(dir=self._store.parent, prefix=f"{self._store.name}.")
            with os.fdopen(descriptor, "w") as file:
                json.dump(present, file)
            os.replace(name, self._store)


_sources = cache(_Sources)


def _imports(tree: ast.Module, module: str, is_package: bool) -> Iterator[tuple[str, str]]:
    """Yield the modules that a source imports and the names that it takes from them, wherever the import stands."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, ""
        elif isinstance(node, ast.ImportFrom):
            parts = module.split(".")
            parents = parts[: len(parts) - node.level + is_package] if node.level else []
            place = ".".join([*parents, *filter(None, [node.module])])
            for alias in node.names:
                yield place, "" if alias.name == "*" else alias.name


def _digest_of(tree: ast.Module) -> str:
    """Return the digest of a syntax tree without its docstrings and without the places of its lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [each for each in node.body if not _is_text(each)]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _is_text(statement: ast.stmt) -> bool:
    """Tell whether a statement is a text alone: a docstring, of a function, a module or a name."""
    if not isinstance(statement, ast.Expr) or not isinstance(statement.value, ast.Constant):
        return False
    return isinstance(statement.value.value, str)
