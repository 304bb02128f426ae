"""Durable shards while a study runs, one labelled NetCDF-4 file of them in the end, and its reading.

A run calls :func:`start_parts`, then :func:`write_shard` from any thread or process for the cases that
:class:`Stored` misses, then :func:`gather`. Readers call :func:`open_archive`.
xarray, netCDF4 and h5py are imported when they are needed, not with this package.
"""

from workflow.archive._checksums import LEFT_OUT, lengths
from workflow.archive._files import ArchiveError, commit, file_of, replaceable, usable
from workflow.archive._gather import gather
from workflow.archive._open import (
    content_hash,
    discard_views,
    is_whole,
    open_archive,
    provenance,
    require_own_content,
    require_readable,
    require_whole,
    statuses,
    study_text,
)
from workflow.archive._parts import Command, parts_of, read_command, remove_parts, run_lock, start_parts
from workflow.archive._provenance import (
    COPIED,
    SOFTWARE,
    code_revision,
    grid_of,
    json_in,
    processor,
    provenance_of,
    study_key,
    versions,
)
from workflow.archive._stored import (
    MESSAGE,
    STATUS,
    Hashes,
    Source,
    Stored,
    archive_sources,
    are_among,
    boxes,
    find_shards,
    lacking,
    stored_hashes,
    surplus,
    take_back,
    truncated_message,
    write_shard,
)
