"""Archives that somebody has changed and sealed again: their checksum is right, their contents are hostile."""

import random
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


def mutated(seed: int, sound: bytes) -> bytes:
    """Return the bytes of a file with bits and bytes changed, blocks moved, or the end cut off."""
    chance = random.Random(seed)
    content = bytearray(sound)
    for _ in range(chance.choice((1, 1, 2, 5, 20))):
        at = chance.randrange(len(content)) if chance.random() < 0.7 else chance.randrange(min(4096, len(content)))
        match chance.randrange(6):
            case 0:
                content[at] ^= 1 << chance.randrange(8)
            case 1:
                content[at] = chance.randrange(256)
            case 2:
                content[at : at + 8] = chance.choice((b"\xff" * 8, b"\x00" * 8, b"\x7f" + b"\xff" * 7))
            case 3:
                length, source = chance.randrange(1, 256), chance.randrange(len(content))
                content[at : at + length] = content[source : source + length]
            case 4:
                content[at : at + 64] = chance.randbytes(64)
            case 5:
                if chance.random() < 0.2:
                    del content[at + 1 :]
    return bytes(content)
