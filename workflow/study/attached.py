"""Files of a study that travel in its archive, so that it repeats itself without them."""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from pathlib import Path

from workflow.declare import files_of
from workflow.study.files import Attached
from workflow.study.mistakes import Mistake, StudyError
from workflow.study.study import Study

MOST_BYTES = 2**27
"""Of all files of a study together, as they are: those of 1e5 degrees of freedom, a quarter of that compressed."""


def packed(study: Study) -> str:
    """Return the files that a study names as a text, empty where there is none, or where they are too large."""
    files = {file.name: file for file in files_of(study.scene.parameters)}
    if not files or sum(len(content) for file in files.values() for content in file.contents.values()) > MOST_BYTES:
        return ""
    return json.dumps(
        {name: {part: _text(content) for part, content in file.contents.items()} for name, file in files.items()}
    )


def _text(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, 6)).decode("ascii")


def unpacked(text: str) -> Attached:
    """Return the files of an archive.

    Raises
    ------
    StudyError
        They are damaged, or larger than any archive's are.
    """
    if not text:
        return {}
    files: dict[str, dict[str, bytes]] = {}
    room = MOST_BYTES
    try:
        for name, parts in json.loads(text).items():
            files[name] = {}
            for part, content in parts.items():
                inflate = zlib.decompressobj()
                data = inflate.decompress(base64.b64decode(content, validate=True), room + 1)
                room -= len(data)
                if room < 0 or Path(part).name != part or part in ("", ".", ".."):
                    raise ValueError("a file is too large, or has no name")
                files[name][part] = data
    except (ValueError, TypeError, AttributeError, binascii.Error, zlib.error, RecursionError) as error:
        mistake = Mistake("study", None, "", f"the files that came with it cannot be read: {error}", "restore a copy")
        raise StudyError([mistake]) from None
    return files
