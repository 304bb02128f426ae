"""Archives that somebody has changed and sealed again: their checksum is right, their contents are hostile."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4

from workflow.archive._checksums import seal

SCRIPT = "<script>document.title='run'</script><b onclick=x>"
ESCAPES = "\x1b]0;owned\x07\x1b[31mred\x9b2J\x7f\u202eback\u2066"


def changed(sound: Path, path: Path, change: Callable[[Any], None]) -> Path:
    """Copy a sound archive, change it by netCDF4 and seal it again."""
    shutil.copy(sound, path)
    with netCDF4.Dataset(path, "a") as file:
        change(file)
    seal(path)
    return path


def write(variable: Any, place: tuple[int, ...], text: str) -> None:
    """Write a text in its place, as a string or as so many characters as there is room for."""
    if variable.dtype == str:
        variable[place] = text
        return
    variable.set_auto_chartostring(False)
    size = variable.shape[-1]
    for k, byte in enumerate(text.encode()[:size].decode(errors="ignore").encode().ljust(size, b"\0")):
        variable[(*place, k)] = bytes([byte])


def crafted(text: str) -> Callable[[Any], None]:
    """Return what puts a text wherever an archive has room for one."""

    def change(file: Any) -> None:
        file.title = file.summary = file.study = file.warnings = text
        file["provenance"].study = text
        for name in ("code_revision", "platform"):
            file["provenance"].setncattr(name, text)
        for k in range(file["scheme"].shape[0]):
            write(file["scheme"], (k,), f"stable {k} {text}")
        for name in ("e", "h", "contact_impulse", "contact_force", "displacement"):
            if name in file.variables:
                file[name].long_name = text
                file[name].units = f"m {text}"
        first = (0,) * file["status"].ndim
        file["status"][first] = 3
        write(file["message"], first, text)

    return change
