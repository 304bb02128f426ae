"""Chunks of the archive: one set for all variables, few where results are small, usable by dask in any tool."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import dask
import h5py
import numpy as np
import pytest
import xarray as xr
from archive_samples import DIMS, check_dataset, make_archive, sample_layout, sample_results

from studies import SCENE, parsed
from workflow import archive
from workflow.archive import _layout
from workflow.archive._cut import Cut, largest_cut
from workflow.run import run_study

MANY = (("model", 3), ("gap", 12), ("e", 5))
"""180 runs of one case each, as a study of long computations is cut."""


@pytest.fixture(params=["one chunk", "many"])
def small_chunks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut archives of some hundred numbers as those of millions are."""
    if request.param == "many":
        monkeypatch.setattr(_layout, "JOINED_BYTES", 7 * 8 * 10)


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("chunks", [{}, "auto"], ids=["stored", "auto"])
@pytest.mark.parametrize("dims", [MANY, DIMS, (("e", 3), ("model", 3)), ()], ids=["many", "rows", "zip", "one"])
def test_dask_takes_all_variables(tmp_path: Path, dims: Any, chunks: Any) -> None:
    layout = sample_layout(dims, chunk=1)
    results = sample_results(layout)
    path = make_archive(tmp_path / "a.nc", layout, results, range(1, layout.units, 7))
    for opened in (archive.open_archive, xr.open_dataset):
        if opened is xr.open_dataset and chunks == "auto":
            continue  # of texts it cannot choose
        with opened(path, chunks=chunks) as dataset:
            sizes = dict(dataset.chunks)  # raises where variables are cut otherwise
            if chunks == {}:
                lengths = dict(zip([name for name, _ in dims], layout.stored.lengths, strict=True))
                assert all(max(sizes[name]) == length for name, length in lengths.items())
            check_dataset(dataset.compute(), layout, results)
            assert dataset["message"].dtype.kind == "O"


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.filterwarnings("ignore:The specified chunks separate the stored chunks")
def test_chunks_that_dask_chooses_are_the_same_for_all_variables(tmp_path: Path) -> None:
    """As of archives above dask's 128 MB a variable: of flags it takes eight times as many at once as of metrics."""
    layout = sample_layout(MANY, chunk=1)
    results = sample_results(layout)
    path = make_archive(tmp_path / "a.nc", layout, results, range(1, layout.units, 7))
    with dask.config.set({"array.chunk-size": "400 B"}), archive.open_archive(path, chunks="auto") as dataset:
        sizes = dict(dataset.chunks)  # raises where variables are cut otherwise
        assert sum(map(len, sizes.values())) > len(sizes)
        check_dataset(dataset.compute(), layout, results)


@pytest.mark.usefixtures("small_chunks")
def test_a_warning_about_chunks_is_none_about_the_file(tmp_path: Path) -> None:
    layout = sample_layout(MANY, chunk=1)
    path = make_archive(tmp_path / "a.nc", layout, sample_results(layout), range(1, layout.units, 7))
    with pytest.raises(UserWarning, match="separate the stored chunks"):
        archive.open_archive(path, chunks={"gap": 5})


def test_texts_of_a_zip_have_the_chunks_of_the_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_layout, "JOINED_BYTES", 8 * 3)
    text = "study: a\n" + SCENE + "axes: {e: [0, 0.5, 0.9]}\n"
    text += "zip: {pair: {scheme: [moreau, carpenter, moreau], h: [1e-4, 1e-4, 2e-4]}}\n"
    run_study(parsed(text + "output: {interval: 20 ms, histories: []}\n"), tmp_path / "a.nc")
    for opened in (archive.open_archive, xr.open_dataset):
        with opened(tmp_path / "a.nc", chunks={}) as dataset:
            assert dict(dataset.chunks)["pair"] == (1, 1, 1)
            assert dataset["scheme"].values.tolist() == ["moreau", "carpenter", "moreau"]
            assert dataset["scheme"].dims == ("pair",)
    with archive.open_archive(tmp_path / "a.nc", chunks="auto") as dataset:
        assert dataset.compute()["scheme"].values.tolist() == ["moreau", "carpenter", "moreau"]


