"""Ctrl-C and SIGTERM: a command says what is stored and ends at once, whatever it is doing.

Python raises ``KeyboardInterrupt`` between any two instructions of the main thread. Within a destructor or a callback
of a library it is printed and forgotten, within an import it becomes an ``ImportError``, and compiled code delays it.
Here a thread waits for signals instead and ends the process. That loses nothing: results are safe at every moment,
because files are written aside and renamed.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
from contextlib import contextmanager

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_STOP_MESSAGES: list[Callable[[], str]] = []
"""What is said at the end; the last entry counts."""


def heed_signals() -> None:
    """Have SIGINT and SIGTERM end this process with the exit status 128 + number, from now on."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    owner = os.getpid()

    def left(number: int, frame: object) -> None:
        if os.getpid() != owner:  # a forked process ends without a word
            os._exit(128 + number)

    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:  # as `nohup` and background jobs of a shell leave it
            signal.signal(number, left)
    _thread.start_new_thread(_wait, (reading,))


def ignore_signals() -> None:
    """Let the exit status stand once the command has ended: Python's own end would give signals their default back."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def _wait(reading: int) -> None:
    while True:
        numbers = os.read(reading, 64)
        for number in numbers:
            if number in (signal.SIGINT, signal.SIGTERM):
                _end(number)


def _end(number: int) -> None:
    try:
        line = _STOP_MESSAGES[-1]() if _STOP_MESSAGES else "stopped"
        _discard_temporary_files()
    except BaseException:  # in the middle of an import, say
        line = "stopped"
    shown = b"\r\x1b[2K\x1b[?25h" if os.isatty(2) else b""  # a progress bar's line goes, the cursor it hid comes back
    try:
        os.write(2, shown + line.encode(errors="backslashreplace") + b"\n")
    finally:
        os._exit(128 + number)


def _discard_temporary_files() -> None:
    """Remove views of unfinished archives that are open, and files of a study that are being read."""
    for room, discard in (("archive", "discard_views"), ("models", "discard_files")):
        module = sys.modules.get(f"workflow.{room}")
        if module is not None and hasattr(module, discard):
            getattr(module, discard)()


@contextmanager
def saying(message: Callable[[], str]) -> Iterator[None]:
    """Print what ``message`` returns, one clean line, if a signal ends the process within this context."""
    _STOP_MESSAGES.append(message)
    try:
        yield
    finally:
        _STOP_MESSAGES.remove(message)
