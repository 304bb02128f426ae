"""Shards: committed whole or not at all, never taken for what they are not, written by threads while another reads."""

import errno
import os
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from archive_samples import (
    TEXTS,
    begin,
    check_dataset,
    gather,
    put_all,
    put_shard,
    sample_hashes,
    sample_results,
    sample_template,
    stored_in,
)
from hypothesis import example, given, settings
from hypothesis import strategies as st

from workflow import archive
from workflow.archive._gather import fletcher32

TEMPLATE = sample_template()
RESULTS = sample_results(TEMPLATE)
HASHES = sample_hashes(TEMPLATE)


@pytest.fixture
def parts(tmp_path: Path) -> Path:
    return put_all(tmp_path / "a.nc", TEMPLATE, RESULTS, [40, 50, 110])


def held(parts: Path) -> list[int]:
    """Return the cells that are stored."""
    return np.flatnonzero(stored_in(parts).holds(HASHES)).tolist()


def test_chunks_stay_below_a_mebibyte() -> None:
    template = sample_template((("e", 1000),), samples=20_001)
    chunk, length = template["displacement"].encoding["chunksizes"]
    assert (chunk, length) == (6, 20_001)
    long = sample_template((("e", 3),), samples=2_000_001)
    chunk, length = long["displacement"].encoding["chunksizes"]
    assert chunk == 1
    assert 2**19 < length * 8 <= 2**20


def test_a_case_is_told_from_another_by_all_bytes_of_its_hash(parts: Path) -> None:
    other = HASHES.copy()
    other[:, 15] ^= 1
    assert not stored_in(parts).holds(other).any()
    assert archive.are_among(HASHES, np.concatenate([other, HASHES[3:5]])).nonzero()[0].tolist() == [3, 4]


def test_cases_that_are_taken_back_are_held_again_when_they_have_been_run(parts: Path) -> None:
    archive.take_back(parts, "00000005", HASHES[30:70])
    put_shard(parts, TEMPLATE, RESULTS, 60, 65, task=6)
    assert held(parts) == [*range(30), *range(60, 65), *range(70, 150)]
    status = stored_in(parts).status_of(HASHES)
    assert (status == 4).nonzero()[0].tolist() == [*range(30, 60), *range(65, 70)]
    with pytest.raises(archive.ArchiveError, match="35 of 150 cases are missing"):
        gather(parts, TEMPLATE, parts.parent / "a.nc")


