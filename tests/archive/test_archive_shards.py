"""Shards: committed whole or not at all, and never taken for what they are not."""

from __future__ import annotations

import dataclasses
import errno
import os
from pathlib import Path

import numpy as np
import pytest
from archive_samples import check_dataset, put_all, put_shard, sample_layout, sample_results

from workflow import archive

LAYOUT = sample_layout()
RESULTS = sample_results(LAYOUT)


@pytest.fixture
def parts(tmp_path: Path) -> Path:
    return put_all(tmp_path / "a.nc", LAYOUT, RESULTS, [4, 5, 11])


def test_units_of_a_row_and_their_cells() -> None:
    assert (LAYOUT.cut.per_row, LAYOUT.units, LAYOUT.cells) == (3, 18, 150)
    cells = [cell for unit in range(LAYOUT.units) for cell in LAYOUT.cells_of(unit)]
    assert cells == list(range(150))
    assert [len(LAYOUT.cells_of(unit)) for unit in range(4)] == [10, 10, 5, 10]
    for cell in cells:
        unit, place = LAYOUT.cut.block_of(cell)
        assert LAYOUT.cells_of(unit)[place] == cell
        *outer, inner = LAYOUT.cut.offset_of(unit)
        assert np.ravel_multi_index((*outer, inner + place), LAYOUT.shape) == cell


def test_chunks_stay_below_four_mebibytes() -> None:
    layout = sample_layout((("e", 1000),), samples=20_001, chunk=100)
    history = layout.variables[4]
    assert history.name == "displacement"
    one, chunk, length = layout.chunk_of(history)
    assert (one, chunk) == (1, 100)
    assert 2 * 2**20 < chunk * length * 8 <= 4 * 2**20
    assert layout.archive_chunk_of(history) == (100, length)


def test_all_units_are_found(parts: Path) -> None:
    shards = archive.find_shards(parts, LAYOUT)
    assert shards.complete
    assert shards.missing == ()
    assert shards.present == ((0, 18),)
    assert shards.rejected == ()
    assert shards.owner.tolist() == [0] * 4 + [1] + [2] * 6 + [3] * 7


def test_missing_units_are_named(parts: Path) -> None:
    for shard in archive.find_shards(parts, LAYOUT).files[1:3]:
        shard.path.unlink()
    shards = archive.find_shards(parts, LAYOUT)
    assert not shards.complete
    assert shards.missing == ((4, 11),)
    assert shards.present == ((0, 4), (11, 18))


def test_nothing_there_is_everything_missing(tmp_path: Path) -> None:
    assert archive.find_shards(tmp_path / "nowhere", LAYOUT).missing == ((0, 18),)


