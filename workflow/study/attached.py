"""Files of a study that travel in its archive, so that it repeats itself without them."""

from __future__ import annotations

import atexit
import base64
import binascii
import dataclasses
import json
import shutil
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from workflow.declare import File
from workflow.study.mistakes import Mistake, StudyError
from workflow.study.study import Study

MOST_BYTES = 2**27
"""Of all files of a study together, as they are: those of 1e5 degrees of freedom, a quarter of that compressed."""


def packed(study: Study) -> str:
    """Return the files that a study names as a text, empty where there is none, or where they are too large."""
    files = {file.name: file for file in _files(study.scene.parameters)}
    places = [Path(part) for file in files.values() for part in file.parts]
    if not files or sum(place.stat().st_size for place in places) > MOST_BYTES:
        return ""
    return json.dumps(
        {name: {Path(part).name: _text(Path(part)) for part in file.parts} for name, file in files.items()}
    )


def _text(place: Path) -> str:
    return base64.b64encode(zlib.compress(place.read_bytes(), 6)).decode("ascii")


def _files(declared: Any) -> Iterator[File]:
    """Yield the files that declared values name."""
    if isinstance(declared, File):
        yield declared
    elif dataclasses.is_dataclass(declared):
        for entry in dataclasses.fields(declared):
            yield from _files(getattr(declared, entry.name))


@lru_cache(maxsize=8)
def unpacked(text: str) -> Mapping[str, Path]:
    """Return where the files of an archive lie now, by the names that its study gives them.

    They are written to a directory that goes with the process.

    Raises
    ------
    StudyError
        They are damaged, or larger than any archive's are.
    """
    if not text:
        return {}
    directory = Path(tempfile.mkdtemp(prefix="workflow-"))
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    places, room = {}, MOST_BYTES
    try:
        for number, (name, parts) in enumerate(json.loads(text).items()):
            place = directory / str(number)
            place.mkdir()
            for part, content in parts.items():
                inflate = zlib.decompressobj()
                data = inflate.decompress(base64.b64decode(content, validate=True), room + 1)
                room -= len(data)
                if room < 0 or Path(part).name != part or part in ("", ".", ".."):
                    raise ValueError("a file is too large, or has no name")
                (place / part).write_bytes(data)
            whole = place / Path(name).name
            places[name] = whole if whole.is_file() else place
    except (ValueError, TypeError, AttributeError, binascii.Error, zlib.error, RecursionError, OSError) as error:
        mistake = Mistake("study", None, "", f"the files that came with it cannot be read: {error}", "restore a copy")
        raise StudyError([mistake]) from None
    return places
