"""What ``plan`` says a study takes over what it takes: ``python tests/benchmarks/bench_plan.py [STUDY ...]``.

Studies that differ in what takes their time, each in processes of its own with kernels compiled before. A line tells
planned over measured processor seconds before the speed of the machine is known (``first``) and after a run
(``again``), and planned over measured wall time, which depends on what else the machine does.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from studies import HEAVY_SCENE

ROOT = Path(__file__).parents[2]

LONG = HEAVY_SCENE.replace("nodes: 20,", "nodes: 2000,").replace("duration: 0.3", "duration: 2.0e-3")

STUDIES = {
    "blade": (ROOT / "studies" / "blade.yaml").read_text(encoding="utf-8"),
    "abstract figure": (ROOT / "studies" / "abstract_figure.yaml").read_text(encoding="utf-8"),
    "10 000 cases, metrics only": f"study: a\n{HEAVY_SCENE}axes: {{h: 1e-5, alpha: {{lin: [0, 50, 100]}}, "
    "e: {lin: [0, 0.9, 100]}}\noutput: {interval: 0.3, histories: [], balances: false}\n",
    "2 cases of 3e6 steps, balances": f"study: a\n{HEAVY_SCENE}axes: {{h: 1e-7, alpha: [0, 1]}}\n"
    "output: {interval: 0.1}\n",
    "histories": f"study: a\n{HEAVY_SCENE}axes: {{h: 1e-4, alpha: {{lin: [0, 50, 200]}}, e: [0, 0.5]}}\n"
    "output: {interval: 1.0e-4, balances: false}\n",
    "exact, 2 000 alpha": f"study: a\n{HEAVY_SCENE}axes: {{scheme: event_driven, alpha: {{lin: [0, 2, 2000]}}}}\n"
    "output: {interval: 1.0e-3, histories: [], balances: false}\n",
    "reference of 200 cases": f"study: a\n{HEAVY_SCENE}axes: {{scheme: [moreau, carpenter], h: 1e-5, "
    "alpha: {lin: [0, 2, 100]}}\nreference: {scheme: event_driven, mechanical_modes: full, thermal_modes: full}\n"
    "output: {interval: 1.0e-3, histories: []}\n",
    "2 000 nodes": f"study: a\n{LONG}axes: {{h: 1e-6, alpha: [0, 0.001, 0.002, 0.003]}}\n"
    "output: {interval: 1.0e-4, balances: false}\n",
}

PLANNED = """
import json, sys
from dataclasses import asdict
from workflow.grid import arrange, estimate
from workflow.study import read_study
print(json.dumps(asdict(estimate(arrange(read_study(sys.argv[1]))))))
"""

RUN = """
import json, sys, time
from pathlib import Path
from workflow import read_study, run_study
begun = time.process_time()
outcome = run_study(read_study(sys.argv[1]), Path(sys.argv[2]))
print(json.dumps({"wall": outcome.seconds, "cpu": time.process_time() - begun}))
"""


def _called(code: str, cache: Path, *words: Path) -> dict[str, float]:
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, *map(str, words)]
    output = subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout
    return dict(json.loads(output))


def main(names: list[str] | None = None) -> None:
    """Print a line for each study."""
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for name in names or list(STUDIES):
        with tempfile.TemporaryDirectory() as scratch:
            directory = Path(scratch)
            study = directory / "study.yaml"
            study.write_text(STUDIES[name], encoding="utf-8")
            _called(RUN, directory / "warm", study, directory / "warm.nc")  # kernels compiled, files in memory
            ran = _called(RUN, directory / "known", study, directory / "a.nc")
            first, again = (_called(PLANNED, directory / cache, study) for cache in ("unknown", "known"))
        ratios = [
            first["core_seconds"] / ran["cpu"],
            again["core_seconds"] / ran["cpu"],
            again["seconds"] / ran["wall"],
        ]
        told = "first {:.2f}, again {:.2f}, wall {:.2f}".format(*ratios)
        print(f"{name}: {ran['wall']:.2f} s; planned/measured: {told}")


if __name__ == "__main__":
    main(sys.argv[1:])
