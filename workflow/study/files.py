"""Files that a study names: read once, as bytes, with their digest; an archive carries them, to repeat by itself."""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from workflow.declare import File, Word, files_of
from workflow.study.mistakes import Mistake, StudyError, quoted, wrong
from workflow.study.settings import CaseSpace

Attached = Mapping[str, Mapping[str, bytes]]
"""Contents of files that came with a study's text, by the names that it gives them and their own."""

MOST_BYTES = 2**30
"""Of a file, which is held in memory; matrices of 1e5 degrees of freedom take a quarter of it."""


@dataclass(frozen=True)
class Files:
    """The files of a study: they lie relative to its directory, or travelled with it."""

    directory: Path = Path()
    attached: Attached = field(default_factory=dict)

    def read(self, name: str, declared: Word) -> File:
        """Return a file with its content, and that of all that belongs to it, and their digest."""
        place = self.directory / name
        contents = self.attached.get(name)
        # a pipe would wait for ever
        if contents is None and not (place.is_file() or (declared.files is not None and place.is_dir())):
            raise wrong(f"{quoted(name)} is no file", f"name a file, relative to {self.directory.absolute()}")
        try:
            if contents is None:
                parts = (place,) if declared.files is None else declared.files(place)
                contents = {part.name: _content(part) for part in parts}
        except OSError as error:
            raise wrong(f"{quoted(name)} cannot be read: {error.strerror}", "name a file that can be read") from None
        except ValueError as error:
            raise wrong(f"{quoted(name)} cannot be used: {error}", "name a file with all that belongs to it") from None
        digests = {part: hashlib.sha256(content).hexdigest() for part, content in contents.items()}
        listed = "".join(f"{digest} {part}\n" for part, digest in digests.items())
        digest = hashlib.sha256(listed.encode()).hexdigest() if len(digests) > 1 else next(iter(digests.values()), "")
        return File(digest, name, str(place.absolute()), contents)


def _content(place: Path) -> bytes:
    with place.open("rb") as opened:
        size = os.fstat(opened.fileno()).st_size
        if size > MOST_BYTES:
            raise ValueError(f"{place.name} has {size} bytes, and at most {MOST_BYTES} are read")
        return opened.read()


MOST_ATTACHED = 2**27
"""Of all files of a study together, as they are: those of 1e5 degrees of freedom, a quarter of that compressed."""


def packed(study: CaseSpace) -> str:
    """Return the files that a study names as a text, empty where there is none, or where they are too large."""
    files = {file.name: file for file in files_of(study.scene)}
    if not files or sum(len(content) for file in files.values() for content in file.contents.values()) > MOST_ATTACHED:
        return ""
    return json.dumps(
        {name: {part: _text(content) for part, content in file.contents.items()} for name, file in files.items()}
    )


def _text(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, 6)).decode("ascii")


def unpacked(text: str) -> Attached:
    """Return the files of an archive; raises :class:`StudyError` where they are damaged or too large."""
    if not text:
        return {}
    files: dict[str, dict[str, bytes]] = {}
    room = MOST_ATTACHED
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
