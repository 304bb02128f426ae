"""Archives from elsewhere or with changed bytes: named, shown or refused; nothing outside their file is read."""

import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from hostile import mutated
from quick import quick
from studies import SMALL, archived, parsed, written
from terminal import told
from workflow.archive import ArchiveError, open_archive, provenance
from workflow.archive._checksums import seal
from workflow.run import run_study


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("own")
    run_study(parsed(SMALL), directory / "a.nc")
    (directory / "raw").write_text("do-not-tell" * 1000)
    with h5py.File(directory / "other.nc", "w") as file:
        file["texts"] = np.frombuffer(b"do-not-tell" * 100, "S1")
        file["numbers"] = np.arange(1000.0)
        file.create_group("provenance").attrs["study"] = "do-not-tell"
        file.attrs["archive_format"] = "2"
    os.mkfifo(directory / "pipe")  # what opens it waits for ever
    return directory / "a.nc"


def dataset_of(file: Any, chance: random.Random) -> str:
    return chance.choice([name for name in file if isinstance(file[name], h5py.Dataset)])


def external_link(file: Any, beside: Path, chance: random.Random) -> None:
    name, there = chance.choice([(dataset_of(file, chance), "/numbers"), ("provenance", "/provenance")])
    del file[name]
    file[name] = h5py.ExternalLink(str(beside / chance.choice(["other.nc", "pipe"])), there)


def link_to_root(file: Any, beside: Path, chance: random.Random) -> None:
    file["provenance/study_as_written"] = h5py.ExternalLink(str(beside / "other.nc"), "/")


def soft_link(file: Any, beside: Path, chance: random.Random) -> None:
    place = chance.choice(["/", "/provenance/"])
    file[f"{place}more"] = h5py.SoftLink(chance.choice(["/nowhere", f"{place}more", "/status", "/"]))


def raw(file: Any, beside: Path, chance: random.Random) -> None:
    place = str(beside / chance.choice(["raw", "pipe"]))
    if chance.random() < 0.5:
        file["provenance"].create_dataset("platform_text", (90,), "S1", external=[(place, 0, 90)])
        return
    name = dataset_of(file, chance)
    shape = file[name].shape
    del file[name]
    file.create_dataset(name, shape, "u1", external=[(place, 0, h5py.h5f.UNLIMITED)])


def virtual(file: Any, beside: Path, chance: random.Random) -> None:
    layout = h5py.VirtualLayout((900,), "S1")
    layout[:] = h5py.VirtualSource(str(beside / chance.choice(["other.nc", "pipe"])), "texts", (900,))
    file["provenance"].create_virtual_dataset("files", layout)


def circle(file: Any, beside: Path, chance: random.Random) -> None:
    group = chance.choice(["provenance", "provenance/deeper/still"])
    file.require_group(group)["up"] = file[chance.choice(["/", "provenance"])]


def second_name(file: Any, beside: Path, chance: random.Random) -> None:
    file["again"] = file[dataset_of(file, chance)]


def immense(file: Any, beside: Path, chance: random.Random) -> None:
    name = dataset_of(file, chance)
    shape = (2**30, 2**20) if chance.random() < 0.5 else (2**40,)
    del file[name]
    file.create_dataset(name, shape, "i1", chunks=(2**20,) if len(shape) == 1 else (2**10, 2**10))


REFUSED: tuple[Callable[[Any, Path, random.Random], None], ...] = (
    external_link,
    link_to_root,
    soft_link,
    raw,
    virtual,
    circle,
    second_name,
    immense,
)


def wrong_type(file: Any, beside: Path, chance: random.Random) -> None:
    name = dataset_of(file, chance)
    values = np.zeros(file[name].shape, chance.choice(["f8", "S5", "i8", "c16", "u1"]))
    scales = [list(dim.values()) for dim in file[name].dims] if chance.random() < 0.5 else []
    del file[name]
    file[name] = values
    for dim, own in zip(file[name].dims, scales, strict=False):
        for one in own:
            dim.attach_scale(one)


def without(file: Any, beside: Path, chance: random.Random) -> None:
    del file[dataset_of(file, chance)]


