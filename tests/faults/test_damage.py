"""Archives whose bytes have changed: named by what takes cases from them, errors where a changed chunk is read."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from quick import quick
from terminal import told
from workflow.run import run_study

LONGEST = 60.0
"""Seconds after which a command on one damaged archive counts as hanging; it takes less than one."""

STUDY = quick({"alpha": [0.0, 5.0, 1e9]})
"""Three of its nine cases are not ok and have messages."""

Damage = Callable[[bytearray, np.random.Generator], None]


def one_bit(image: bytearray, random: np.random.Generator) -> None:
    image[int(random.integers(len(image)))] ^= 1 << int(random.integers(8))


def several_bits(image: bytearray, random: np.random.Generator) -> None:
    for _ in range(20):
        one_bit(image, random)


def truncated(image: bytearray, random: np.random.Generator) -> None:
    del image[int(random.integers(len(image))) :]


def longer(image: bytearray, random: np.random.Generator) -> None:
    image += random.bytes(int(random.integers(1, 5000)))


def blank_block(image: bytearray, random: np.random.Generator) -> None:
    first = int(random.integers(len(image) // 512)) * 512
    length = min(int(random.choice([512, 4096])), len(image) - first)
    image[first : first + length] = bytes(length)


def exchanged_blocks(image: bytearray, random: np.random.Generator) -> None:
    length = int(random.choice([8, 64, 512]))
    a, b = (int(k) * length for k in random.integers(len(image) // length, size=2))
    image[a : a + length], image[b : b + length] = image[b : b + length], image[a : a + length]


DAMAGES: tuple[Damage, ...] = (one_bit, several_bits, truncated, longer, blank_block, exchanged_blocks)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("damage") / "a.nc"
    run_study(STUDY, path)
    path.with_suffix(".yaml").write_text(STUDY.text)
    return path


def damaged(sound: Path, path: Path, number: int) -> None:
    """Write a copy with a damage of its own, which changes at least one byte."""
    random, image = np.random.default_rng(number), sound.read_bytes()
    changed = bytearray(image)
    while bytes(changed) == image:
        DAMAGES[number % len(DAMAGES)](changed, random)
    path.write_bytes(changed)


def used(name: str, *words: str | Path) -> tuple[int, str]:
    """Return exit status and output of a command that ends soon and without a traceback."""
    begun = time.monotonic()
    status, output = told(name, *words)
    assert time.monotonic() - begun < LONGEST, name
    return status, output


def check_named(sound: Path, path: Path) -> None:
    """Whatever takes cases or the study from a damaged archive names it, and leaves it as it is."""
    study, other, before = sound.with_suffix(".yaml"), path.with_suffix(".other.nc"), path.read_bytes()
    for words in (
        ("run", study, "-o", path),
        ("run", study, "-o", path, "--retry"),
        ("run", path, "-o", other),
        ("plan", study, "-o", path),
    ):
        status, output = used(*words)
        assert (status, path.name in output) == (2, True), words
    status, output = used("verify", path, "--sample", "0")
    assert status == 2 or (status == 1 and "bytes    DIFFERS" in output)
    assert path.name in output
    assert path.read_bytes() == before
    assert not other.exists()


@pytest.mark.parametrize("number", [*range(12), *(pytest.param(k, marks=pytest.mark.slow) for k in range(12, 500))])
def test_a_damaged_archive_is_named(sound: Path, tmp_path: Path, number: int) -> None:
    damaged(sound, tmp_path / "a.nc", number)
    check_named(sound, tmp_path / "a.nc")
