"""The example for Slurm: the job it submits starts workers that leave before their walltime."""

from __future__ import annotations

import re

import pytest

from scripts import script


def minutes(walltime: str) -> float:
    hours, rest, seconds = map(int, walltime.split(":"))
    return 60 * hours + rest + seconds / 60


@pytest.mark.filterwarnings("default")  # those of dask-jobqueue
def test_the_job_of_the_example() -> None:
    pytest.importorskip("dask_jobqueue")
    example = script("slurm_cluster")
    with example.slurm_cluster() as cluster:
        job = cluster.job_script()
    assert "--nworkers 16" in job
    assert "--nthreads 1 " in job
    walltime = re.search(r"#SBATCH -t (\S+)", job)
    lifetime = re.search(r"--lifetime (\d+)m --lifetime-stagger (\d+)m", job)
    assert walltime is not None
    assert lifetime is not None
    assert int(lifetime[1]) + int(lifetime[2]) < minutes(walltime[1])
