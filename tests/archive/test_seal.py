"""The checksum inside a file: of every byte, found again, and in one place only."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from archive_samples import make_archive, sample_layout, sample_results
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from workflow import archive
from workflow.archive._seal import BLANK, FILE_CHECKSUM, seal


def sealed(path: Path, before: bytes, after: bytes) -> str:
    image = before + BLANK.encode() + after
    path.write_bytes(image)
    seal(path)
    checksum = hashlib.sha256(image).hexdigest()
    assert path.read_bytes() == before + checksum.encode() + after
    return checksum


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(before=st.binary(max_size=50), after=st.binary(max_size=50), place=st.integers(0, 10**6), bit=st.integers(0, 7))
def test_every_byte_counts(tmp_path: Path, before: bytes, after: bytes, place: int, bit: int) -> None:
    path = tmp_path / "file"
    checksum = sealed(path, before, after)
    assert archive.is_sealed_with(path, checksum)
    image = bytearray(path.read_bytes())
    image[place % len(image)] ^= 1 << bit
    path.write_bytes(image)
    assert not archive.is_sealed_with(path, checksum)


@pytest.mark.parametrize("size", [0, 1, 2**20 - 65, 2**20 - 64, 2**20, 2**21 + 5])
def test_files_of_any_length(tmp_path: Path, size: int) -> None:
    for before, after in [(size, 3), (3, size)]:
        assert archive.is_sealed_with(tmp_path / "file", sealed(tmp_path / "file", b"a" * before, b"b" * after))


@pytest.mark.parametrize("image", [b"nothing", BLANK.encode() * 2, BLANK.encode()[:-1]])
def test_without_one_place_nothing_is_sealed(tmp_path: Path, image: bytes) -> None:
    (tmp_path / "file").write_bytes(image)
    with pytest.raises(ValueError, match="place of the checksum"):
        seal(tmp_path / "file")
    assert (tmp_path / "file").read_bytes() == image


def test_an_archive_is_sealed_as_it_is_gathered(tmp_path: Path) -> None:
    layout = sample_layout()
    path = make_archive(tmp_path / "a.nc", layout, sample_results(layout))
    checksum = archive.provenance(path)[FILE_CHECKSUM]
    assert archive.is_sealed_with(path, checksum)
    assert not archive.is_sealed_with(path, BLANK)
