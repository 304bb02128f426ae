"""Archives whose bytes have changed are refused by whatever uses them, unless they are asked for as they are."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from quick import quick
from workflow import open_archive
from workflow.archive import ArchiveError, provenance
from workflow.cli import app
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


def check_refused(sound: Path, path: Path) -> None:
    """Use a damaged archive in every way there is."""
    page, other, study = path.with_suffix(".html"), path.with_suffix(".other.nc"), sound.with_suffix(".yaml")
    commands = {
        "run": ("run", study, "-o", path),
        "extend": ("run", study, "-o", path, "--retry"),
        "repeat": ("run", path, "-o", other),
        "plan": ("plan", study, "-o", path),
        "show": ("show", path),
        "report": ("report", path, "-o", page),
        "verify": ("verify", path, "--sample", "0"),
    }
    before = path.read_bytes()
    for name, words in commands.items():
        begun = time.monotonic()
        result = CliRunner().invoke(app, [str(word) for word in words])
        assert time.monotonic() - begun < LONGEST, name
        assert result.exception is None or isinstance(result.exception, SystemExit), (name, result.exception)
        assert result.exit_code in ((1, 2) if name == "verify" else (2,)), (name, result.output)
        assert str(path.name) in result.output + result.stderr, name
    assert path.read_bytes() == before
    assert not page.exists()
    assert not other.exists()
    for read in (open_archive, provenance):
        with pytest.raises(ArchiveError):
            read(path)


@pytest.mark.parametrize("number", range(2 * len(DAMAGES)))
def test_a_damaged_archive_is_refused(sound: Path, tmp_path: Path, number: int) -> None:
    damaged(sound, tmp_path / "a.nc", number)
    check_refused(sound, tmp_path / "a.nc")


@pytest.mark.slow
def test_a_thousand_damaged_archives_are_refused(sound: Path, tmp_path: Path) -> None:
    for number in range(1000):
        path = tmp_path / f"{number}.nc"
        damaged(sound, path, number)
        check_refused(sound, path)
        path.unlink()


def test_a_damaged_archive_is_opened_when_it_is_asked_for(sound: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    path.write_bytes(sound.read_bytes() + b"\0")
    with pytest.raises(ArchiveError, match=r"damaged=True.*--damaged"):
        open_archive(path)
    with pytest.warns(UserWarning, match="its bytes are not those that were written"):
        opened = open_archive(path, damaged=True)
    with opened as dataset, open_archive(sound) as whole:
        assert "not those that were written" in dataset.attrs["damaged"]
        assert dataset.drop_attrs().identical(whole.drop_attrs())
    for words in (("show",), ("report", "-o", str(tmp_path / "page.html"))):
        assert CliRunner().invoke(app, [*words, str(path)]).exit_code == 2
        result = CliRunner().invoke(app, [*words, str(path), "--damaged"])
        assert result.exit_code == 0
    assert "Damaged: its bytes" in (tmp_path / "page.html").read_text()
    assert "damaged: its bytes" in CliRunner().invoke(app, ["show", str(path), "--damaged"]).output


def test_a_sound_archive_is_not_said_to_be_damaged(sound: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with open_archive(sound, damaged=True) as dataset:
            assert "damaged" not in dataset.attrs
    assert "damaged" not in CliRunner().invoke(app, ["show", str(sound), "--damaged"]).output


def test_a_file_changed_back_in_time_is_read_again(sound: Path, tmp_path: Path) -> None:
    """Same size, same file, same time of change: what tells it from the one that was sound is when it was touched."""
    import os

    path = tmp_path / "a.nc"
    path.write_bytes(sound.read_bytes())
    with open_archive(path):
        pass
    before = path.stat()
    with open(path, "r+b") as file:
        file.seek(before.st_size // 2)
        byte = file.read(1)[0]
        file.seek(before.st_size // 2)
        file.write(bytes([byte ^ 1]))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    with pytest.raises(ArchiveError, match="damaged"):
        open_archive(path)
