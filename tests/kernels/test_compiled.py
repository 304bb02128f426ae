"""Functions of kernels: chosen by the type of their first argument, linked as parts of one program, or by plain numba.

numba's own compiler gives the same bits; ours is left out with versions that it was not tested with.
"""

import os
import pwd
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from studies import SCENE
from workflow.archive import provenance
from workflow.kernels import Array, compiled
from workflow.kernels.compiled import by_type, defines, inlined, kernel
from workflow.kernels.packs import view


class Never(NamedTuple):
    value: float


@by_type
def turns(law: Any) -> int:
    return 1


@defines(turns, Never)
def no_turns(law: Never) -> int:
    return 0


@inlined
def shared_by_both(x: float) -> float:
    return x + 1.0


@inlined
def called_first(x: float) -> float:
    return 2.0 * shared_by_both(x)


@inlined
def called_later(x: float) -> float:
    return 3.0 * shared_by_both(x)


@kernel
def both(law: Any, x: float) -> float:
    result = 0.0
    for _ in range(0, turns(law), 1):
        result += called_first(x)
    for _ in range(int(x)):
        result += called_later(x)
    return result


def test_a_part_is_linked_where_its_first_caller_is_left_out() -> None:
    """Without it the kernel would call nothing at an address of 0."""
    assert both(Never(0.0), 2.0) == 18.0


def test_a_user_without_a_home_has_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    def getpwuid(user: int) -> Any:
        raise KeyError(user)

    monkeypatch.setattr(pwd, "getpwuid", getpwuid)
    monkeypatch.setattr(compiled, "__file__", "/proc/none/compiled.py")  # an installation of someone else
    for name in ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    assert compiled.directory_of.__wrapped__("workflow.kernels") is None


@kernel
def doubled(x: float) -> float:
    return 2.0 * x


def test_processes_that_save_at_once_keep_their_own_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each reads the index before the other has written it; numba's numbers would name one file for both."""
    files = [compiled._cache_type()(doubled.__wrapped__)._cache_file for _ in range(2)]
    written = files[0]._save_data
    monkeypatch.setattr(files[0], "_load_index", dict)
    monkeypatch.setattr(files[1], "_load_index", dict)
    monkeypatch.setattr(files[0], "_save_data", lambda *of: (files[1].save("second", "its code"), written(*of)))
    files[0].save("first", "other code")
    monkeypatch.undo()
    assert files[0].load("second") == "its code"
    files[0].flush()


def flipped(image: bytes, at: int) -> bytes:
    return image[:at] + bytes([image[at] ^ 1 << at % 8]) + image[at + 1 :]


def test_what_is_cached_is_loaded_as_it_was_or_not_at_all() -> None:
    """With a flipped bit in any byte of it or of its index."""
    file = compiled._cache_type()(doubled.__wrapped__)._cache_file
    file.flush()
    file.save("signature", "machine code")
    for path in (Path(file._index_path), Path(file._data_path(file._load_index()["signature"]))):
        image = path.read_bytes()
        for at in range(len(image)):
            path.write_bytes(flipped(image, at))
            loaded = None
            with suppress(Exception):  # by which the cache is made anew
                loaded = file.load("signature")
            assert loaded in ("machine code", None)
        path.write_bytes(image)
    assert file.load("signature") == "machine code"
    file.flush()


def test_a_kernel_with_a_flipped_bit_is_compiled_anew() -> None:
    file = compiled._cache_type()(doubled.__wrapped__)._cache_file
    file.flush()
    assert compiled._compiled(doubled.__wrapped__)(1.0) == 2.0
    [name] = file._load_index().values()
    path = Path(file._data_path(name))
    path.write_bytes(flipped(path.read_bytes(), path.stat().st_size // 2))
    for misses, hits in ((1, 0), (0, 1)):
        again = compiled._compiled(doubled.__wrapped__)
        assert again(1.5) == 3.0
        assert (sum(again.stats.cache_misses.values()), sum(again.stats.cache_hits.values())) == (misses, hits)


STUDY = f"""study: both_ways
{SCENE}
schemes: {{midpoint: {{method: moreau, theta: 0.5}}, soft: {{method: penalty, stiffness: 4.0e7}},
          implicit: {{method: penalty, stiffness: 4.0e7, integration: implicit}}}}
axes: {{scheme: [moreau, midpoint, carpenter, soft, implicit, event_driven], h: 1e-5, e: [0, 0.5], alpha: [0, 5]}}
"""


def content(directory: Path, **environment: str) -> str:
    """Run the study in a process of its own and return the hash of what its archive holds."""
    directory.mkdir()
    (directory / "study.yaml").write_text(STUDY)
    command = [sys.executable, "-m", "workflow", "run", "study.yaml", "--threads", "1"]
    subprocess.run(command, cwd=directory, check=True, capture_output=True, env={**os.environ, **environment})
    return provenance(directory / "both_ways.nc")["content_hash"]


@pytest.mark.slow  # it compiles everything twice
def test_both_compilers_give_the_same_bits(tmp_path: Path) -> None:
    ours = content(tmp_path / "ours", NUMBA_CACHE_DIR=str(tmp_path))
    assert content(tmp_path / "plain", NUMBA_CACHE_DIR=str(tmp_path), WORKFLOW_PLAIN_NUMBA="1") == ours
    assert (
        len(list(tmp_path.rglob("event_loop.run_cases-workflow.schemes._exact.event_loop*.nbi"))) == 2
    )  # and neither takes machine code from the other


def test_it_is_left_out_with_other_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    from workflow.kernels import whole_program

    chosen = compiled._whole_program.__wrapped__
    for version, used in ((f"{compiled.TESTED[-1]}.9", True), ("0.61.2", False), ("1.0.0", False)):
        monkeypatch.setattr("numba.__version__", version)
        assert chosen() is (whole_program if used else None)


def second(rows: Array) -> float:
    return rows[1]


def test_other_code_of_the_process_meets_the_usual_compiler() -> None:
    """What gives way to ours while a kernel is compiled is in its place again."""
    program = compiled._whole_program()
    if program is None:
        pytest.skip("numba is of a version that ours was not tested with")
    assert compiled.kernel(second)(np.arange(3.0)) == 1.0
    assert all(getattr(owner, name) is not ours for owner, name, ours in program._REPLACED)
    assert numba.njit(second)(np.arange(3.0)) == 1.0


@kernel
def _doubled(row: Array, at: int, rows: int, columns: int) -> float:
    table, total = view(row, at, (rows, columns)), 0.0
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            table[i, j] *= 2.0
            total += (i + 1) * table[i, j]
    return total


def test_a_table_is_a_view_of_a_row() -> None:
    row, table = np.arange(20.0), view(np.arange(20.0), 3, (4, 3))
    assert _doubled(row, 3, 4, 3) == 2 * (table.sum(axis=1) @ np.arange(1.0, 5.0))
    assert np.array_equal(view(row, 3, (4, 3)), 2 * table)
    assert np.array_equal(row[[0, 1, 2, *range(15, 20)]], [0, 1, 2, *range(15, 20)])