def cut_chunk(file: Any, beside: Path, chance: random.Random) -> None:
    name = chance.choice([name for name in file if getattr(file[name], "chunks", None)])
    file[name].id.write_direct_chunk((0,) * file[name].ndim, chance.randbytes(chance.randrange(1, 40)))


def odd_attribute(file: Any, beside: Path, chance: random.Random) -> None:
    value = chance.choice([np.arange(5.0), "x" * 60_000, np.zeros(0), b"\xff\xfe", h5py.Empty("f")])
    file[chance.choice(["/", dataset_of(file, chance)])].attrs[chance.choice(["units", "title", "coordinates"])] = value


def unknown_status(file: Any, beside: Path, chance: random.Random) -> None:
    file["status"][...] = 77


SHOWN = (wrong_type, without, cut_chunk, odd_attribute, unknown_status)
"""Changes of an archive of which something can be shown."""


def spoilt(sound: Path, path: Path, change: Callable[[Any, Path, random.Random], None], chance: random.Random) -> Path:
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        change(file, sound.parent, chance)
    seal(path)
    return path


@pytest.mark.parametrize("change", REFUSED)
def test_what_leads_out_of_an_archive_is_refused(
    change: Callable[[Any, Path, random.Random], None], sound: Path, tmp_path: Path
) -> None:
    for seed in range(4):
        path = spoilt(sound, tmp_path / f"{seed}.nc", change, random.Random(seed))
        for use in (open_archive, provenance):
            with pytest.raises(ArchiveError, match=r"refers to data elsewhere|more values than there are bytes"):
                use(path)


@pytest.mark.parametrize("words", [("show",), ("report",), ("verify",), ("recommend",), ("limits",), ("plan",)])
def test_no_command_reads_what_lies_outside(words: tuple[str, ...], sound: Path, tmp_path: Path) -> None:
    """A pipe that is opened would not let it end."""

    def both(file: Any, beside: Path, chance: random.Random) -> None:
        raw(file, beside, random.Random(1))
        file["provenance/more"] = h5py.ExternalLink(str(beside / "pipe"), "/")

    path = spoilt(sound, tmp_path / "a.nc", both, random.Random(0))
    status, said = told(*words, path)
    assert (status, said.count("refers to data elsewhere")) == (2, 1), said


@pytest.mark.parametrize("change", SHOWN)
def test_a_spoilt_archive_is_shown_or_refused(
    change: Callable[[Any, Path, random.Random], None], sound: Path, tmp_path: Path
) -> None:
    for seed in range(1 if change is unknown_status else 4):
        path = spoilt(sound, tmp_path / f"{seed}.nc", change, random.Random(seed))
        for words in (("show", path), ("run", path, "-o", tmp_path / "b.nc")):
            status, said = told(*words)
            assert status == 0 or (status == 2 and str(path) in said), (seed, words, said)


FAILING = quick({"alpha": [0.0, 5.0, 1e9]})
"""Three of its nine cases are not ok and have messages."""


with_messages = archived(FAILING)


def check_named(study: Path, path: Path) -> None:
    """Whatever takes cases or the study from a damaged archive names it, and leaves it as it is."""
    other, before = path.with_suffix(".other.nc"), path.read_bytes()
    for words in (
        ("run", study, "-o", path),
        ("run", study, "-o", path, "--retry"),
        ("run", path, "-o", other),
        ("plan", study, "-o", path),
    ):
        status, output = told(*words)
        assert (status, path.name in output) == (2, True), words
    status, output = told("verify", path, "--sample", "0")
    assert status == 2 or (status == 1 and "bytes    DIFFERS" in output)
    assert path.name in output
    assert told("show", path)[0] in (0, 2)
    assert path.read_bytes() == before
    assert not other.exists()


@pytest.mark.parametrize("number", [*range(4), *(pytest.param(k, marks=pytest.mark.slow) for k in range(4, 200))])
def test_a_damaged_archive_is_named(with_messages: Path, tmp_path: Path, number: int) -> None:
    sound = with_messages.read_bytes()
    changed = (mutated(1000 * k + number, sound) for k in range(9))
    (tmp_path / "a.nc").write_bytes(next(image for image in changed if image != sound))
    check_named(written(FAILING.text, tmp_path), tmp_path / "a.nc")
