"""Cases that an archive holds already: found wherever they stand, and copied chunk by chunk where they may be."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import h5py
import numpy as np
import pytest
from archive_samples import DIMS, put_all, put_shard, sample_layout, sample_messages, sample_results
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow import archive
from workflow.archive import StoredCells, _layout, _stored, find_stored_cells, load_stored_cells, save_stored_cells

LAYOUT = sample_layout()
RESULTS = sample_results(LAYOUT)
HASHES = np.random.default_rng(3).integers(0, 256, size=(LAYOUT.cells, 16), dtype=np.uint8)


@pytest.fixture(scope="module", autouse=True)
def _uncombined() -> Iterator[None]:
    """Make each unit a chunk of the archive, as large ones are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_layout, "SMALL_BYTES", 0)
        yield


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("known") / "a.nc"
    archive.gather(LAYOUT, put_all(target, LAYOUT, RESULTS), target, HASHES)
    return target


def of_cells(cells: np.ndarray) -> archive.Layout:
    """A layout along a single dimension, for any choice of cells."""
    return sample_layout((("alpha", len(cells)),), chunk=min(10, len(cells)))


@settings(max_examples=25, deadline=None)
@given(cells=st.lists(st.integers(0, LAYOUT.cells - 1), min_size=1, max_size=60, unique=True))
def test_cases_are_found_and_taken_wherever_they_stand(path: Path, cells: list[int]) -> None:
    chosen = np.array(cells)
    layout = of_cells(chosen)
    hashes = HASHES[chosen].copy()
    new = np.arange(len(cells)) % 3 == 2
    hashes[new, 15] ^= 1  # others, whose first bytes are the same
    stored_cells = find_stored_cells(path, layout, hashes)
    assert stored_cells.cells.tolist() == np.where(new, -1, chosen).tolist()
    old = np.flatnonzero(~new)
    values, messages = stored_cells.take(layout, old)
    for variable in layout.variables:
        flat = RESULTS[variable.name].reshape(LAYOUT.cells, *layout.shape_of(variable, 1)[2:])
        np.testing.assert_array_equal(values[variable.name], flat[chosen[old]])
    texts = sample_messages(LAYOUT, RESULTS)
    assert messages == {k: texts[int(cell)] for k, cell in enumerate(chosen[old]) if int(cell) in texts}
    assert stored_cells.messages(old) == {int(old[k]): text for k, text in messages.items()}
    ok = RESULTS["status"].ravel()[chosen[old]] == 0
    assert stored_cells.without_failures().cells[old].tolist() == np.where(ok, chosen[old], -1).tolist()


def runs() -> st.SearchStrategy[list[int]]:
    """Cells in runs that now and then are whole chunks of the archive."""
    starts = st.sampled_from([0, 5, 10, 20, 25, 35, 45, 50, 140, 145])
    pieces = st.tuples(starts, st.sampled_from([5, 10])).map(lambda run: list(range(run[0], min(sum(run), 150))))
    return st.lists(pieces, min_size=1, max_size=6).map(lambda runs: list(chain.from_iterable(runs)))


@settings(max_examples=100, deadline=None)
@given(cells=runs())
def test_only_whole_chunks_are_copied(path: Path, cells: list[int]) -> None:
    """A unit is copied where a unit of the archive has these very cases, never over the end of a row."""
    layout = of_cells(np.array(cells))
    if layout.chunk != LAYOUT.chunk:
        return
    stored_cells = StoredCells(path, np.array(cells))
    units = {tuple(LAYOUT.cells_of(unit)): LAYOUT.cells_of(unit).start for unit in range(LAYOUT.units)}
    expected = [units.get(tuple(cells[c] for c in layout.cells_of(unit)), -1) for unit in range(layout.units)]
    assert stored_cells.copies(layout).tolist() == expected


def test_chunks_of_another_shape_are_not_copied(path: Path) -> None:
    every = StoredCells(path, np.arange(LAYOUT.cells))
    assert (every.copies(LAYOUT) >= 0).all()
    for other in (
        sample_layout(chunk=5),
        sample_layout(samples=8),
        sample_layout(periods=2),
        sample_layout(precision="f4"),
        dataclasses.replace(LAYOUT, variables=(*LAYOUT.variables, archive.Variable("more", "metric", "f8", {}))),
    ):
        assert (every.copies(other) == -1).all()
    assert (StoredCells(path, np.full(LAYOUT.cells, -1)).copies(LAYOUT) == -1).all()


def test_what_is_copied_is_gathered(path: Path, tmp_path: Path) -> None:
    """Half of the units from the archive, half from shards, in an archive of one more row."""
    target = tmp_path / "b.nc"
    parts = put_all(target, LAYOUT, RESULTS)
    for shard in parts.glob("*.shard"):
        shard.unlink()
    put_shard(parts, LAYOUT, RESULTS, 0, 5)
    cells = np.arange(LAYOUT.cells)
    cells[:20] = -1
    with pytest.raises(archive.ArchiveError, match="units are missing"):
        archive.gather(LAYOUT, parts, target, HASHES, StoredCells(path, np.where(cells < 60, -1, cells)))
    archive.gather(LAYOUT, parts, target, HASHES, StoredCells(path, cells))
    assert archive.content_hash(target) == archive.content_hash(path)


