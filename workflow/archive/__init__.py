"""Durable shards while a study runs, one labelled NetCDF-4 file of them in the end, and its reading.

A run calls :func:`start_parts`, then :func:`write_shard` from any thread or process for the cases that
:class:`Stored` misses, then :func:`gather`. Readers call :func:`open_archive`.
xarray, netCDF4 and h5py are imported when they are needed, not with this package.
"""

from workflow.archive._content import LEFT_OUT
from workflow.archive._files import ArchiveError, commit, usable
from workflow.archive._gather import gather
from workflow.archive._hold import holding
from workflow.archive._open import (
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
from workflow.archive._parts import Command, clear_parts, file_of, parts_of, read_command, remove_parts, start_parts
from workflow.archive._provenance import (
    COPIED,
    SOFTWARE,
    code_revision,
    grid_of,
    processor,
    provenance_of,
    study_key,
    versions,
)
from workflow.archive._shard import find_shards, stored_status, truncated_message, write_shard
from workflow.archive._stored import (
    STATUS,
    Hashes,
    Source,
    Stored,
    archive_kinds,
    archive_sources,
    are_among,
    lacking,
    stored_hashes,
    surplus,
)

__all__ = [
    "COPIED",
    "LEFT_OUT",
    "SOFTWARE",
    "STATUS",
    "ArchiveError",
    "Command",
    "Hashes",
    "Source",
    "Stored",
    "archive_kinds",
    "archive_sources",
    "are_among",
    "clear_parts",
    "code_revision",
    "commit",
    "content_hash",
    "discard_views",
    "file_of",
    "find_shards",
    "gather",
    "grid_of",
    "holding",
    "is_whole",
    "lacking",
    "open_archive",
    "parts_of",
    "processor",
    "provenance",
    "provenance_of",
    "read_command",
    "remove_parts",
    "require_whole",
    "start_parts",
    "statuses",
    "stored_hashes",
    "stored_status",
    "stored_values",
    "study_key",
    "study_text",
    "surplus",
    "truncated_message",
    "usable",
    "versions",
    "write_shard",
]
