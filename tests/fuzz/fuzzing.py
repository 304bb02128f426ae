"""What feeds mutants to the commands: one interpreter takes many, and another one watches it.

As a program, ``fuzzing.py KIND FIRST STOP [SOUND]`` runs the mutants of some seeds and says before each
which it is, and after each what was wrong.
"""

from __future__ import annotations

import json
import os
import resource
import select
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path

import psutil

LONGEST = 10.0
"""Processor seconds that one mutant may take, however much the machine has to do beside."""

ASLEEP = 120.0
"""Seconds that one mutant may take in all: one that waits for something takes no processor time."""

LOOK = 0.2
"""Seconds between two looks at an interpreter that says nothing."""

MEMORY = 4 * 2**30
"""Bytes of address space of an interpreter: what spends more is told by a MemoryError."""

START = 60.0
"""Processor seconds for an interpreter to start."""


def faults(kind: str, first: int, stop: int, *words: str) -> list[str]:
    """Return what went wrong with the mutants of some seeds: tracebacks, hangs, crashes."""
    messages: list[str] = []
    while first < stop:
        first = _watched(kind, first, stop, words, messages)
    return messages


def _watched(kind: str, first: int, stop: int, words: tuple[str, ...], messages: list[str]) -> int:
    """Watch an interpreter to its end and return the seed that comes next."""
    command = [sys.executable, __file__, kind, str(first), str(stop), *words]
    seed, buffer = first, b""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0) as process:
        assert process.stdout is not None
        limit = _Limit(process.pid, START, 10 * START)
        while not limit.is_exceeded():
            if not select.select([process.stdout], [], [], LOOK)[0]:
                continue
            data = os.read(process.stdout.fileno(), 65536)
            if not data:
                break
            *lines, buffer = (buffer + data).split(b"\n")
            for line in lines:
                report = json.loads(line)
                seed, limit = report["seed"], _Limit(process.pid, LONGEST, ASLEEP)
                if report.get("fault"):
                    messages.append(f"{kind} {seed}: {report['fault']}")
        else:
            process.kill()
            messages.append(f"{kind} {seed}: hangs")
            return seed + 1
    if process.returncode == 0:
        return stop
    messages.append(f"{kind} {seed}: the interpreter ends with {process.returncode}")
    return seed + 1


class _Limit:
    """How long an interpreter may take from now on."""

    def __init__(self, process: int, processor_seconds: float, seconds: float):
        self._process = psutil.Process(process)
        self._processor_end = self._processor_time() + processor_seconds
        self._end = time.monotonic() + seconds

    def _processor_time(self) -> float:
        """Return the processor seconds that the interpreter has taken; none any more once it has ended."""
        try:
            times = self._process.cpu_times()
        except psutil.Error:
            return 0.0
        return float(times.user + times.system)

    def is_exceeded(self) -> bool:
        return time.monotonic() > self._end or self._processor_time() > self._processor_end


def _command(*words: str) -> str:
    """Run a command in this process; return what is wrong with how it ends."""
    from typer.testing import CliRunner

    from workflow.cli import app

    result = CliRunner().invoke(app, list(words))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        return "".join(traceback.format_exception(result.exception)[-3:])
    if result.exit_code not in (0, 2):
        return f"exit status {result.exit_code}"
    if result.exit_code == 2 and not result.stderr.strip():
        return "exit status 2 without a word"
    return "a traceback in what it says" if "Traceback" in result.output else ""


def _study(seed: int, directory: Path) -> str:
    import mutants

    path = directory / "study.yaml"
    path.write_bytes(mutants.study(seed))
    return _command("plan", str(path))


def _archive(seed: int, directory: Path, sound: bytes) -> str:
    import mutants

    from workflow.archive import ArchiveError, open_archive

    path = directory / "archive.nc"
    path.write_bytes(mutants.archive(seed, sound))
    fault = _command("show", str(path))
    try:
        with open_archive(path) as data:
            data["status"].isel(dict.fromkeys(data["status"].dims, 0))
    except ArchiveError:
        pass
    except Exception as error:
        return fault or "open_archive: " + "".join(traceback.format_exception(error)[-3:])
    return fault


def _matrices(seed: int, directory: Path, sound: Path) -> str:
    """Mutate one file of one of the kinds that lie in a directory, and plan a study of it."""
    import mutants

    kinds = sorted(sound.iterdir())
    kind = kinds[seed % len(kinds)]
    files = sorted(kind.iterdir())
    changed = files[seed // len(kinds) % len(files)]
    place = directory / f"{seed}"
    place.mkdir()
    for path in files:
        content = path.read_bytes()
        (place / path.name).write_bytes(mutants.matrices(seed, content) if path == changed else content)
    named = place if kind.name.startswith("directory") else place / files[0].name
    path = directory / "study.yaml"
    path.write_text(
        f"study: s\nscene:\n  matrices: {{file: {named}, contact: 2}}\n  casing: {{gap: 1e-5}}\n  duration: 1e-3\n"
    )
    return _command("plan", str(path))


def main(kind: str, first: int, stop: int, *words: str) -> None:
    """Run the mutants of some seeds."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]
    sound = Path(words[0]).read_bytes() if words and kind == "archive" else b""
    with tempfile.TemporaryDirectory() as name:
        for seed in range(first, stop):
            print(json.dumps({"seed": seed}), flush=True)
            try:
                match kind:
                    case "study":
                        fault = _study(seed, Path(name))
                    case "archive":
                        fault = _archive(seed, Path(name), sound)
                    case _:
                        fault = _matrices(seed, Path(name), Path(words[0]))
            except MemoryError:
                fault = "spends too much memory"
            print(json.dumps({"seed": seed, "fault": fault}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), *sys.argv[4:])
