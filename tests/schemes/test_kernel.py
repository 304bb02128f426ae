"""Compiled kernels: found again by the next process, compiled anew after any change of a source."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import workflow

RUN = """
import sys, numpy as np
sys.path.insert(0, {package!r})
from workflow import models, schemes
from workflow.schemes import _kernel, _modal_march, moreau
from workflow.models import Cases
chain = models.load("chain")
structure = chain.assemble(chain.Parameters(nodes=1, mass=1.0, stiffness=1.0, heat_capacity=1.0))
one, node = np.ones(1), np.zeros((1, 1))
cases = Cases(0 * one, 0 * one, 9 * one, one, 0 * one, 0 * one, 0 * one, node, node, node, node, node)
found = moreau.compute(moreau.init(structure, 0.5, moreau.Options()), cases, schemes.Sampling(1.0, 0.5, 3))
hits = sum(_modal_march._march.stats.cache_hits.values())
print(found.histories["displacement"][0, -1], hits, _kernel.cache_directory())
"""


def run(package: Path, **environment: str) -> tuple[float, int, Path]:
    told = subprocess.run(
        [sys.executable, "-c", RUN.format(package=str(package))],
        capture_output=True, text=True, check=True, cwd=package, env={**os.environ, **environment},
    ).stdout.split()  # fmt: skip
    return float(told[0]), int(told[1]), Path(told[2])


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """A copy of the package whose sources may change."""
    shutil.copytree(Path(workflow.__file__).parent, tmp_path / "workflow", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_a_change_in_an_inlined_module_is_noticed(copied: Path) -> None:
    value, hits, _ = run(copied)
    again, found, _ = run(copied)
    assert (hits, found) == (0, 1)
    assert again == value
    tip_load = copied / "workflow" / "schemes" / "_tip_load.py"
    source = tip_load.read_text(encoding="utf-8")
    changed = source.replace("return mean + (amplitude", "return 2.0 * mean + (amplitude")
    assert changed != source
    tip_load.write_text(changed, encoding="utf-8")
    twice, hits, _ = run(copied)
    assert hits == 0
    assert twice == pytest.approx(2 * value, rel=1e-12)


def test_nothing_writable_means_a_temporary_cache(copied: Path) -> None:
    """Files where the cache directories should be: neither of them can be made."""
    (copied / "home").write_text("")
    cache = copied / "workflow" / "schemes" / "__pycache__"
    cache.write_text("")
    value, hits, directory = run(copied, XDG_CACHE_HOME=str(copied / "home"), PYTHONDONTWRITEBYTECODE="1")
    assert hits == 0
    assert copied not in directory.parents
    assert value > 0
    shutil.rmtree(directory)