def test_units_of_chunks_that_are_joined_are_not_copied(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_layout, "SMALL_BYTES", 2**16)
    joined = dataclasses.replace(LAYOUT)
    assert joined.joined
    assert (StoredCells(path, np.arange(LAYOUT.cells)).copies(joined) == -1).all()


def test_missing_variables_and_periods(path: Path) -> None:
    cells = np.arange(LAYOUT.cells)
    wide = sample_layout(periods=5)
    values, _ = find_stored_cells(path, wide, HASHES).take(wide, cells)
    np.testing.assert_array_equal(values["period_impulse"][:, :3], RESULTS["period_impulse"].reshape(-1, 3))
    assert np.isnan(values["period_impulse"][:, 3:]).all()
    for optional in (True, False):
        more = archive.Variable("more", "metric", "f8", {}, optional)
        layout = dataclasses.replace(LAYOUT, variables=(*LAYOUT.variables, more))
        if optional:
            values, _ = find_stored_cells(path, layout, HASHES).take(layout, cells)
            assert np.isnan(values["more"]).all()
        else:
            with pytest.raises(archive.ArchiveError, match="without more"):
                find_stored_cells(path, layout, HASHES)
    with pytest.raises(archive.ArchiveError, match="without displacement"):
        find_stored_cells(path, sample_layout(samples=8), HASHES)


def test_a_value_too_large_for_float32_is_infinite(tmp_path: Path) -> None:
    layout = sample_layout((("e", 2),), chunk=2)
    results = sample_results(layout)
    results["displacement"][:] = 1e300
    archive.gather(layout, put_all(tmp_path / "a.nc", layout, results), tmp_path / "a.nc", HASHES[:2])
    narrow = sample_layout((("e", 2),), chunk=2, precision="f4")
    values, _ = find_stored_cells(tmp_path / "a.nc", narrow, HASHES[:2]).take(narrow, np.arange(2))
    assert np.isposinf(values["displacement"]).all()


@pytest.mark.parametrize("dims", [(), DIMS[:1], DIMS])
def test_a_single_case_to_and_from_a_grid(path: Path, tmp_path: Path, dims: tuple[tuple[str, int], ...]) -> None:
    layout = sample_layout(dims)
    results = sample_results(layout)
    target = tmp_path / "a.nc"
    archive.gather(layout, put_all(target, layout, results), target, HASHES[: layout.cells])
    single = sample_layout(())
    values, _ = find_stored_cells(target, single, HASHES[:1]).take(single, np.zeros(1, dtype=np.int64))
    expected = results["displacement"].reshape(layout.cells, -1)[:1]
    np.testing.assert_array_equal(values["displacement"], expected)


def test_what_a_worker_is_given(path: Path, tmp_path: Path) -> None:
    parts = archive.parts_of(tmp_path / "a.nc")
    parts.mkdir()
    assert load_stored_cells(parts) is None
    save_stored_cells(parts, StoredCells(path, np.array([3, -1, 4])))
    stored_cells = load_stored_cells(parts)
    assert stored_cells is not None
    assert (stored_cells.path, stored_cells.cells.tolist()) == (tmp_path / "a.nc", [3, -1, 4])
    save_stored_cells(parts, None)
    assert load_stored_cells(parts) is None


@pytest.mark.parametrize("name", ["status", "displacement", "provenance/case_hash"])
def test_a_damaged_archive_is_said(path: Path, tmp_path: Path, name: str) -> None:
    damaged = tmp_path / "a.nc"
    damaged.write_bytes(path.read_bytes())
    with h5py.File(damaged, "r+") as file:
        del file[name]
    with pytest.raises(archive.ArchiveError, match=r"damaged|without"):
        find_stored_cells(damaged, LAYOUT, HASHES)
    damaged.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(archive.ArchiveError, match="damaged"):
        find_stored_cells(damaged, LAYOUT, HASHES)
    with pytest.raises(archive.ArchiveError, match="damaged"):
        StoredCells(damaged, np.arange(LAYOUT.cells)).take(LAYOUT, np.arange(3))


class Reads:
    """An array that keeps how many numbers each read of it took."""

    def __init__(self, values: np.ndarray):
        self.values, self.taken = values, list[int]()
        self.shape, self.ndim, self.dtype = values.shape, values.ndim, values.dtype

    def __getitem__(self, box: tuple[slice, ...]) -> np.ndarray:
        part = self.values[box]
        self.taken.append(part.size)
        return part


@pytest.mark.parametrize(("step", "reads"), [(1, 1), (2, 1), (7, 29)])
def test_cells_are_read_in_few_boxes(step: int, reads: int) -> None:
    """Nine of eleven cells in each row: at once where most of the rows are wanted, else row by row."""
    stored = Reads(np.arange(200 * 11.0).reshape(200, 11))
    places = (11 * np.arange(0, 200, step)[:, None] + np.arange(1, 10)).ravel()
    np.testing.assert_array_equal(_stored._rows(stored, places[::-1], tail=0), stored.values.ravel()[places[::-1]])
    assert len(stored.taken) == reads
    assert sum(stored.taken) <= 2 * places.size
