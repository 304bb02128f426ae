"""Exit statuses, and every error as one clear message."""

from __future__ import annotations

import errno
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from traceback import format_exception, walk_tb
from typing import Any, NoReturn

import typer

from workflow.cli._stop import ignore_signals
from workflow.cli._terminal import forgive, print_error

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

_NO_MEMORY = ("cannot allocate memory", "failed to map segment", "can't start new thread", "unable to allocate")
"""How the system, the loader, Python's threads and NumPy say that there is no memory."""


def run_application() -> NoReturn:
    """Run the command that was called and exit with its status; no error ends in a traceback."""
    forgive()
    try:
        _judge_memory()
        from workflow.cli._app import app

        status = app(standalone_mode=False) or 0
    except Exception as error:
        status = _last_resort(error)
    ignore_signals()
    sys.exit(status)


LEAST_MEMORY = 2**30
"""Bytes of address space below which the linear algebra library that NumPy loads waits for ever, or ends the process:
measured at 300 and 600 MB; loading alone takes 400 MB."""


def _judge_memory() -> None:
    """Refuse a limit of the address space (``ulimit -v``) under which libraries cannot be loaded."""
    import resource

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each further thread takes 32 MB
        if limit < LEAST_MEMORY:
            raise MemoryError


def _last_resort(error: Exception) -> int:
    """Print an error that no command has handled; return the exit status."""
    if hasattr(error, "format_message"):
        _tell_usage(error)
        return int(getattr(error, "exit_code", WRONG))
    if os.environ.get(TRACEBACK):
        for line in "".join(format_exception(error)).splitlines():
            print_error(line)
    if lacks_memory(error):
        print_error(
            "there is not enough memory; allow this process more of it (ulimit -v, at least 1 GiB), or run a smaller "
            "study on fewer threads"
        )
        return WRONG
    outside = _from_outside(error)
    if outside is not None:
        print_error(f"{outside}: {type(error).__name__}: {error}; it is no part of this program, correct it there")
        return WRONG
    where = _innermost(error)
    print_error(
        f"a defect of this program: {type(error).__name__}{where}: {error}; finished results stay where they are. "
        f"Please report it with the study and this line; {TRACEBACK}=1 in the environment shows the traceback"
    )
    return DEFECT


def _tell_usage(error: Any) -> None:
    """Tell what the parser of the command line refuses: usage and fault; the help where no word was given."""
    message, context = error.format_message(), getattr(error, "ctx", None)
    if context is not None and message == context.get_help():
        lines = message.splitlines()
    else:
        usage = context.get_usage().splitlines() if context is not None else []
        lines = [*usage, f"Error: {message}"]
    for line in lines:
        print_error(line)


def lacks_memory(error: BaseException) -> bool:
    """Tell whether an error, or one that led to it, says that there is no memory."""
    chain: BaseException | None = error
    while chain is not None:
        text = str(chain).lower()
        no_memory = isinstance(chain, OSError) and chain.errno == errno.ENOMEM
        if isinstance(chain, MemoryError) or no_memory or any(words in text for words in _NO_MEMORY):
            return True
        chain = chain.__cause__ or chain.__context__
    return False


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
def _warnings_in_words() -> Iterator[None]:
    """Print what a structure warns of as other messages."""
    from workflow.models import LargeFactorsWarning

    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(message: Any, category: Any, *where: Any, **more: Any) -> None:
            if issubclass(category, LargeFactorsWarning):
                print_error(f"beware: {message}")
            else:
                others(message, category, *where, **more)

        warnings.showwarning = show
        warnings.simplefilter("always", LargeFactorsWarning)
        yield


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Give an error that a full disk raises on writing the name of the file, which the system leaves out."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file)) from error


@contextmanager
def errors_in_words() -> Iterator[None]:
    """Turn what a user can mend into one clear message and the exit status of a wrong call."""
    from workflow.archive import ArchiveError
    from workflow.models import UnusableMatricesError
    from workflow.registry import BrokenModuleError
    from workflow.study import StudyError

    try:
        with _warnings_in_words():
            yield
    except StudyError as error:
        for mistake in error.mistakes:
            print_error(str(mistake))
        raise typer.Exit(WRONG) from None
    except (UnusableMatricesError, BrokenModuleError) as error:  # of one value: what is wrong with all is the study's
        print_error(f"a structure of this study cannot be used: {error}")
        raise typer.Exit(WRONG) from None
    except ArchiveError as error:
        print_error(str(error))
        raise typer.Exit(WRONG) from None
    except UnicodeDecodeError:
        print_error("a text in the archive is not UTF-8, as `workflow run` writes it; restore a copy")
        raise typer.Exit(WRONG) from None
    except RuntimeError as error:
        if not any(word in str(error) for word in ("NetCDF", "HDF")):
            raise
        print_error(f"the archive is damaged ({error}); restore a copy, or move it away and run its study again")
        raise typer.Exit(WRONG) from None
    except OSError as error:
        if lacks_memory(error):
            raise
        where = f"{error.filename}: " if error.filename else ""
        advice = "; choose a place that can be written" if error.errno in _PLACE else ""
        advice = "; choose a shorter name" if error.errno == errno.ENAMETOOLONG else advice
        print_error(f"{where}{(error.strerror or str(error)).lower()}{advice}")
        raise typer.Exit(WRONG) from None
