"""The example for Slurm: the job it submits starts workers that leave before their walltime."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "studies" / "slurm_cluster.py"


def minutes(walltime: str) -> float:
    hours, rest, seconds = map(int, walltime.split(":"))
    return 60 * hours + rest + seconds / 60


@pytest.mark.filterwarnings("default")  # those of dask-jobqueue
def test_the_job_of_the_example() -> None:
    pytest.importorskip("dask_jobqueue")
    specification = importlib.util.spec_from_file_location("slurm_cluster", EXAMPLE)
    assert specification is not None
    assert specification.loader is not None
    example = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(example)
    with example.slurm_cluster() as cluster:
        script = cluster.job_script()
    assert "--nworkers 16" in script
    assert "--nthreads 1 " in script
    walltime = re.search(r"#SBATCH -t (\S+)", script)
    lifetime = re.search(r"--lifetime (\d+)m --lifetime-stagger (\d+)m", script)
    assert walltime is not None
    assert lifetime is not None
    assert int(lifetime[1]) + int(lifetime[2]) < minutes(walltime[1])
