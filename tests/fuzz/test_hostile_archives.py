"""Archives that nobody's run wrote: what they claim is judged before memory is spent on it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from studies import SMALL, parsed
from terminal import workflow
from workflow.run import run_study


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sound") / "a.nc"
    run_study(parsed(SMALL), path)
    return path


def without(name: str) -> Callable[[Any], None]:
    def spoil(file: Any) -> None:
        del file[name]

    return spoil


def retyped(name: str, dtype: str) -> Callable[[Any], None]:
    def spoil(file: Any) -> None:
        shape = file[name].shape
        scales = [file[name].dims[k][0] for k in range(len(shape))]
        del file[name]
        made = file.create_dataset(name, data=np.zeros(shape, dtype))
        for k, scale in enumerate(scales):
            made.dims[k].attach_scale(scale)

    return spoil


def unformatted(file: Any) -> None:
    file.attrs["archive_format"] = np.arange(5.0)


def unknown(file: Any) -> None:
    file["status"][...] = 77


def long_study(file: Any) -> None:
    del file["provenance"].attrs["study"]
    file["provenance"].create_dataset("study", (2**36,), "S1", chunks=(2**20,), compression="gzip")


SPOILT: dict[str, Callable[[Any], None]] = {
    "no status": without("status"),
    "no message": without("message"),
    "no runaway": without("runaway"),
    "no provenance": without("provenance"),
    "no h": without("h"),
    "status in floats": retyped("status", "f8"),
    "status in texts": retyped("status", "S5"),
    "status 77": unknown,
    "message in floats": retyped("message", "f8"),
    "format of numbers": unformatted,
    "study of 64 GiB": long_study,
}


@pytest.mark.parametrize("what", SPOILT)
def test_a_spoilt_archive_is_shown_or_refused(what: str, sound: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        SPOILT[what](file)
    for words in (("show", path), ("run", path, "-o", "b.nc")):
        ended = workflow(*words, cwd=tmp_path)
        assert ended.returncode == 0 or (ended.returncode == 2 and str(path) in ended.stderr), ended
