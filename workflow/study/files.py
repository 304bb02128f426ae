"""Files that a study names: read once, as bytes, with the digest of their content."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from workflow.declare import File, Word
from workflow.study.mistakes import quoted, wrong

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