@pytest.mark.parametrize("damage", ["truncated", "flipped", "emptied", "without hashes"])
def test_a_damaged_shard_is_noticed(parts: Path, damage: str) -> None:
    victim = sorted(parts.glob("*.shard"))[2]
    data = bytearray(victim.read_bytes())
    if damage == "truncated":
        data = data[:-1]
    elif damage == "flipped":
        data[len(data) // 2] ^= 1
    elif damage == "without hashes":
        head = b'{"status": ["|i1", [60], %d]}' % zlib.crc32(bytes(60))
        data = bytearray(b"%08x " % zlib.crc32(head) + head + b"\n" + bytes(60))
    else:
        data.clear()
    victim.write_bytes(bytes(data))
    assert held(parts) == [*range(50), *range(110, 150)]
    with pytest.raises(archive.ArchiveError, match="60 of 150 cases are missing"):
        gather(parts, TEMPLATE, parts.parent / "a.nc")
    put_shard(parts, TEMPLATE, RESULTS, 50, 110)
    assert len(held(parts)) == 150
    gather(parts, TEMPLATE, parts.parent / "a.nc")


def test_a_shard_that_is_damaged_while_it_is_gathered(parts: Path) -> None:
    stored = stored_in(parts)
    victim = sorted(parts.glob("*.shard"))[2]
    data = bytearray(victim.read_bytes())
    data[len(data) // 2] ^= 1
    victim.write_bytes(data)
    with pytest.raises(archive.ArchiveError, match="damaged while it was read"):
        archive.gather(TEMPLATE, TEXTS, parts, parts.parent / "a.nc", HASHES, stored)
    assert [entry.name for entry in parts.parent.iterdir()] == [parts.name]
    assert not list(parts.glob("*.tmp"))


@pytest.mark.parametrize("seed", range(3))
def test_no_changed_byte_of_a_value_passes(seed: int, tmp_path: Path) -> None:
    """What is not noticed changes none: dates in the directory of the zip, say."""
    shard = put_shard(begin(tmp_path / "a.nc"), TEMPLATE, RESULTS, 0, 3)
    image, random = shard.read_bytes(), np.random.default_rng(seed)
    [source] = archive.find_shards(shard.parent)
    before = {name: source.read(name).tobytes() for name in source.kinds}
    for place in random.choice(len(image), 300, replace=False).tolist():
        changed = bytearray(image)
        changed[place] ^= int(random.integers(1, 256))
        shard.write_bytes(changed)
        for source in archive.find_shards(shard.parent):
            if not archive.lacking(TEMPLATE, source.kinds):
                assert all(source.read(name).tobytes() == before[name] for name in map(str, TEMPLATE.data_vars))
                assert source.hashes.tobytes() == before["case_hash"]


def test_stale_temporaries_are_ignored_and_swept(parts: Path) -> None:
    [first, *_] = sorted(parts.glob("*.shard"))
    stale = parts / f"{first.name}.1-2.tmp"
    stale.write_bytes(first.read_bytes())
    assert len(held(parts)) == 150
    begin(parts.parent / "a.nc")
    assert not stale.exists()
    assert len(held(parts)) == 150


def test_of_two_shards_the_later_one_counts(parts: Path, tmp_path: Path) -> None:
    again = sample_results(TEMPLATE, seed=1)
    again["status"][:] = 0  # and what an earlier one said of a case goes with its results
    put_shard(parts, TEMPLATE, again, 30, 60, task=9)
    expected = {name: values.copy() for name, values in RESULTS.items()}
    for name in expected:
        expected[name].reshape(150, -1)[30:60] = again[name].reshape(150, -1)[30:60]
    gather(parts, TEMPLATE, tmp_path / "a.nc")
    with archive.open_archive(tmp_path / "a.nc") as dataset:
        check_dataset(dataset, TEMPLATE, expected)
    assert expected["status"].sum() < RESULTS["status"].sum()


def test_a_shard_is_flushed_before_and_its_directory_after_the_rename(
    parts: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    events = []
    fsync, replace = os.fsync, os.replace

    def spy_fsync(descriptor: int) -> None:
        events.append(("fsync", Path(os.readlink(f"/proc/self/fd/{descriptor}")).suffix))
        fsync(descriptor)

    def spy_replace(source: Path, target: Path) -> None:
        events.append(("replace", Path(source).suffix, Path(target).suffix))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", spy_fsync)
    monkeypatch.setattr(os, "replace", spy_replace)
    put_shard(parts, TEMPLATE, RESULTS, 0, 1)
    assert events == [("fsync", ".tmp"), ("replace", ".tmp", ".shard"), ("fsync", ".parts")]


@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize(
    ("number", "text"), [(errno.ENOSPC, "no space left"), (errno.EROFS, "read-only"), (errno.EDQUOT, "quota")]
)
def test_a_failed_write_is_said_and_leaves_what_is_finished(
    parts: Path, monkeypatch: pytest.MonkeyPatch, call: str, number: int, text: str
) -> None:
    before = sorted(parts.iterdir())

    def fail(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, fail)
    with pytest.raises(archive.ArchiveError, match=text) as caught:
        put_shard(parts, TEMPLATE, RESULTS, 0, 1)
    assert str(parts) in str(caught.value)
    assert "Finished shards stay" in str(caught.value)
    assert sorted(parts.iterdir()) == before
    assert len(held(parts)) == 150


def test_a_missing_directory_is_said(tmp_path: Path) -> None:
    with pytest.raises(archive.ArchiveError, match="no such file or directory"):
        put_shard(tmp_path / "gone.nc.parts", TEMPLATE, RESULTS, 0, 1)
    with pytest.raises(archive.ArchiveError, match="no such file or directory"):
        begin(tmp_path / "gone" / "a.nc")


def test_what_a_killed_removal_left_is_taken_up(parts: Path) -> None:
    (parts / "command.json").unlink()
    assert archive.read_command(parts) is None
    begin(parts.parent / "a.nc")
    assert len(held(parts)) == 150


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b'{"texts": {}, "priority": 3}', b"\xff"])
def test_a_damaged_command_is_said(parts: Path, content: bytes) -> None:
    (parts / "command.json").write_bytes(content)
    with pytest.raises(archive.ArchiveError, match="damaged"):
        archive.read_command(parts)


@settings(max_examples=100, deadline=None)
@given(image=st.binary(min_size=1, max_size=2000))
@example(bytes(6))
@example(b"\xff" * 1999)
@example(b"\xff\xff" * 700)
@example(b"\x01\xfe\x7f" * 40_001)
def test_the_checksum_of_a_chunk_is_hdf5_s(image: bytes) -> None:
    with h5py.File("a.h5", "w", driver="core", backing_store=False) as file:
        values = np.frombuffer(image, np.uint8)
        file.create_dataset("a", data=values, chunks=(len(image),), fletcher32=True)
        file.flush()
        _, chunk = file["a"].id.read_direct_chunk((0,))
    assert chunk == image + fletcher32(values)
