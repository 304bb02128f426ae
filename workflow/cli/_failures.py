"""Exit statuses, and every error as one clear message."""

from __future__ import annotations

import errno
import os
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from traceback import format_exception, walk_tb
from types import FrameType
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
    from workflow.registry import modules_from_outside

    if os.environ.get(TRACEBACK):
        for line in "".join(format_exception(error)).splitlines():
            print_error(line)
    modules = modules_from_outside()
    if outside := _last_frame(error, lambda frame: frame.f_globals.get("__name__") in modules):
        place = f"{outside[0]}, line {outside[1]}"
        print_error(f"{place}: {type(error).__name__}: {error}; it is no part of this program, correct it there")
        return WRONG
    own = _last_frame(error, lambda frame: re.match(r"workflow\.(?!cli)", frame.f_globals.get("__name__", "")))
    where = f" in {own[0].parent.name}/{own[0].name}, line {own[1]}" if own else ""
    print_error(
        f"a defect of this program: {type(error).__name__}{where}: {error}; finished results stay where "
        f"they are. Please report it with the study and this line; {TRACEBACK}=1 in the environment shows the traceback"
    )
    return DEFECT


def _last_frame(error: BaseException, is_meant: Callable[[FrameType], object]) -> tuple[Path, int] | None:
    """Return the file and line of the last of some frames that an error came through."""
    frames = [(frame, line) for frame, line in walk_tb(error.__traceback__) if is_meant(frame)]
    return (Path(frames[-1][0].f_code.co_filename), frames[-1][1]) if frames else None


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
