"""Opening: lazily, by any tool, before the end of a run, and with one clear message if it cannot be."""

import gc
import hashlib
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from archive_samples import TEXTS, check_dataset, make_archive, sample_results, sample_template
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from quick import begin, interrupted, quick
from studies import archived, cut_finely
from workflow import archive
from workflow.archive._checksums import has_sound_head, is_intact, is_sealed, seal
from workflow.run import run_study

TEMPLATE = sample_template()
RESULTS = sample_results(TEMPLATE)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_archive(tmp_path_factory.mktemp("open") / "a.nc", TEMPLATE, RESULTS, [70])


STUDY = quick({"alpha": [0.0, 1e9, 5.0]}, title="Rotor–stator rub")
"""Three of its nine cases are ill-posed."""


whole = archived(STUDY)


@pytest.fixture
def begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An archive of which two rows of three are there; views go to a directory of their own."""
    target = tmp_path / "b.nc"
    cut_finely(monkeypatch)
    interrupted(STUDY, target, 2)
    (tmp_path / "views").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "views"))
    return target


def test_values_are_read_when_they_are_used(path: Path) -> None:
    with archive.open_archive(path) as dataset:
        lazy = {name for name, variable in dataset.data_vars.items() if not variable.variable._in_memory}
        assert lazy == set(dataset.data_vars)
        assert float(dataset["impacts"].sel(e=0.9, scheme="event_driven")[3]) == RESULTS["impacts"][1, 0, 3]


def test_an_opened_archive_can_be_sent_to_a_worker(path: Path) -> None:
    with archive.open_archive(path) as dataset, pickle.loads(pickle.dumps(dataset)) as sent:
        check_dataset(sent, TEMPLATE, RESULTS)


def test_provenance_is_kept_whole(path: Path) -> None:
    expected = TEXTS | {"content_hash": archive.content_hash(path)}
    assert archive.provenance(path) == expected
    assert len(expected["hashes"]) > 64 * 1024
    with archive.open_archive(path) as dataset:  # two handles on one file
        assert archive.provenance(str(path)) == expected
        check_dataset(dataset, TEMPLATE, RESULTS)


def test_an_unfinished_archive_is_seen_as_far_as_it_is(begun: Path, whole: Path) -> None:
    with archive.open_archive(begun) as view, archive.open_archive(whole) as expected:
        assert set(view.variables) == set(expected.variables)
        for name, values in expected.data_vars.items():
            if name not in ("processor_time", "batch_width"):
                np.testing.assert_array_equal(view[name][:2].values, values[:2].values)
            missing = {"status": 4, "runaway": 0, "message": ""}.get(str(name), np.nan)
            np.testing.assert_array_equal(view[name][2:].values, np.full(values[2:].shape, missing))
        assert "contact has no unique solution" in view["message"].values[0, 1]
        assert view.attrs["title"] == "Rotor–stator rub"
        assert view.attrs["warnings"] == expected.attrs["warnings"]
        for name, coordinate in expected.coords.items():
            assert view[name].identical(coordinate)


def test_nothing_has_run_yet(tmp_path: Path) -> None:
    for name, study in {"a": quick({"h": 1e-4, "e": 0.5, "alpha": 5.0}), "b": STUDY}.items():
        begin(study, tmp_path / f"{name}.nc")
        with archive.open_archive(tmp_path / f"{name}.nc") as view:
            assert set(view["status"].values.ravel()) == {4}
            assert bool(view["displacement"].isnull().all())


def test_a_view_leaves_nothing_when_closed(begun: Path) -> None:
    views = begun.parent / "views"
    view = archive.open_archive(begun)
    assert len(list(views.iterdir())) == 1
    assert view["status"][0].values.tolist() == [0, 2, 0]
    view.close()
    assert list(views.iterdir()) == []
    assert sorted(entry.name for entry in begun.parent.iterdir()) == ["b.nc.parts", "views"]


def test_a_view_that_is_never_closed_goes_with_the_process(begun: Path) -> None:
    code = (
        "import sys, tempfile; tempfile.tempdir = sys.argv[2]\n"
        "from workflow import archive; kept = archive.open_archive(sys.argv[1])"
    )
    views = begun.parent / "views"
    call = [sys.executable, "-c", code, str(begun), str(views)]
    done = subprocess.run(call, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert list(views.iterdir()) == []


def test_an_unfinished_archive_has_a_key_but_no_hash(begun: Path) -> None:
    key = archive.study_key(STUDY)
    assert archive.provenance(begun)["key"] == key
    assert archive.study_text(begun) == (STUDY.text, "")
    with pytest.raises(archive.ArchiveError, match="unfinished"):
        archive.content_hash(begun)


def test_a_run_that_died_before_it_began_is_no_archive(tmp_path: Path) -> None:
    archive.parts_of(tmp_path / "a.nc").mkdir()
    for read in (archive.open_archive, archive.provenance):
        with pytest.raises(archive.ArchiveError, match="no such archive"):
            read(tmp_path / "a.nc")


def netcdf(path: Path, form: str = "NETCDF4") -> None:
    netCDF4.Dataset(path, "w", format=form).close()


def of_a_later_format(path: Path) -> None:
    with netCDF4.Dataset(path, "a") as file:
        file.setncattr("archive_format", "3")


FAULTS: dict[str, tuple[Callable[[Path], object], str]] = {
    "missing": (Path.unlink, "no such archive"),
    "directory": (lambda path: (path.unlink(), path.mkdir()), "a directory"),
    "text": (lambda path: path.write_text("study: blade\n"), "not a NetCDF-4 file"),
    "NetCDF-3": (lambda path: netcdf(path, "NETCDF3_CLASSIC"), "not a NetCDF-4 file"),
    "other NetCDF": (netcdf, "not an archive of this workflow"),
    "later format": (of_a_later_format, "archive format 3"),
    "truncated": (lambda path: path.write_bytes(path.read_bytes()[:-3000]), "damaged"),
    "signature alone": (lambda path: path.write_bytes(path.read_bytes()[:8]), "damaged"),
}


@pytest.mark.parametrize(("damage", "message"), FAULTS.values(), ids=FAULTS)
def test_what_cannot_be_opened_is_said(
    path: Path, tmp_path: Path, damage: Callable[[Path], object], message: str
) -> None:
    wrong = tmp_path / "wrong.nc"
    wrong.write_bytes(path.read_bytes())
    damage(wrong)
    for read in (archive.open_archive, archive.provenance, archive.content_hash):
        with pytest.raises(archive.ArchiveError, match=message) as caught:
            read(wrong)
        assert str(caught.value).startswith(str(wrong))
        assert "\n" not in str(caught.value)
    gc.collect()  # nothing half-open is left to warn


def test_a_copy_without_provenance_is_said(path: Path, tmp_path: Path) -> None:
    import h5py

    copied = tmp_path / "copied.nc"
    copied.write_bytes(path.read_bytes())
    with h5py.File(copied, "r+") as file:
        del file["provenance"]  # xarray leaves it out where it saves a dataset
    with pytest.raises(archive.ArchiveError, match="has no provenance, as a copy that another program saved"):
        archive.provenance(copied)


@pytest.mark.parametrize("name", ["displacement", "impacts", "status", "message", "e", "t", "lumping"])
def test_values_that_changed_are_never_read(path: Path, tmp_path: Path, name: str) -> None:
    """The last bytes of a chunk: of what is not compressed its checksum, which HDF5 compares for every reader."""
    import h5py

    wrong = tmp_path / "wrong.nc"
    with h5py.File(path) as file:
        assert file[name].fletcher32
        chunk = file[name].id.get_chunk_info(0)
    image = bytearray(path.read_bytes())
    image[chunk.byte_offset + chunk.size - 1] ^= 1
    wrong.write_bytes(image)
    with h5py.File(wrong) as file, pytest.raises(OSError, match="read"):
        file[name][...]
    with pytest.raises(archive.ArchiveError, match="damaged"):
        archive.content_hash(wrong)


def test_the_directory_of_the_shards_is_not_the_archive(begun: Path) -> None:
    with pytest.raises(archive.ArchiveError, match=r"the archive is b\.nc"):
        archive.open_archive(archive.parts_of(begun))


def test_a_run_that_ends_while_a_view_is_made(begun: Path, whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from workflow.archive import _open

    def finish(*_: object) -> None:
        run_study(STUDY, begun)
        raise archive.ArchiveError("the shards are gone")

    monkeypatch.setattr(_open, "assemble", finish)
    with archive.open_archive(begun) as dataset, archive.open_archive(whole) as expected:
        assert dataset.drop_vars(["processor_time", "batch_width"]).equals(
            expected.drop_vars(["processor_time", "batch_width"])
        )


@pytest.fixture(scope="module")
def zipped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    template = sample_template((("e", 3), ("model", 3)))
    return make_archive(tmp_path_factory.mktemp("zip") / "a.nc", template, sample_results(template))


POINTS = xr.DataArray([2, 0], dims="point")
TURNED: dict[str, Callable[[xr.Dataset], xr.Dataset]] = {
    "transposed": lambda a: a.transpose("model", ...),
    "turned and picked": lambda a: a.transpose("model", "e", ...).isel(e=slice(1, None)).isel(model=1),
    "stacked": lambda a: a.stack(case=["e", "model"]),
    "stacked, one dimension": lambda a: a.stack(case=["model"]),
    "points by place": lambda a: a.isel(e=POINTS, model=POINTS),
    "points by label": lambda a: a.sel(e=a["e"][[2, 0]].drop_vars("e").rename(e="point")),
    "lists": lambda a: a.isel(e=[2, 0], model=[1]),
    "behind each other": lambda a: xr.concat([a.isel(model=[2]), a.isel(model=[0, 1])], "model"),
    "other names": lambda a: a.rename(model="run", mechanical_modes="modes").sel(modes=[19]),
    "a grid of more": lambda a: a.expand_dims("again").transpose(..., "again"),
}


@pytest.mark.parametrize("kind", TURNED)
def test_an_archive_is_turned_and_stacked_as_numbers_are(kind: str, zipped: Path) -> None:
    """Whatever is done lazily gives what it gives of the loaded dataset, texts and the coordinates of a zip too."""
    with archive.open_archive(zipped) as whole:
        expected = TURNED[kind](whole.load())
    for chunks in (None, {}):
        with archive.open_archive(zipped, chunks=chunks) as lazy:
            assert TURNED[kind](lazy).load().identical(expected)


def test_numbers_along_a_zip_are_aligned_by_its_coordinates(zipped: Path) -> None:
    with archive.open_archive(zipped) as dataset:
        numbers = dataset["impacts"].fillna(0)
        for one in ({"mechanical_modes": 19}, {"thermal_modes": 19}):
            np.testing.assert_array_equal(numbers.sel(one).values, numbers.values[:, 1])
        assert not (numbers - numbers.isel(model=slice(None, None, -1))).values.any()
        assert (numbers - numbers.isel(model=[1])).sizes["model"] == 1
        assert numbers.sel(mechanical_modes=[19]).equals(numbers.sel(thermal_modes=[19]))
        with pytest.raises(ValueError, match="mechanical_modes, thermal_modes lie along one dimension"):
            numbers.sel(mechanical_modes=19, thermal_modes=19)


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
