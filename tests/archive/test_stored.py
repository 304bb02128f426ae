"""Cases that an archive holds already: found wherever they stand, and taken as they are."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from archive_samples import (
    TEXTS,
    begin,
    by_case,
    make_archive,
    sample_hashes,
    sample_messages,
    sample_results,
    sample_template,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from workflow import archive
from workflow.plan import _template, encode

TEMPLATE = sample_template()
RESULTS = sample_results(TEMPLATE)
HASHES = sample_hashes(TEMPLATE)


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
