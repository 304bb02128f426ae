"""Files that a study names, with the digest of their content."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from workflow.declare import File, Word
from workflow.study.mistakes import quoted, wrong


@dataclass(frozen=True)
class Files:
    """Where the files of a study lie: relative to its directory, or where those came to that travelled with it."""

    directory: Path = Path()
    attached: Mapping[str, Path] = field(default_factory=dict)

    def read(self, name: str, declared: Word) -> File:
        """Return a file with the digest of its content, and of all that belongs to it."""
        place = Path(self.attached.get(name, self.directory / name))
        if not (place.is_file() or (declared.files is not None and place.is_dir())):  # a pipe would wait for ever
            raise wrong(f"{quoted(name)} is no file", f"name a file, relative to {self.directory.absolute()}")
        try:
            parts = (place,) if declared.files is None else declared.files(place)
            digests = [_digest(part) for part in parts]
        except OSError as error:
            raise wrong(f"{quoted(name)} cannot be read: {error.strerror}", "name a file that can be read") from None
        except ValueError as error:
            raise wrong(f"{quoted(name)} cannot be used: {error}", "name a file with all that belongs to it") from None
        places = tuple(str(part.absolute()) for part in parts)
        listed = "".join(f"{digest} {part.name}\n" for digest, part in zip(digests, parts, strict=True))
        digest = digests[0] if len(parts) == 1 else hashlib.sha256(listed.encode()).hexdigest()
        return File(digest, name, str(place.absolute()), places)


def _digest(place: Path) -> str:
    with place.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()
