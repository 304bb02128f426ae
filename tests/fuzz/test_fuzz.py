"""Mutated studies and files of matrices through ``plan``.

Never a traceback, a hang or a crash of the interpreter: what is wrong is told by its seed.
"""

from concurrent.futures import ThreadPoolExecutor

import pytest
from fuzzing import faults

from matrix_files import MECHANICAL, WRITERS, matrices_of
from scenes import heavy_chain


@pytest.fixture(scope="module")
def matrices(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A directory with a directory for each kind of file; names of those that are read as a whole say so."""
    sound = tmp_path_factory.mktemp("matrices")
    entries = matrices_of(heavy_chain(nodes=3))
    for write in (*WRITERS, *MECHANICAL):
        place = sound / write.__name__
        place.mkdir()
        path = write(entries, place)
        if path.is_dir():
            path.rename(sound / f"directory_{path.name}")
            place.rmdir()
    return str(sound)


FEW = [("study", 24), ("matrices", 14)]
MANY = [("study", 10_000), ("matrices", 200)]


@pytest.mark.parametrize(("kind", "count"), FEW + [pytest.param(*one, marks=pytest.mark.slow) for one in MANY])
def test_mutants_are_taken_or_told(kind: str, count: int, matrices: str) -> None:
    sound = (matrices,) if kind == "matrices" else ()
    with ThreadPoolExecutor(2) as pool:
        batches = [
            pool.submit(faults, kind, first, min(first + 1000, count), *sound) for first in range(0, count, 1000)
        ]
    assert [message for batch in batches for message in batch.result()] == []
