"""One study has one content hash on all processors that are pinned, whatever the compiler and the C library choose."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hashes import main as write
from portable_studies import FILES, PINNED, SETTINGS, STUDIES

from studies import pinned
from workflow.kernels.compiled import directory_of
from workflow.kernels.elementwise import _sine_cosine
from workflow.schemes._exact.closed_sets import fill_heated
from workflow.schemes._exact.event_loop import run_cases
from workflow.schemes._fixed.march import KERNELS

HASHES = Path(__file__).with_name("hashes.py")

pytestmark = pinned


def hashes(setting: dict[str, str], directory: Path, names: list[str]) -> dict[str, str]:
    """Run studies under a setting, in a process of its own; kernels for other processors are kept apart."""
    command = [sys.executable, str(HASHES), str(directory), *names]
    kernels = {"NUMBA_CACHE_DIR": str(directory / "kernels")} if "NUMBA_CPU_NAME" in setting else {}
    done = subprocess.run(command, env={**os.environ, **setting, **kernels}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    by_name: dict[str, str] = json.loads((directory / "hashes.json").read_text())
    return by_name


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return hashes(PINNED, tmp_path_factory.mktemp("native"), [*STUDIES, *map(str, FILES)])


@pytest.mark.slow
@pytest.mark.parametrize("setting", [name for name, chosen in SETTINGS.items() if chosen != PINNED])
def test_every_study_has_one_hash_under(setting: str, native: dict[str, str], tmp_path: Path) -> None:
    assert hashes(SETTINGS[setting], tmp_path, [*STUDIES, *map(str, FILES)]) == native


LIBRARY = frozenset(
    b"exp exp2 expm1 log log2 log1p sin cos tan sincos asin acos atan atan2 sinh cosh tanh pow powf cbrt hypot "
    b"fma fmod remainder ldexp frexp modf __powidf2 __divdc3 __muldc3".split()
)
"""Functions of the C library and the compiler's whose results depend on processor and version; not ``log10``, by which
numba counts the digits of numbers in messages of its own."""


def test_no_kernel_calls_the_mathematical_library(tmp_path: Path) -> None:
    """Machine code names the functions that it takes from elsewhere, among strings that end with 0."""
    write(tmp_path, ["schemes", "loose"])
    ours = [run_cases, *KERNELS.values(), fill_heated, _sine_cosine]
    directories = {directory_of(kernel.__module__) for kernel in ours if kernel.__module__.startswith("workflow.")}
    assert None not in directories
    recipe = "hunt_crossley"  # it has a power
    kernels = [path for directory in directories if directory for path in directory.glob("*.nbc")]
    kernels = [path for path in kernels if recipe not in path.name]
    assert any("run_cases" in path.name for path in kernels)
    called = {path.name: sorted(LIBRARY.intersection(path.read_bytes().split(b"\0"))) for path in kernels}
    assert {name: names for name, names in called.items() if names} == {}