@pytest.mark.parametrize("damage", ["truncated", "flipped", "appended", "emptied"])
def test_a_damaged_shard_is_noticed(parts: Path, damage: str) -> None:
    victim = archive.find_shards(parts, LAYOUT).files[2].path
    data = bytearray(victim.read_bytes())
    if damage == "truncated":
        data = data[:-1]
    elif damage == "flipped":
        data[len(data) // 2] ^= 1
    elif damage == "appended":
        data += b"\0"
    else:
        data.clear()
    victim.write_bytes(bytes(data))
    shards = archive.find_shards(parts, LAYOUT)
    assert shards.missing == ((5, 11),)
    [(name, fault)] = shards.rejected
    assert name == victim.name
    assert "damaged" in fault
    with pytest.raises(archive.ArchiveError, match="damaged"):
        archive.gather(LAYOUT, parts, parts.parent / "a.nc")
    put_shard(parts, LAYOUT, RESULTS, 5, 11)
    assert archive.find_shards(parts, LAYOUT).complete


@pytest.mark.parametrize("other", [sample_layout(key="another"), sample_layout(chunk=5), sample_layout(precision="f4")])
def test_a_foreign_shard_is_noticed(parts: Path, tmp_path: Path, other: archive.Layout) -> None:
    foreign = put_all(tmp_path / "b.nc", other, sample_results(other))
    [stranger] = foreign.glob("*.shard")
    stranger.rename(parts / stranger.name)
    archive.find_shards(parts, LAYOUT).files[0].path.unlink()
    shards = archive.find_shards(parts, LAYOUT)
    assert shards.missing == ((0, 4),)
    [(name, fault)] = shards.rejected
    assert name == stranger.name
    assert "another study" in fault


def test_a_file_with_the_right_checksum_that_is_no_shard(parts: Path) -> None:
    import hashlib

    text = b"something else"
    (parts / f"00000000-00000018-000000-{hashlib.sha256(text).hexdigest()}.shard").write_bytes(text)
    [(_, fault)] = archive.find_shards(parts, LAYOUT).rejected
    assert fault == "not a shard"


def test_stale_temporaries_are_ignored_and_swept(parts: Path) -> None:
    shards = archive.find_shards(parts, LAYOUT)
    stale = parts / f"{shards.files[0].path.name}.1-2.tmp"
    stale.write_bytes(shards.files[0].path.read_bytes())
    assert archive.find_shards(parts, LAYOUT).rejected == ()
    archive.start_parts(parts, LAYOUT)
    assert not stale.exists()
    assert archive.find_shards(parts, LAYOUT).complete


def test_of_two_shards_the_later_task_counts(parts: Path, tmp_path: Path) -> None:
    again = sample_results(LAYOUT, seed=1)
    again["status"][:] = 0  # and what an earlier one said of a case goes with its results
    put_shard(parts, LAYOUT, again, 3, 6, task=9)
    expected = {name: values.copy() for name, values in RESULTS.items()}
    for unit in range(3, 6):
        cells = LAYOUT.cells_of(unit)
        for name in expected:
            expected[name].reshape(150, -1)[cells] = again[name].reshape(150, -1)[cells]
    archive.gather(LAYOUT, parts, tmp_path / "a.nc")
    with archive.open_archive(tmp_path / "a.nc") as dataset:
        check_dataset(dataset, LAYOUT, expected)
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
    put_shard(parts, LAYOUT, RESULTS, 0, 1)
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
        put_shard(parts, LAYOUT, RESULTS, 0, 1)
    assert str(parts) in str(caught.value)
    assert "Finished shards stay" in str(caught.value)
    assert sorted(parts.iterdir()) == before
    assert archive.find_shards(parts, LAYOUT).complete


def test_a_missing_directory_is_said(tmp_path: Path) -> None:
    with pytest.raises(archive.ArchiveError, match="no such file or directory"):
        put_shard(tmp_path / "gone.nc.parts", LAYOUT, RESULTS, 0, 1)
    with pytest.raises(archive.ArchiveError, match="no such file or directory"):
        archive.start_parts(tmp_path / "gone" / "a.nc.parts", LAYOUT)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_an_unwritable_directory_is_said(parts: Path) -> None:
    parts.chmod(0o500)
    try:
        with pytest.raises(archive.ArchiveError, match="permission denied"):
            put_shard(parts, LAYOUT, RESULTS, 0, 1)
    finally:
        parts.chmod(0o700)


def test_arrays_that_do_not_fit_are_refused(parts: Path) -> None:
    good = archive.blank(LAYOUT, 2)
    good["status"][:] = 0

    def write(first: int = 0, messages: dict[int, str] | None = None, **change: object) -> None:
        archive.write_shard(parts, 0, first, good | change, messages or {}, LAYOUT)  # type: ignore[operator]

    write()
    with pytest.raises(ValueError, match="impacts has shape"):
        write(impacts=np.zeros((2, 9)))
    with pytest.raises(ValueError, match="has not run"):
        write(status=np.where(np.arange(10) == 3, 4, good["status"]).astype("i1"))
    with pytest.raises(ValueError, match="velocity"):
        write(velocity=np.zeros((2, 10)))
    with pytest.raises(ValueError, match="units 17 to 18"):
        write(first=17)
    with pytest.raises(ValueError, match="outside"):
        write(messages={20: "nobody"})


def test_padding_may_stay_not_run(parts: Path) -> None:
    arrays = archive.blank(LAYOUT, 1)
    arrays["status"][0, :5] = 0
    archive.write_shard(parts, 0, 2, arrays, {}, LAYOUT)
    with pytest.raises(ValueError, match="has not run"):
        archive.write_shard(parts, 0, 1, arrays, {}, LAYOUT)


def test_layouts_that_contradict_themselves_are_refused() -> None:
    status, *others = LAYOUT.variables
    wrong = {
        "chunk": {"chunk": 26},
        "distinct names": {"dims": (("e", 3), ("e", 25))},
        "no such dimension": {"tails": {}, "coordinates": ()},
        "flag 'status'": {"variables": tuple(others)},
        "names used twice": {"variables": (status, status)},
        "does not fit": {"dims": (("scheme", 2), ("e", 4), ("alpha", 25))},
        "content_hash": {"provenance": {"content_hash": "0"}},
    }
    for message, change in wrong.items():
        with pytest.raises(ValueError, match=message):
            dataclasses.replace(LAYOUT, **change)
    with pytest.raises(ValueError, match="along"):
        archive.Coordinate("e", (), np.zeros(3), {})
    with pytest.raises(ValueError, match="numbers or texts"):
        archive.Coordinate("e", ("e",), np.array([1, "a"], object), {})
    with pytest.raises(ValueError, match="dtype"):
        archive.Variable("e", "metric", "c16", {})


def test_the_layout_comes_back_from_its_directory(parts: Path) -> None:
    stored = archive.read_layout(parts)
    assert stored.structure == LAYOUT.structure
    for name in ("dims", "tails", "chunk", "attrs", "provenance", "key", "variables"):
        mine, theirs = getattr(LAYOUT, name), getattr(stored, name)
        if name == "variables":
            mine, theirs = [vars(v) for v in mine], [vars(v) for v in theirs]
        assert mine == theirs
    for mine, theirs in zip(LAYOUT.coordinates, stored.coordinates, strict=True):
        assert (mine.name, mine.dims, mine.attrs) == (theirs.name, theirs.dims, theirs.attrs)
        assert mine.values.dtype == theirs.values.dtype
        np.testing.assert_array_equal(mine.values, theirs.values)


def test_shards_of_another_study_are_not_taken_over(parts: Path) -> None:
    with pytest.raises(archive.ArchiveError, match="another study"):
        archive.start_parts(parts, sample_layout(key="another"))
    assert archive.find_shards(parts, LAYOUT).complete


def test_a_directory_of_somebody_else_is_left_alone(tmp_path: Path) -> None:
    parts = archive.parts_of(tmp_path / "a.nc")
    parts.mkdir()
    (parts / "letters.txt").touch()
    with pytest.raises(archive.ArchiveError, match=r"a\.nc\.parts: holds letters\.txt, which no run left there"):
        archive.start_parts(parts, LAYOUT)
    assert [file.name for file in parts.iterdir()] == ["letters.txt"]


def test_what_a_killed_removal_left_is_taken_up(parts: Path) -> None:
    (parts / "layout.json").unlink()
    archive.start_parts(parts, LAYOUT)
    assert archive.find_shards(parts, LAYOUT).complete


@pytest.mark.parametrize("content", [b"", b"[]", b'{"format": 1}', b"\xff"])
def test_a_damaged_layout_is_said(parts: Path, content: bytes) -> None:
    (parts / "layout.json").write_bytes(content)
    with pytest.raises(archive.ArchiveError, match="damaged"):
        archive.read_layout(parts)


def test_a_layout_of_a_later_format_is_said(parts: Path) -> None:
    (parts / "layout.json").write_text('{"format": 2}')
    with pytest.raises(archive.ArchiveError, match="format 2"):
        archive.read_layout(parts)
