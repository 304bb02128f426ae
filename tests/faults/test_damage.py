"""Archives whose bytes have changed: named by what takes cases from them, errors where a changed chunk is read."""

from pathlib import Path

import pytest

from hostile import mutated
from quick import quick
from terminal import told
from workflow.run import run_study

STUDY = quick({"alpha": [0.0, 5.0, 1e9]})
"""Three of its nine cases are not ok and have messages."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("damage") / "a.nc"
    run_study(STUDY, path)
    path.with_suffix(".yaml").write_text(STUDY.text)
    return path


def check_named(sound: Path, path: Path) -> None:
    """Whatever takes cases or the study from a damaged archive names it, and leaves it as it is."""
    study, other, before = sound.with_suffix(".yaml"), path.with_suffix(".other.nc"), path.read_bytes()
    for words in (
        ("run", study, "-o", path),
        ("run", study, "-o", path, "--retry"),
        ("run", path, "-o", other),
        ("plan", study, "-o", path),
    ):
        status, output = told(*words)
        assert (status, path.name in output) == (2, True), words
    status, output = told("verify", path, "--sample", "0")
    assert status == 2 or (status == 1 and "bytes    DIFFERS" in output)
    assert path.name in output
    assert told("show", path)[0] in (0, 2)
    assert path.read_bytes() == before
    assert not other.exists()


@pytest.mark.parametrize("number", [*range(4), *(pytest.param(k, marks=pytest.mark.slow) for k in range(4, 200))])
def test_a_damaged_archive_is_named(sound: Path, tmp_path: Path, number: int) -> None:
    image = sound.read_bytes()
    changed = next(one for k in range(9) if (one := mutated(1000 * k + number, image)) != image)
    (tmp_path / "a.nc").write_bytes(changed)
    check_named(sound, tmp_path / "a.nc")
