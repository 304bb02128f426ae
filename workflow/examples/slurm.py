"""Run a study on the nodes of a Slurm cluster: ``python slurm.py STUDY ARCHIVE JOBS``.

Needs ``pip install dask-jobqueue`` beside rotor-stator-workflow, in an environment that all nodes see, and an
archive on a file system that all nodes share. Start it where jobs are submitted, in ``tmux`` or as a
small job of its own: it submits up to JOBS jobs of workers, replaces those that reach their walltime,
and leaves when the archive is there. If it is stopped, the same command goes on where it stopped.

Adapt queue, account, cores and walltime in ``slurm_cluster``; ``python slurm.py`` alone prints
the job script that results.
"""

from __future__ import annotations

import sys
from pathlib import Path

from dask_jobqueue import SLURMCluster

from workflow import read_study, run_study


def slurm_cluster() -> SLURMCluster:
    """Describe one job: a process per core, and an end before Slurm's.

    A worker that leaves by ``--lifetime`` hands its task back. One that Slurm kills at its walltime is
    blamed for the death, and a task that is blamed four times becomes failed cases. The lifetime is
    therefore shorter than the walltime by more than the stagger and the longest case, and staggered so
    that not all workers leave at once.
    """
    return SLURMCluster(
        queue="compute",
        account="project",
        cores=16,
        processes=16,
        memory="32GB",
        walltime="02:00:00",
        worker_extra_args=["--lifetime", "105m", "--lifetime-stagger", "10m"],
        job_script_prologue=["export OPENBLAS_NUM_THREADS=1"],
        death_timeout=300,
    )


def main(study: Path, archive: Path, jobs: int) -> int:
    """Run a study on up to so many jobs; 0 if all cases are ok, 1 if some are not."""
    with slurm_cluster() as cluster:
        cluster.adapt(minimum_jobs=1, maximum_jobs=jobs)
        with cluster.get_client() as client:
            client.wait_for_workers(1)  # as long as the queue takes
            outcome = run_study(read_study(study), archive, scheduler=cluster.scheduler_address)
    print(outcome.counts)
    return 0 if outcome.ok else 1


if __name__ == "__main__":
    if len(sys.argv) == 1:
        print(slurm_cluster().job_script())
    else:
        sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])))
