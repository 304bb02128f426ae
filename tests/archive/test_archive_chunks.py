"""Chunks of the archive: one set for all variables, few where results are small, usable by dask in any tool."""

from pathlib import Path
from typing import Any

import dask
import h5py
import pytest
import xarray as xr
from archive_samples import DIMS, check_dataset, make_archive, sample_results, sample_template

from studies import SCENE, parsed
from workflow import archive
from workflow.plan import _template
from workflow.run import run_study


def lengths_of(template: xr.Dataset) -> tuple[int, ...]:
    return tuple(template["status"].encoding.get("chunksizes", ()))


MANY = (("model", 3), ("gap", 12), ("e", 5))


@pytest.fixture(params=["one chunk", "many"])
def small_chunks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut archives of some hundred numbers as those of millions are."""
    if request.param == "many":
        monkeypatch.setattr(_template, "CHUNK_BYTES", 7 * 8 * 10)


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("chunks", [{}, "auto"], ids=["stored", "auto"])
@pytest.mark.parametrize("dims", [MANY, DIMS, (("e", 3), ("model", 3)), ()], ids=["many", "rows", "zip", "one"])
def test_dask_takes_all_variables(tmp_path: Path, dims: Any, chunks: Any) -> None:
    template = sample_template(dims)
    results = sample_results(template)
    path = make_archive(tmp_path / "a.nc", template, results, range(1, template["status"].size, 70))
    for opened in (archive.open_archive, xr.open_dataset):
        if opened is xr.open_dataset and chunks == "auto":
            continue  # of texts it cannot choose
        with opened(path, chunks=chunks) as dataset:
            sizes = dict(dataset.chunks)  # raises where variables are cut otherwise
            if chunks == {}:
                lengths = dict(zip([name for name, _ in dims], lengths_of(template), strict=True))
                assert all(max(sizes[name]) == length for name, length in lengths.items())
            check_dataset(dataset.compute(), template, results)
            assert dataset["message"].dtype.kind == "O"


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.filterwarnings("ignore:The specified chunks separate the stored chunks")
def test_chunks_that_dask_chooses_are_the_same_for_all_variables(tmp_path: Path) -> None:
    """As of archives above dask's 128 MB a variable: of flags it takes eight times as many at once as of metrics."""
    template = sample_template(MANY)
    results = sample_results(template)
    path = make_archive(tmp_path / "a.nc", template, results, range(1, template["status"].size, 70))
    with dask.config.set({"array.chunk-size": "400 B"}), archive.open_archive(path, chunks="auto") as dataset:
        sizes = dict(dataset.chunks)  # raises where variables are cut otherwise
        assert sum(map(len, sizes.values())) > len(sizes)
        check_dataset(dataset.compute(), template, results)


@pytest.mark.usefixtures("small_chunks")
def test_a_warning_about_chunks_is_none_about_the_file(tmp_path: Path) -> None:
    template = sample_template(MANY)
    path = make_archive(tmp_path / "a.nc", template, sample_results(template), range(1, template["status"].size, 70))
    with pytest.raises(UserWarning, match="separate the stored chunks"):
        archive.open_archive(path, chunks={"gap": 5})


def test_texts_of_a_zip_have_the_chunks_of_the_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_template, "CHUNK_BYTES", 8 * 3)
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


def test_small_results_make_few_chunks(tmp_path: Path) -> None:
    template = sample_template(MANY, samples=0)
    path = make_archive(tmp_path / "a.nc", template, sample_results(template), range(1, 180, 9))
    with h5py.File(path) as file:
        assert {file[name].id.get_num_chunks() for name in ("status", "impacts", "period_impulse")} == {1}
