"""From shards, or cases that are stored, to an archive: the same bits in any number of pieces, and never half a one."""

import errno
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import dask
import h5py
import numpy as np
import pytest
import xarray as xr
from archive_samples import (
    DIMS,
    TEXTS,
    begin,
    branch_template,
    by_case,
    check_dataset,
    gather,
    make_archive,
    put_all,
    sample_hashes,
    sample_messages,
    sample_results,
    sample_template,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from studies import SCENE, parsed
from workflow import archive
from workflow.archive import _gather
from workflow.plan import _template, encode
from workflow.run import run_study

TEMPLATES = {
    "three dimensions, partial edge": sample_template(),
    "two dimensions": sample_template(DIMS[1:]),
    "one dimension": sample_template(DIMS[2:]),
    "innermost of text": sample_template((("e", 4), ("scheme", 3))),
    "one cell": sample_template(()),
    "one cell without histories": sample_template((), samples=0, periods=0),
    "one long": sample_template((("scheme", 1), ("e", 1))),
    "four dimensions": sample_template((("scheme", 2), ("model", 3), ("e", 2), ("alpha", 5))),
    "zip innermost": sample_template((("e", 2), ("model", 3))),
    "float32": sample_template(precision="f4"),
    "no histories": sample_template(samples=0),
    "no periods": sample_template(periods=0),
    "metrics alone": sample_template(samples=0, periods=0),
    "branches": branch_template(),
}
TEMPLATE = TEMPLATES["three dimensions, partial edge"]
RESULTS = sample_results(TEMPLATE)
HASHES = sample_hashes(TEMPLATE)


@pytest.mark.parametrize("most", [2**21, 560, 8])
@pytest.mark.parametrize("template", TEMPLATES.values(), ids=TEMPLATES.keys())
def test_what_goes_in_comes_out(
    tmp_path: Path, template: xr.Dataset, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In one chunk, in chunks that end within rows, and in pieces of one history."""
    monkeypatch.setattr(_template, "CHUNK_BYTES", most)
    template = encode(template.copy())
    results = sample_results(template)
    path = make_archive(tmp_path / "a.nc", template, results, range(1, template["status"].size, 16))
    assert list(tmp_path.iterdir()) == [path]
    with archive.open_archive(path) as dataset:
        check_dataset(dataset, template, results)
    with xr.open_dataset(path) as dataset:
        check_dataset(dataset, template, results)


@pytest.mark.parametrize("name", ["processor_time", "batch_width"])
def test_content_does_not_depend_on_pieces_chunks_or_processor_time(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = make_archive(tmp_path / "a.nc", TEMPLATE, RESULTS)
    later = RESULTS | {name: RESULTS[name] + 1}
    monkeypatch.setattr(_template, "CHUNK_BYTES", 560)
    for number, cut in enumerate(([], [5], [1, 2, 3, 10], range(1, 150))):
        second = make_archive(tmp_path / f"{number}.nc", encode(TEMPLATE.copy()), later, cut)
        assert archive.content_hash(first) == archive.content_hash(second)


def test_the_hash_is_what_its_description_says(tmp_path: Path) -> None:
    template = sample_template((("e", 2),), samples=3, periods=2)
    results = sample_results(template)
    path = make_archive(tmp_path / "a.nc", template, results)

    digest = hashlib.sha256()

    def add(name: str, dims: list[str], kind: str, shape: list[int], data: bytes) -> None:
        digest.update(json.dumps([name, dims, kind, shape]).encode() + b"\n" + data)

    add("displacement", ["e", "t"], "<f8", [2, 3], results["displacement"].tobytes())
    add("e", ["e"], "<f8", [2], np.array([0.9, 0.0]).tobytes())
    add("h", [], "<f8", [], np.float64(1e-4).tobytes())
    add("impacts", ["e"], "<f8", [2], results["impacts"].tobytes())
    add("lumping", ["lumping_length"], "|S1", [7], "chaîne".encode())
    add("message", ["e", "message_length"], "|S1", [2, 1], bytes(2))
    add("period", ["period"], "<i8", [2], np.array([1, 2]).tobytes())
    add("period_impulse", ["e", "period"], "<f8", [2, 2], results["period_impulse"].tobytes())
    add("status", ["e"], "|i1", [2], b"\0\0")
    add("t", ["t"], "<f8", [3], np.array([0.0, 1e-3, 2e-3]).tobytes())
    assert archive.content_hash(path) == digest.hexdigest()


def test_one_nan_is_as_good_as_another(tmp_path: Path) -> None:
    template = TEMPLATES["metrics alone"]
    results = sample_results(template)
    other = {name: values.copy() for name, values in results.items()}
    for name in ("impacts", "processor_time"):
        other[name][np.isnan(other[name])] = np.uint64(0xFFF8_0000_0000_0001).view(np.float64)
    assert other["impacts"].tobytes() != results["impacts"].tobytes()
    a = make_archive(tmp_path / "a.nc", template, results)
    b = make_archive(tmp_path / "b.nc", template, other)
    assert archive.content_hash(a) == archive.content_hash(b)


def test_a_value_too_large_for_float32_is_infinite(tmp_path: Path) -> None:
    """In a shard, and where an archive of float64 is taken by one of float32."""
    narrow, results = TEMPLATES["float32"], RESULTS | {"displacement": np.full_like(RESULTS["displacement"], 1e300)}
    with archive.open_archive(make_archive(tmp_path / "a.nc", narrow, results)) as dataset:
        written = dataset["displacement"].values
    wide = make_archive(tmp_path / "b.nc", TEMPLATE, results)
    for values in (written, taken(wide, narrow, HASHES, tmp_path / "c.nc")["displacement"]):
        assert values.dtype == np.float32
        assert np.isposinf(values).all()


@pytest.fixture
def replaced(tmp_path: Path) -> Path:
    """An archive about to be replaced."""
    path = make_archive(tmp_path / "a.nc", TEMPLATE, RESULTS)
    put_all(path, TEMPLATE, sample_results(TEMPLATE, seed=1), [5])
    return path


@pytest.mark.parametrize("where", ["create", "assemble", "hash_content", "_add_hash", "seal", "sync"])
def test_a_failure_anywhere_leaves_target_and_shards(
    replaced: Path, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    before = replaced.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(_gather, where, fail)
    with pytest.raises(archive.ArchiveError, match=r"archive could not be written: no space left"):
        gather(archive.parts_of(replaced), TEMPLATE, replaced)
    assert replaced.read_bytes() == before
    assert len(archive.find_shards(archive.parts_of(replaced))) == 2
    assert not list(replaced.parent.rglob("*.tmp"))
    monkeypatch.undo()
    gather(archive.parts_of(replaced), TEMPLATE, replaced)
    assert replaced.read_bytes() != before


def test_too_little_room_is_said_beforehand(replaced: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = replaced.read_bytes()
    monkeypatch.setattr(_gather, "free_space", lambda directory: 1000)
    with pytest.raises(archive.ArchiveError, match="no space left on device, it needs about"):
        gather(archive.parts_of(replaced), TEMPLATE, replaced)
    assert replaced.read_bytes() == before


@pytest.mark.parametrize("name", ["pipe", "pipe.shard"])
def test_a_pipe_among_the_shards_stays_and_is_not_waited_for(name: str, tmp_path: Path) -> None:
    template = TEMPLATES["one cell"]
    parts = put_all(tmp_path / "a.nc", template, sample_results(template))
    os.mkfifo(parts / name)
    with pytest.raises(archive.ArchiveError, match=f"holds {name}, which no run left there"):
        begin(tmp_path / "a.nc")
    with pytest.raises(archive.ArchiveError, match=f"the archive is complete; .* holds {name}, which no run left"):
        archive.remove_parts(parts)
    assert [entry.name for entry in parts.iterdir()] == [name]


def test_a_link_goes_on_to_lead_to_the_archive(tmp_path: Path) -> None:
    template = TEMPLATES["one dimension"]
    (tmp_path / "disk").mkdir()
    link, real = tmp_path / "a.nc", tmp_path / "disk" / "b.nc"
    link.symlink_to(real)
    for seed in (0, 1):
        make_archive(link, template, sample_results(template, seed))
        assert link.is_symlink()
        with archive.open_archive(real) as dataset:
            check_dataset(dataset, template, sample_results(template, seed))
    assert sorted(tmp_path.rglob("*")) == sorted([link, real, real.parent])


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An archive of 18 chunks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_template, "CHUNK_BYTES", 560)
        return make_archive(tmp_path_factory.mktemp("stored") / "a.nc", encode(TEMPLATE.copy()), RESULTS)


def taken(path: Path, template: xr.Dataset, hashes: np.ndarray, target: Path) -> dict[str, np.ndarray]:
    """Return the values of an archive that is made of cases of another one alone, messages too."""
    stored = archive.Stored(archive.archive_sources(path))
    archive.gather(template, TEXTS, begin(target), target, hashes, stored)
    with archive.open_archive(target) as dataset:
        return {str(name): values.values for name, values in dataset.data_vars.items()}


@settings(max_examples=25, deadline=None)
@given(cells=st.lists(st.integers(0, TEMPLATE["status"].size - 1), min_size=1, max_size=60, unique=True))
def test_cases_are_found_and_taken_wherever_they_stand(
    path: Path, cells: list[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    chosen = np.array(cells)
    template = sample_template((("alpha", len(cells)),))
    values = taken(path, template, HASHES[chosen], tmp_path_factory.mktemp("taken") / "b.nc")
    for name in map(str, template.data_vars):
        np.testing.assert_array_equal(values[name], by_case(TEMPLATE, name, RESULTS[name])[chosen])
    texts = sample_messages(TEMPLATE, RESULTS)
    assert values["message"].tolist() == [texts.get(cell, "") for cell in cells]


def test_missing_variables_and_periods(path: Path, tmp_path: Path) -> None:
    kinds = archive.archive_sources(path)[0].kinds
    values = taken(path, sample_template(periods=5), HASHES, tmp_path / "wide.nc")
    np.testing.assert_array_equal(values["period_impulse"][..., :3], RESULTS["period_impulse"])
    assert np.isnan(values["period_impulse"][..., 3:]).all()
    values = taken(path, sample_template(periods=2), HASHES, tmp_path / "narrow.nc")
    np.testing.assert_array_equal(values["period_impulse"], RESULTS["period_impulse"][..., :2])
    for name, is_optional in (("of_a_scheme", True), ("steady_impacts", True), ("growth_rate", False)):
        template = encode(TEMPLATE.assign({name: TEMPLATE["impacts"]}))
        assert archive.lacking(template, kinds) == ([] if is_optional else [name])
        if is_optional:
            assert np.isnan(taken(path, template, HASHES, tmp_path / "more.nc")[name]).all()
    assert archive.lacking(sample_template(samples=8), kinds) == ["displacement"]
    assert archive.lacking(TEMPLATE, kinds) == []


@pytest.mark.parametrize("name", ["status", "provenance/case_hash"])
def test_a_damaged_archive_is_said(path: Path, tmp_path: Path, name: str) -> None:
    damaged = tmp_path / "a.nc"
    damaged.write_bytes(path.read_bytes())
    with h5py.File(damaged, "r+") as file:
        del file[name]
    with pytest.raises(archive.ArchiveError, match="damaged"):
        archive.archive_sources(damaged)


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
