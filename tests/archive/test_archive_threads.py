"""Threads and processes write at once while another reads; netCDF-C and HDF5 would not bear it alone."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from archive_samples import (
    TEXTS,
    begin,
    check_dataset,
    gather,
    make_archive,
    put_shard,
    sample_hashes,
    sample_results,
    sample_template,
    stored_in,
)

from workflow import archive

TEMPLATE = sample_template((("e", 200), ("alpha", 20)), samples=50)
RESULTS = sample_results(TEMPLATE)


def test_two_hundred_shards_from_four_threads_while_another_opens(tmp_path: Path) -> None:
    target = tmp_path / "a.nc"
    other = make_archive(tmp_path / "other.nc", TEMPLATE, RESULTS)
    parts = begin(target)
    finished = threading.Event()
    seen = []

    def look() -> int:
        while not finished.is_set():
            seen.append(int(stored_in(parts).holds(sample_hashes(TEMPLATE)).sum()))
            with archive.open_archive(other) as whole:
                np.testing.assert_array_equal(whole["displacement"][7], RESULTS["displacement"][7])
                assert archive.provenance(other)["key"] == TEXTS["key"]
        return len(seen)

    with ThreadPoolExecutor(6) as pool:
        readers = [pool.submit(look) for _ in range(2)]
        writers = [pool.submit(put_shard, parts, TEMPLATE, RESULTS, k, k + 20) for k in range(0, 4000, 20)]
        try:
            paths = {writer.result() for writer in writers}
            gather(parts, TEMPLATE, target)
        finally:
            finished.set()
        assert all(reader.result() > 0 for reader in readers)
    assert len(paths) == 200
    assert all(0 <= count <= TEMPLATE["status"].size and count % 20 == 0 for count in seen)
    with archive.open_archive(target) as dataset:
        check_dataset(dataset, TEMPLATE, RESULTS)
    assert archive.content_hash(target) == archive.content_hash(other)