def test_small_units_are_joined(tmp_path: Path) -> None:
    layout = sample_layout(MANY, samples=0, chunk=1)
    assert layout.units == 180
    assert layout.joined
    path = make_archive(tmp_path / "a.nc", layout, sample_results(layout), range(1, 180))
    with h5py.File(path) as file:
        assert {name: file[name].id.get_num_chunks() for name in ("status", "impacts", "period_impulse")} == {
            "status": 1,
            "impacts": 1,
            "period_impulse": 1,
        }


def test_large_units_are_copied_as_they_are(tmp_path: Path) -> None:
    layout = sample_layout((("gap", 4), ("e", 3)), samples=3001, chunk=3)
    assert not layout.joined
    path = make_archive(tmp_path / "a.nc", layout, sample_results(layout), [1, 3])
    with h5py.File(path) as file:
        assert file["displacement"].chunks == (1, 3, 3001)
        assert file["impacts"].chunks == (1, 3)


@pytest.mark.parametrize("most", [1, 2, 3, 7, 8, 40, 10**6])
@pytest.mark.parametrize("unit", [1, 3, 25, 50, 75])
def test_any_units_make_any_chunks(tmp_path: Path, unit: int, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_layout, "JOINED_BYTES", 7 * 8 * most)
    layout = sample_layout(chunk=unit)
    results = sample_results(layout)
    path = make_archive(tmp_path / "a.nc", layout, results, range(2, layout.units, 3))
    with archive.open_archive(path) as dataset:
        check_dataset(dataset, layout, results)
    whole = make_archive(tmp_path / "b.nc", sample_layout(), results)
    assert _hash_of_values(path) == _hash_of_values(whole)


def _hash_of_values(path: Path) -> list[bytes]:
    with h5py.File(path) as file:
        return [file[name][...].tobytes() for name in ("status", "impacts", "displacement", "period_impulse")]


def test_content_does_not_depend_on_how_units_are_joined(tmp_path: Path) -> None:
    results = sample_results(sample_layout())
    hashes = {
        archive.content_hash(make_archive(tmp_path / f"{unit}.nc", sample_layout(chunk=unit), results))
        for unit in (1, 5, 25, 75)
    }
    assert len(hashes) == 1


@pytest.mark.parametrize("shape", [(), (1,), (7,), (3, 4), (2, 1, 5), (2, 3, 1, 4)])
def test_blocks_are_rectangles_that_hold_every_cell_once(shape: tuple[int, ...]) -> None:
    index = np.arange(math.prod(shape)).reshape(shape)
    for most in range(1, index.size + 2):
        cut = largest_cut(shape, most)
        assert cut.size <= most
        cells = []
        for block in range(cut.count):
            place = tuple(slice(a, a + n) for a, n in zip(cut.offset_of(block), cut.lengths, strict=True))
            assert index[place].ravel().tolist() == list(cut.cells_of(block))
            cells += list(cut.cells_of(block))
        assert cells == list(range(index.size))
        for cell in cells:
            block, place = cut.block_of(cell)
            assert cut.cells_of(block)[place] == cell


@pytest.mark.parametrize(("shape", "size"), [((3, 4), 5), ((3, 4), 13), ((3, 4), 0), ((), 2), ((2, 3, 4), 16)])
def test_blocks_that_are_no_rectangles_are_refused(shape: tuple[int, ...], size: int) -> None:
    with pytest.raises(ValueError, match="rectangle"):
        Cut(shape, size)


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("chunks", [None, {}], ids=["none", "stored"])
@pytest.mark.parametrize("messages", ["some", "none"])
def test_messages_are_texts_that_are_read_when_they_are_used(tmp_path: Path, chunks: Any, messages: str) -> None:
    layout = sample_layout()
    results = sample_results(layout)
    if messages == "none":
        results["status"][...] = 0
    path = make_archive(tmp_path / "a.nc", layout, results)
    for opened in (archive.open_archive, xr.open_dataset):
        with opened(path, chunks=chunks) as dataset:
            assert not dataset["message"].variable._in_memory
            check_dataset(dataset.compute(), layout, results)


def test_the_chunks_of_an_archive_stay_when_it_grows(tmp_path: Path) -> None:
    """Whole chunks are copied only where they are cut alike."""
    shapes = [(("gap", n), ("e", 3)) for n in (4, 5, 9)]
    chunks = {sample_layout(shape, samples=3001, chunk=3).stored.lengths for shape in shapes}
    assert chunks == {(1, 3)}
