"""The checksum at the end of a file is of every byte before it, and HDF5 reads no further than its own end."""

import hashlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from workflow.archive._checksums import has_sound_head, is_intact, is_sealed, seal


def sealed(path: Path, image: bytes) -> Path:
    path.write_bytes(image)
    assert not is_intact(path)
    seal(path)
    assert path.read_bytes().startswith(image)
    sealed, digest = path.read_bytes().rsplit(b"\nsha256 ", 1)
    assert digest == hashlib.sha256(sealed).hexdigest().encode()
    return path


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(image=st.binary(max_size=50), place=st.integers(0, 10**6), bit=st.integers(0, 7))
def test_every_byte_counts(tmp_path: Path, image: bytes, place: int, bit: int) -> None:
    path = sealed(tmp_path / "file", image)
    assert is_sealed(path)
    assert is_intact(path)
    changed = bytearray(path.read_bytes())
    changed[place % len(changed)] ^= 1 << bit
    path.write_bytes(changed)
    assert not is_intact(path)


@pytest.mark.parametrize("size", [0, 1, 71, 72, 73, 2**20 - 1, 2**20, 2**21 + 5])
def test_files_of_any_length(tmp_path: Path, size: int) -> None:
    path = sealed(tmp_path / "file", b"a" * size)
    assert is_intact(path)
    for image in (path.read_bytes() + b"\0", path.read_bytes()[:-1], path.read_bytes()[1:]):
        path.write_bytes(image)
        assert not is_intact(path)


def test_the_head_ends_where_chunks_begin(tmp_path: Path) -> None:
    path = sealed(tmp_path / "file", b"a" * 100 + b"TREE" + b"b" * 100)
    image = path.read_bytes()
    for place, sound in ((0, False), (99, False), (100, True), (203, True)):
        path.write_bytes(image[:place] + b"c" + image[place + 1 :])
        assert has_sound_head(path) == sound
    path.write_bytes(b"a" * 100)
    assert has_sound_head(path)  # of another program, or of an earlier version of this one
