"""Directories that are their own registry: a public module of ``workflow/schemes/`` is the scheme of its name.

The same holds for models and bases. A distribution adds more from outside by entry points of the group of that name
(``workflow.schemes``, ``workflow.models``, ``workflow.reduction``): the entry's name is the scheme's, its value the
module. A module that cannot be imported, or that lacks what its kind must offer, breaks only what names it.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import pkgutil
import sys
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

REGISTRIES = ("workflow.models", "workflow.reduction", "workflow.schemes")
"""Packages that are registries, and groups of entry points."""


class BrokenModuleError(ImportError):
    """A module of a registry cannot be imported or lacks what it must offer."""


@cache
def _own(path: tuple[str, ...]) -> frozenset[str]:
    """Return the names of the public modules of a directory."""
    return frozenset(module.name for module in pkgutil.iter_modules(path) if not module.name.startswith("_"))


_all_entries = cache(entry_points)  # it reads a file of each distribution that is installed


@cache
def _entries(package: str) -> dict[str, str]:
    """Return the modules that entry points add, by name."""
    return {entry.name: entry.value for entry in _all_entries().select(group=package)}


@cache
def modules_from_outside() -> frozenset[str]:
    """Return the modules that entry points add to any registry of this package."""
    return frozenset(place for package in REGISTRIES for place in _entries(package).values())


@cache
def outside_sources() -> dict[str, str | None]:
    """Return the digest of the sources of each module that entry points add to any registry, by the entry's name.

    Results depend on them as they do on the solver's version, which stands for the sources of this package.
    """
    added = {name: place for package in REGISTRIES for name, place in _entries(package).items()}
    return {name: source_digest(place.split(".")[0]) for name, place in sorted(added.items())}


@cache
def source_digest(package: str) -> str | None:
    """Return the digest of the sources of a package or module, ``None`` where they are no files."""
    spec = importlib.util.find_spec(package)
    if spec is None or not spec.has_location or spec.origin is None:
        return None
    file = Path(spec.origin)
    pattern = "**/*.py" if file.name == "__init__.py" else file.name
    names = sorted(each.relative_to(file.parent) for each in file.parent.glob(pattern))
    sources = [(str(name), (file.parent / name).read_bytes()) for name in names]
    return hashlib.sha256(repr(sources).encode()).hexdigest()


@dataclass(frozen=True)
class Registry:
    """The modules of a package and of entry points of its group, each with the ``required`` names."""

    package: str
    required: tuple[str, ...]

    def names(self) -> tuple[str, ...]:
        """Return the names of all modules, sorted."""
        return tuple(sorted(_own(self._path) | set(_entries(self.package))))

    @property
    def _path(self) -> tuple[str, ...]:
        return tuple(sys.modules[self.package].__path__)

    def fault(self, name: str) -> str | None:
        """Return why the module of a name cannot be used, ``None`` if it can."""
        try:
            self.load(name)
        except BrokenModuleError as error:
            return str(error)
        return None

    def load(self, name: str) -> ModuleType:
        """Return the module of a name; what the directory holds comes before entry points.

        Raises
        ------
        KeyError
            No module has this name.
        BrokenModuleError
            The module cannot be imported, or lacks one of the required names.
        """
        if name not in self.names():
            raise KeyError(name)
        place = f"{self.package}.{name}" if name in _own(self._path) else _entries(self.package)[name]
        try:
            module = importlib.import_module(place)
        except Exception as error:  # whatever a file from outside raises
            raise BrokenModuleError(f"{place} cannot be imported: {type(error).__name__}: {error}") from error
        missing = [part for part in self.required if not hasattr(module, part)]
        if missing:
            raise BrokenModuleError(f"{place} lacks {', '.join(missing)}")
        return module
