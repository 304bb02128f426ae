"""One study has one content hash whatever the processor offers to BLAS, NumPy, the C library and the compiler.

The settings stand for processors: each switches one of the libraries to what it does on another one. Where
this processor lacks what a setting asks for, the setting is left out.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from hashes import main as write
from portable_studies import COMPILED, FILES, IS_X86, SETTINGS, STUDIES

from workflow.kernels.cache import root

HASHES = Path(__file__).with_name("hashes.py")

pytestmark = pytest.mark.skipif(not IS_X86, reason="settings are of x86-64 processors")


@cache
def features() -> frozenset[str]:
    """What this processor offers, in NumPy's words."""
    try:
        from numpy._core import _multiarray_umath as umath
    except ImportError:  # NumPy 1
        from numpy.core import _multiarray_umath as umath
    return frozenset(name for name, there in umath.__cpu_features__.items() if there)


def hashes(setting: dict[str, str | None], directory: Path, names: list[str]) -> dict[str, str]:
    """Run studies under a setting, in a process of its own."""
    environment = {**os.environ, "PYTHONWARNINGS": "ignore::ImportWarning"}  # NumPy's, of features that are not there
    for name, value in setting.items():
        environment.pop(name, None)
        if value is not None:
            environment[name] = value
    needed = {"SkylakeX": "AVX512F", "Haswell": "AVX2"}.get(environment.get("OPENBLAS_CORETYPE", ""))
    if needed is not None and needed not in features():
        pytest.skip(f"this processor has no {needed}")
    done = subprocess.run(
        [sys.executable, str(HASHES), str(directory), *names], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return written(directory)


def written(directory: Path) -> dict[str, str]:
    by_name: dict[str, str] = json.loads((directory / "hashes.json").read_text())
    return by_name


def written_here(directory: Path, names: list[str]) -> dict[str, str]:
    """Run studies in this process, which takes its processor as it is."""
    write(directory, names)
    return written(directory)


def test_a_study_has_one_hash(tmp_path: Path) -> None:
    """All libraries at once as on the oldest processor: the slow test tells them apart."""
    names = ["schemes", "reduced", "loose", "coupled"]
    assert written_here(tmp_path / "a", names) == hashes(SETTINGS["oldest"], tmp_path / "b", names)


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return hashes(SETTINGS["native"], tmp_path_factory.mktemp("native"), [*STUDIES, *map(str, FILES)])


@pytest.mark.slow
@pytest.mark.parametrize("setting", [name for name in (*SETTINGS, *COMPILED) if name != "native"])
def test_every_study_has_one_hash_under(setting: str, native: dict[str, str], tmp_path: Path) -> None:
    by_name = hashes({**SETTINGS, **COMPILED}[setting], tmp_path, [*STUDIES, *map(str, FILES)])
    assert by_name == native


LIBRARY = frozenset(
    b"exp exp2 expm1 log log2 log1p sin cos tan sincos asin acos atan atan2 sinh cosh tanh pow powf cbrt hypot "
    b"fma fmod remainder ldexp frexp modf __powidf2 __divdc3 __muldc3".split()
)
"""Functions of the C library and the compiler's whose results depend on processor and version; not ``log10``, by which
numba counts the digits of numbers in messages of its own."""


def test_no_kernel_calls_the_mathematical_library(tmp_path: Path) -> None:
    """Machine code names the functions that it takes from elsewhere, among strings that end with 0."""
    written_here(tmp_path, ["schemes", "blade"])
    kernels = [path for path in root().rglob("*.nbc") if not path.name.startswith("test_")]  # tests have some too
    assert any("march" in path.name for path in kernels)
    called = {path.name: sorted(LIBRARY.intersection(path.read_bytes().split(b"\0"))) for path in kernels}
    assert {name: names for name, names in called.items() if names} == {}
