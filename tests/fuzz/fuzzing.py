"""What feeds mutants to the commands: one interpreter takes many, and another one starts the next where it ends.

As a program, ``fuzzing.py KIND FIRST STOP [SOUND]`` runs the mutants of some seeds and says before each
which it is, and after each what was wrong.
"""

import json
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

LONGEST = 10
"""Processor seconds that one mutant may take, however much the machine has to do beside."""

ASLEEP = 120
"""Seconds that one mutant may take in all: one that waits for something takes no processor time."""

MEMORY = 4 * 2**30
"""Bytes of address space of an interpreter: what spends more is told by a MemoryError."""


def faults(kind: str, first: int, stop: int, *words: str) -> list[str]:
    """Return what went wrong with the mutants of some seeds: tracebacks, hangs, crashes."""
    messages: list[str] = []
    while first < stop:
        command = [sys.executable, __file__, kind, str(first), str(stop), *words]
        ended = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        reports = [json.loads(line) for line in ended.stdout.splitlines()]
        messages += [f"{kind} {report['seed']}: {report['fault']}" for report in reports if report.get("fault")]
        if ended.returncode == 0:
            break
        seed = reports[-1]["seed"] if reports else first
        messages.append(f"{kind} {seed}: the interpreter ends with {ended.returncode}; by SIGPROF or SIGALRM: it hangs")
        first = seed + 1
    return messages


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
    with tempfile.TemporaryDirectory() as name:
        for seed in range(first, stop):
            print(json.dumps({"seed": seed}), flush=True)
            signal.setitimer(signal.ITIMER_PROF, LONGEST)  # its signal ends the interpreter, whatever it is doing
            signal.setitimer(signal.ITIMER_REAL, ASLEEP)
            try:
                fault = _study(seed, Path(name)) if kind == "study" else _matrices(seed, Path(name), Path(words[0]))
            except MemoryError:
                fault = "spends too much memory"
            print(json.dumps({"seed": seed, "fault": fault}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), *sys.argv[4:])
