"""Helper processes that compile kernels for a run, one share after the other.

They are processes of this very module. A helper reads shares from a pipe and answers each with a line when it is
compiled; it ends as soon as the pipe does. Whatever goes wrong with one, its share is compiled in the run itself.
"""

from __future__ import annotations

import gc
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import IO

from workflow.grid._compile import SHARES, KernelVariant, Share, is_missing, shares_of
from workflow.grid._speed import remember

LONGEST = 300.0
"""Seconds that a helper has for a share: some thirty times what the largest takes."""

_AT_WORK: list[Future[None]] = []
"""One for each helper process, done when it has ended."""


def at_work() -> list[Future[None]]:
    """Return the helper processes that have not ended."""
    return [helper for helper in list(_AT_WORK) if not helper.done()]


@contextmanager
def compiled_ahead(variants: Sequence[KernelVariant], processes: int) -> Iterator[None]:
    """Compile schemes that are not compiled yet in up to so many processes, which are gone when the context is left.

    The first scheme is left to the caller, unless it names its kernels apart.
    """
    shares = _missing_shares(variants) if processes > 0 else []
    if not shares:
        yield
        return
    SHARES.add(shares)
    running, count = _Running(), min(processes, len(shares))
    with ThreadPoolExecutor(count, thread_name_prefix="compile") as pool:
        try:
            helpers = [pool.submit(running.help) for _ in range(count)]
            _AT_WORK.extend(helpers)
            yield
        finally:
            SHARES.drop(shares)
            running.end()
            for helper in helpers:
                _AT_WORK.remove(helper)


def _missing_shares(variants: Sequence[KernelVariant]) -> list[Share]:
    """Return what helpers are to compile, in the order of the variants."""
    missing: dict[str, dict[object, KernelVariant]] = {}
    for variant in variants:
        if is_missing(variant) and not SHARES.of(variant.method):
            missing.setdefault(variant.method, {}).setdefault(variant.words, variant)
    of_methods = [shares_of(list(each.values())) for each in missing.values()]
    return [share for place, of in enumerate(of_methods) if place > 0 or len(of) > 1 for share in of]


class _Running:
    """The helper processes of a run."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._processes: list[subprocess.Popen[bytes]] = []
        self._ended = False

    def help(self) -> None:
        """Have one process compile shares until none is left, or until it fails."""
        with suppress(Exception):  # a helper costs time only
            process = self._start()
            if process is None:
                return
            with process:  # closes the pipe last
                try:
                    while (share := SHARES.take_next()) is not None:
                        if not _have_compiled(process, share):
                            return
                finally:
                    process.kill()

    def _start(self) -> subprocess.Popen[bytes] | None:
        """Start a process; ``None`` where the run has ended."""
        package = Path(__file__).parents[2]
        environment = dict(os.environ)
        environment["PYTHONPATH"] = os.pathsep.join([str(package), *filter(None, [environment.get("PYTHONPATH")])])
        command = [sys.executable, "-P", "-c", f"from {__name__} import main; main()"]
        with self._lock:
            if self._ended:
                return None
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=environment,
            )
            self._processes.append(process)
        return process

    def end(self) -> None:
        """Kill what still runs; those who wait for it go on."""
        with self._lock:
            self._ended = True
            for process in self._processes:
                process.kill()


def _have_compiled(process: subprocess.Popen[bytes], share: Share) -> bool:
    """Have a process compile a share; tell whether it has."""
    assert process.stdin is not None
    assert process.stdout is not None
    too_long = threading.Timer(LONGEST, process.kill)
    try:
        pickle.dump((share.variants, share.call), process.stdin)
        process.stdin.flush()
        too_long.start()
        return process.stdout.readline() == _DONE
    finally:
        too_long.cancel()
        share.is_done.set()


_DONE = b"done\n"


def main() -> None:
    """Compile what the parent sends, until its pipe ends."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what a scheme prints
    shares: SimpleQueue[Share] = SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin.buffer, shares), daemon=True).start()
    gc.disable()  # a tenth of the time of a compiler that leaves little garbage; this process does nothing else
    while True:
        shares.get().compile()
        remember()
        answers.write(_DONE)


def _read(pipe: IO[bytes], shares: SimpleQueue[Share]) -> None:
    """Read shares from the pipe, and end the process with it."""
    with suppress(Exception):
        while True:
            shares.put(Share(*pickle.load(pipe)))
    os._exit(0)
