"""What pins linear algebra to one machine code: the environment before NumPy is imported, or nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from workflow.pinning import CHOSEN, _has_avx2, is_pinned


def printed(code: str, **environment: str) -> str:
    """Return the last line that a process prints, of standard error where it fails."""
    left = {name: value for name, value in os.environ.items() if name not in CHOSEN}
    done = subprocess.run([sys.executable, "-c", code], env={**left, **environment}, capture_output=True, text=True)
    return (done.stdout if done.returncode == 0 else done.stderr).strip().splitlines()[-1]


needs_choice = pytest.mark.skipif(not _has_avx2(), reason="this processor has no AVX2 and FMA")
ASK = "import workflow; workflow.pin(); from workflow.pinning import is_pinned; print(is_pinned())"


@needs_choice
def test_a_process_that_pins_first_is_pinned() -> None:
    assert printed(ASK) == "True"
    assert printed("from workflow.pinning import is_pinned; print(is_pinned())") == "False"


@needs_choice
def test_after_numpy_it_is_too_late() -> None:
    assert printed("import numpy, workflow; workflow.pin()").startswith("RuntimeError: NumPy is imported already")


@needs_choice
def test_what_the_environment_chooses_stands() -> None:
    assert printed(ASK, OPENBLAS_CORETYPE="Nehalem") == "False"
    assert printed(f"import numpy; {ASK}", **CHOSEN) == "True"


@needs_choice
def test_the_command_pins_itself() -> None:
    code = "import sys; sys.argv = ['workflow', '--help']\nfrom workflow.cli import main\n"
    asked = f"{code}try: main()\nexcept SystemExit: pass\nimport os; print(os.environ['OPENBLAS_CORETYPE'])"
    assert printed(asked) == "Haswell"


def test_tests_are_pinned_unless_the_environment_chooses() -> None:
    assert is_pinned() == (_has_avx2() and all(os.environ[name] == value for name, value in CHOSEN.items()))


@needs_choice
def test_the_tests_start_where_a_plugin_imports_numpy_first() -> None:
    chosen = f"{Path(__file__).name}::{test_tests_are_pinned_unless_the_environment_chooses.__name__}"
    left = {name: value for name, value in os.environ.items() if name not in CHOSEN}
    command = [sys.executable, "-m", "pytest", "-p", "numpy", "-n", "0", "-p", "no:cacheprovider", chosen]
    done = subprocess.run(command, cwd=Path(__file__).parent, env=left, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout
