"""Arguments that several commands share, and the study that one of them names."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from workflow.study import Study


def named(archive: Path) -> Path:
    """Refuse a path that names no file, nothing, a dot, the root, and an archive that libraries cannot read."""
    from workflow.archive import ArchiveError, require_readable

    if not archive.name:
        raise ArchiveError(f"{archive}: a directory, not an archive; name a file")
    require_readable(archive)
    return archive


def _all_named(archives: list[Path]) -> list[Path]:
    return [named(archive) for archive in archives]


StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="YAML study, or an archive whose study to repeat.")]
ArchiveFile = Annotated[
    Path, typer.Argument(metavar="ARCHIVE", help="Archive that `workflow run` wrote.", callback=named)
]
ArchiveFiles = Annotated[
    list[Path],
    typer.Argument(metavar="ARCHIVE...", help="Archives that `workflow run` wrote.", callback=_all_named),
]
AsJson = Annotated[bool, typer.Option("--json", help="Write JSON instead of text.")]

_HDF5 = b"\x89HDF\r\n\x1a\n"


Settings = Annotated[
    list[str] | None,
    typer.Option("-s", "--set", metavar="KEY=VALUE", help='Replace a value of the study: scene.duration="1 s".'),
]


def read(path: Path, settings: list[str] | None = None) -> Study:
    """Read a study from its YAML, or from the archive that came of it, with some values replaced."""
    from workflow.archive import study_text
    from workflow.study import parse_study, read_study, unpacked

    replaced = _settings(settings or [])
    if _is_hdf5(path):
        text, files = study_text(named(path))
        return parse_study(text, path.name, replaced, attached=unpacked(files))
    return read_study(path, replaced)


def _settings(texts: list[str]) -> dict[str, Any]:
    """Return the values given with ``-s`` by key; refuse a key that is given twice."""
    from workflow.study import setting

    pairs = [setting(text) for text in texts]
    settings = dict(pairs)
    twice = sorted({key for key, _ in pairs if sum(key == other for other, _ in pairs) > 1})
    if twice:
        raise typer.BadParameter(f"-s {', '.join(twice)}: is given more than once; give one value for each key")
    return settings


def _is_hdf5(path: Path) -> bool:
    try:
        if not path.is_file():  # a pipe would have to be waited for
            return False
        with open(path, "rb") as file:
            return file.read(len(_HDF5)) == _HDF5
    except OSError:
        return False
