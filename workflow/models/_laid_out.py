"""The files of a study as they were when it was read, laid out for models and libraries that read from paths."""

from __future__ import annotations

import dataclasses
import shutil
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from workflow.declare import File, files_of
from workflow.models._pair import UnusableMatricesError

_DIRECTORIES: set[Path] = set()
_MAKING = threading.RLock()
"""Held while a directory is made, and for good once the process is about to end."""


@contextmanager
def files_laid_out(parameters: Any) -> Iterator[Any]:
    """Give parameters whose files lie in a directory of their own, which goes with this context.

    Raises
    ------
    UnusableMatricesError
        There is no room for them.
    """
    if not any(file.contents for file in files_of(parameters)):
        yield parameters
        return
    with _MAKING:
        directory = Path(tempfile.mkdtemp(prefix="workflow-"))
        _DIRECTORIES.add(directory)
    try:
        try:
            own = _laid_out(parameters, directory)
        except OSError as error:
            problem = f"its files cannot be written to {directory.parent}: {error.strerror}"
            raise UnusableMatricesError(problem, "make room, or set TMPDIR to another directory") from None
        yield own
    finally:
        shutil.rmtree(directory, ignore_errors=True)
        _DIRECTORIES.discard(directory)


def discard_files() -> None:
    """Remove what is laid out, also while it is being written; the process is about to end."""
    _MAKING.acquire()
    for directory in tuple(_DIRECTORIES):
        while directory.exists():
            shutil.rmtree(directory, ignore_errors=True)


def _laid_out(declared: Any, directory: Path) -> Any:
    if isinstance(declared, File):
        home = directory / declared.digest
        home.mkdir(exist_ok=True)
        for name, content in declared.contents.items():
            (home / name).write_bytes(content)
        whole = Path(declared.name).name
        return dataclasses.replace(declared, place=str(home / whole if whole in declared.contents else home))
    if dataclasses.is_dataclass(declared) and not isinstance(declared, type):
        entries = [entry.name for entry in dataclasses.fields(declared) if entry.init]
        return dataclasses.replace(
            declared, **{name: _laid_out(getattr(declared, name), directory) for name in entries}
        )
    return declared
