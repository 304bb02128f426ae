"""Mutated studies and files of matrices through ``plan``, mutated archives through ``show`` and ``open_archive``.

Never a traceback, a hang or a crash of the interpreter: what is wrong is told by its seed.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from fuzzing import faults

from matrix_files import WRITERS, matrices_of
from scenes import heavy_chain
from studies import ILL, SMALL, parsed
from workflow.run import run_study


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    directory = tmp_path_factory.mktemp("sound")
    paths = [directory / "ill.nc", directory / "small.nc"]
    for text, path in zip((ILL, SMALL), paths, strict=True):
        run_study(parsed(text), path)
    return [str(path) for path in paths]


def test_a_few_mutated_studies() -> None:
    assert faults("study", 0, 40) == []


def test_a_few_mutated_archives(archives: list[str]) -> None:
    assert faults("archive", 0, 10, archives[0]) == []


@pytest.fixture(scope="module")
def matrices(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A directory with a directory for each kind of file; names of those that are read as a whole say so."""
    sound = tmp_path_factory.mktemp("matrices")
    entries = matrices_of(heavy_chain(nodes=3))
    for write in WRITERS:
        place = sound / write.__name__
        place.mkdir()
        path = write(entries, place)
        if path.is_dir():
            path.rename(sound / f"directory_{path.name}")
            place.rmdir()
    calculix = sound / "calculix"
    calculix.mkdir()
    for name in ("mass", "stiffness"):
        rows = [f"{i + 1} {j + 1} {entries[name][i, j]:.13e}\n" for j in range(3) for i in range(j + 1)]
        (calculix / f"blade.{name[:3]}").write_text("".join(rows))
    (calculix / "blade.dof").write_text("1.1\n2.1\n3.1\n")
    return str(sound)


def test_a_few_mutated_files_of_matrices(matrices: str) -> None:
    assert faults("matrices", 0, 24, matrices) == []


@pytest.mark.slow
def test_ten_thousand_mutated_studies() -> None:
    with ThreadPoolExecutor(2) as pool:
        messages = pool.map(faults, ["study"] * 10, range(0, 10_000, 1000), range(1000, 11_000, 1000))
        assert [message for batch in messages for message in batch] == []


@pytest.mark.slow
def test_two_hundred_mutated_files_of_matrices(matrices: str) -> None:
    assert faults("matrices", 0, 200, matrices) == []


@pytest.mark.slow
def test_two_thousand_mutated_archives(archives: list[str]) -> None:
    with ThreadPoolExecutor(2) as pool:
        messages = pool.map(faults, ["archive"] * 2, (0, 1000), (1000, 2000), archives)
        assert [message for batch in messages for message in batch] == []
