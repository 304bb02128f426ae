"""Exit statuses, and every error as one clear message."""

from __future__ import annotations

import errno
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from traceback import format_exception, walk_tb
from typing import Any

from workflow.cli._terminal import print_error

NOT_OK = 1
"""Exit status: some case is not ok; the rest is complete and stored."""
WRONG = 2
"""Exit status: the study or the call is wrong, or the machine lacks room for it."""
DEFECT = 3
"""Exit status: the program failed."""

TRACEBACK = "WORKFLOW_TRACEBACK"
"""Environment variable that has a defect's traceback printed."""

_PLACE = {errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.ENOENT, errno.ENOTDIR}
_PLACE |= {errno.EISDIR, errno.ELOOP, errno.EFBIG}
"""What another place cures."""


def tell(error: Exception) -> int:
    """Print what an error means for whoever called the command; return the exit status."""
    lines = _to_be_mended(error)
    for line in lines:
        print_error(line)
    return WRONG if lines else _tell_defect(error)


def _to_be_mended(error: Exception) -> list[str]:
    """Return what is wrong with a study, an archive or a place, and what would be right; nothing of a defect."""
    from workflow.archive import ArchiveError
    from workflow.kernels.compiled import CompilerError
    from workflow.models import UnusableMatricesError
    from workflow.registry import BrokenModuleError
    from workflow.schemes import RefusedStructureError
    from workflow.study import StudyError

    if isinstance(error, ImportError) and "failed to map" in str(error):  # of a library
        error = MemoryError()
    match error:
        case StudyError():
            return [str(mistake) for mistake in error.mistakes]
        case UnusableMatricesError() | BrokenModuleError() | RefusedStructureError():
            # of one value: what is wrong with all is the study's
            return [f"a structure of this study cannot be used: {error}"]
        case ArchiveError() | CompilerError():
            return [str(error)]
        case MemoryError():
            said = f": {error}" if str(error) else ""
            return [f"there is not enough memory{said}; take a longer output.interval, or fewer --threads or --workers"]
        case UnicodeDecodeError():
            return [f"{error.object[:40]!r} is not UTF-8; restore a copy of the archive, or save the file as UTF-8"]
        case RuntimeError() if any(word in str(error) for word in ("NetCDF", "HDF")):
            return [f"the archive is damaged ({error}); restore a copy, or move it away and run its study again"]
        case OSError():
            where = f"{error.filename}: " if error.filename else ""
            advice = "; choose a place that can be written" if error.errno in _PLACE else ""
            advice = "; choose a shorter name" if error.errno == errno.ENAMETOOLONG else advice
            return [f"{where}{(error.strerror or str(error)).lower()}{advice}"]
    return []


def _tell_defect(error: Exception) -> int:
    """Print where this program, or a module from outside, failed."""
    if os.environ.get(TRACEBACK):
        for line in "".join(format_exception(error)).splitlines():
            print_error(line)
    outside = _from_outside(error)
    if outside is not None:
        print_error(f"{outside}: {type(error).__name__}: {error}; it is no part of this program, correct it there")
        return WRONG
    print_error(
        f"a defect of this program: {type(error).__name__}{_innermost(error)}: {error}; finished results stay where "
        f"they are. Please report it with the study and this line; {TRACEBACK}=1 in the environment shows the traceback"
    )
    return DEFECT


def _innermost(error: BaseException) -> str:
    """Return the file and line of this package that an error came through last."""
    location = ""
    for frame, line in walk_tb(error.__traceback__):
        file = Path(frame.f_code.co_filename)
        if "workflow" in file.parts and file.parent.name != "cli":
            location = f" in {file.parent.name}/{file.name}, line {line}"
    return location


def _from_outside(error: BaseException) -> str | None:
    """Return the file and line of a scheme, model or basis from outside that an error came through last."""
    from workflow.registry import modules_from_outside

    location, modules = None, modules_from_outside()
    for frame, line in walk_tb(error.__traceback__):
        if frame.f_globals.get("__name__") in modules:
            location = f"{frame.f_code.co_filename}, line {line}"
    return location


@contextmanager
def warnings_in_words() -> Iterator[None]:
    """Print what this package warns of as other messages."""
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(message: Any, category: Any, *where: Any, **more: Any) -> None:
            if category.__module__.startswith("workflow."):
                print_error(f"beware: {message}")
            else:
                others(message, category, *where, **more)

        warnings.showwarning = show
        warnings.filterwarnings("always", category=UserWarning, module=r"workflow\.")
        yield
