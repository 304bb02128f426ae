"""Durable shards while a study runs, one labelled NetCDF-4 file of them in the end, and its reading.

A run calls :func:`start_parts`, then :func:`write_shard` from any thread or process for the ranges of
units that :func:`find_shards` misses, then :func:`gather`. Readers call :func:`open_archive`.
xarray, netCDF4 and h5py are imported when they are needed, not with this package.
"""

from workflow.archive._content import LEFT_OUT
from workflow.archive._describe import (
    COPIED,
    HARMONIC,
    SOFTWARE,
    code_revision,
    describe,
    processor,
    study_key,
    versions,
)
from workflow.archive._files import ArchiveError, commit, usable
from workflow.archive._gather import gather
from workflow.archive._hold import holding
from workflow.archive._layout import STATUS, Coordinate, Layout, Variable, blank, truncated_message
from workflow.archive._open import (
    archive_key,
    content_hash,
    discard_views,
    is_whole,
    open_archive,
    provenance,
    require_whole,
    statuses,
    stored_values,
    study_text,
)
from workflow.archive._parts import clear_parts, is_begun, parts_of, read_layout, remove_parts, start_parts
from workflow.archive._shard import Shard, Shards, find_shard, find_shards, stored_status, write_shard
from workflow.archive._stored_cells import (
    StoredCells,
    archive_origin,
    are_saved,
    count_unmatched,
    find_stored_cells,
    load_stored_cells,
    match_hashes,
    narrowed,
    save_stored_cells,
    stored_hashes,
)

__all__ = [
    "COPIED",
    "HARMONIC",
    "LEFT_OUT",
    "SOFTWARE",
    "STATUS",
    "ArchiveError",
    "Coordinate",
    "Layout",
    "Shard",
    "Shards",
    "StoredCells",
    "Variable",
    "archive_key",
    "archive_origin",
    "are_saved",
    "blank",
    "clear_parts",
    "code_revision",
    "commit",
    "content_hash",
    "count_unmatched",
    "describe",
    "discard_views",
    "find_shard",
    "find_shards",
    "find_stored_cells",
    "gather",
    "holding",
    "is_begun",
    "is_whole",
    "load_stored_cells",
    "match_hashes",
    "narrowed",
    "open_archive",
    "parts_of",
    "processor",
    "provenance",
    "read_layout",
    "remove_parts",
    "require_whole",
    "save_stored_cells",
    "start_parts",
    "statuses",
    "stored_hashes",
    "stored_status",
    "stored_values",
    "study_key",
    "study_text",
    "truncated_message",
    "usable",
    "versions",
    "write_shard",
]
