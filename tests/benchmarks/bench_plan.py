"""What ``plan`` says a study takes over what it takes: ``python tests/benchmarks/bench_plan.py``.

Ten studies that differ in what takes their time. Each runs in a process of its own, as a user would: kernels are
compiled before, the speed of the machine is unknown at first (``first``), then known from runs of the other nine
studies (``others``), then from a run of its own (``again``). A line tells the planned over the measured processor
seconds of the whole run for all three, and the planned over the measured wall time for the last: only that one depends
on what else the machine does, whose load is printed.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from studies import HEAVY_SCENE

ROOT = Path(__file__).parents[2]

LONG = HEAVY_SCENE.replace("nodes: 20,", "nodes: 2000,").replace("duration: 0.3", "duration: 2.0e-3")

PENALTIES = "schemes: {spring: {method: penalty, stiffness: 2.0e8}}\n"

EXACT = "reference: {scheme: event_driven, mechanical_modes: full, thermal_modes: full}\n"

STUDIES = {
    "blade": ROOT / "studies" / "blade.yaml",
    "abstract figure": ROOT / "studies" / "abstract_figure.yaml",
    "resonance": ROOT / "studies" / "resonance.yaml",
    "work-precision": (ROOT / "studies" / "work_precision.yaml", "{log: [1e-7, 1e-3, 9]}", "{log: [1e-6, 1e-4, 5]}"),
    "10 000 cases, metrics only": "study: a\n" + HEAVY_SCENE + "axes: {h: 1e-5, alpha: {lin: [0, 50, 100]}, "
    "e: {lin: [0, 0.9, 100]}}\noutput: {interval: 0.3, histories: [], balances: false}\n",
    "2 cases of 3e6 steps, balances": "study: a\n"
    + HEAVY_SCENE
    + "axes: {h: 1e-7, alpha: [0, 1]}\noutput: {interval: 0.1}\n",
    "histories": "study: a\n" + HEAVY_SCENE + "axes: {h: 1e-4, alpha: {lin: [0, 50, 200]}, e: [0, 0.5]}\n"
    "output: {interval: 1.0e-4, balances: false}\n",
    "exact, 2 000 alpha": "study: a\n" + HEAVY_SCENE + "axes: {scheme: event_driven, alpha: {lin: [0, 2, 2000]}}\n"
    "output: {interval: 1.0e-3, histories: [], balances: false}\n",
    "reference of 300 cases": "study: a\n" + HEAVY_SCENE + PENALTIES + "axes: {scheme: [moreau, carpenter, spring], "
    "h: [1e-4, 1e-5], alpha: {lin: [0, 2, 100]}, e: [0, 0.5, 0.9]}\n"
    + EXACT
    + "output: {interval: 1.0e-3, histories: []}\n",
    "2 000 nodes": "study: a\n" + LONG + "axes: {h: 1e-6, alpha: [0, 0.001, 0.002, 0.003]}\n"
    "output: {interval: 1.0e-4, balances: false}\n",
}

PLANNED = """
import json, sys
from dataclasses import asdict
from workflow.grid import arrange, estimate
from workflow.study import read_study
grid = arrange(read_study(sys.argv[1]))
print(json.dumps(asdict(estimate(grid))))
"""

RUN = """
import json, resource, sys
from pathlib import Path
from workflow import read_study, run_study
study = read_study(sys.argv[1])
begun = resource.getrusage(resource.RUSAGE_SELF)
outcome = run_study(study, Path(sys.argv[2]))
used = resource.getrusage(resource.RUSAGE_SELF)
cpu = used.ru_utime + used.ru_stime - begun.ru_utime - begun.ru_stime
print(json.dumps({"wall": outcome.seconds, "cpu": cpu, "ok": outcome.ok}))
"""


@dataclass(frozen=True)
class Ratios:
    """Planned over measured: processor time before any run, after those of the others, after its own; wall time."""

    name: str
    first: float
    others: float
    again: float
    wall: float
    seconds: float

    def __str__(self) -> str:
        within = all(0.5 <= ratio <= 2 for ratio in (self.first, self.others, self.again))
        ratios = f"first {self.first:.2f}, others {self.others:.2f}, again {self.again:.2f}, wall {self.wall:.2f}"
        return f"{self.name}: {self.seconds:.2f} s; planned/measured: {ratios}" + ("" if within else "  BEYOND 2")


def _called(code: str, cache: Path, *words: Path) -> dict[str, float]:
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, *map(str, words)]
    output = subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout
    return dict(json.loads(output))


def _written(name: str, directory: Path) -> Path:
    study = STUDIES[name]
    path = directory / f"{list(STUDIES).index(name)}.yaml"
    if isinstance(study, tuple):
        source, before, after = study
        path.write_text(source.read_text(encoding="utf-8").replace(before, after), encoding="utf-8")
    else:
        path.write_text(study if isinstance(study, str) else study.read_text(encoding="utf-8"), encoding="utf-8")
    return path


def measure(names: list[str]) -> list[Ratios]:
    """Return the ratios of some studies."""
    with tempfile.TemporaryDirectory() as scratch:
        directory = Path(scratch)
        studies = {name: _written(name, directory) for name in names}
        empty = directory / "empty"
        ran = {}
        for name, study in studies.items():
            archive = directory / "warm.nc"
            _called(RUN, directory / "warm", study, archive)  # kernels compiled, files in memory
            archive.unlink()
            ran[name] = _called(RUN, directory / f"alone-{study.stem}", study, archive)
            archive.unlink()
        all_ratios = []
        for name, study in studies.items():
            others = directory / f"others-{study.stem}"
            for other, its in studies.items():
                if other != name:
                    _merge(directory / f"alone-{its.stem}", others)
            first = _called(PLANNED, empty, study)
            after_others = _called(PLANNED, others, study)
            own = _called(PLANNED, directory / f"alone-{study.stem}", study)
            cpu, wall = ran[name]["cpu"], ran[name]["wall"]
            ratios = [planned["core_seconds"] / cpu for planned in (first, after_others, own)]
            all_ratios.append(Ratios(name, *ratios, own["seconds"] / wall, wall))
        return all_ratios


def _merge(one: Path, into: Path) -> None:
    """Add the measured speeds of one cache to another's."""
    for file in one.rglob("speed-*.json"):
        target = into / file.relative_to(one)
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
            continue
        theirs, mine = json.loads(target.read_text()), json.loads(file.read_text())
        target.write_text(json.dumps({name: theirs[name] + mine[name] for name in mine}))


def main(names: list[str] | None = None) -> None:
    """Print a line for each study."""
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for ratios in measure(names or list(STUDIES)):
        print(ratios)


if __name__ == "__main__":
    main(sys.argv[1:])
