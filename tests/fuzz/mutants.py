"""Studies and files of matrices with something wrong in them, each made from a seed."""

import random
import re
from collections.abc import Callable

from hostile import mutated
from studies import SCENE
from study_samples import BLADE

CORPUS = (
    BLADE.replace("nodes: 20", "nodes: 6").replace("[4, 12, full]", "[2, 4, full]"),
    "study: small\n"
    + SCENE
    + """\
axes:
  h: [1e-4, 2e-4]
  e: {lin: [0, 1, 11]}
  scene.chain.stiffness: [4.0e6, 5.0e6]
  scene.load.frequency: [50 Hz, 3000 rpm]
output: {interval: 1 ms, histories: [], balances: false}
""",
    "study: static\n"
    + SCENE.replace("duration", "initial: static\n  duration")
    + "axes: {scene.chain.nodes: [2, 3]}\n",
)

_WRITTEN = """
0 -0 -1 1 2 3.5 1e308 -1e308 1e-320 1e400 .inf -.inf .nan nan 99999999999999999999 123456789 1e9 1e5 1e12 0x10 0o17
1_000 true null ~ full static moreau event_driven chain blade e h alpha scheme t status message gap model nodes
[] {} [0] [[0]] [1,2,3,4] {a:1} {lin:[0,1,1000000]} {lin:[1,9,1000000000]} {log:[1e-9,1e9,100000]} {lin:[0,1,2]}
{log:[0,1,3]} &a *a !!python/object:os.system <<: *a | > - ? % @ ` " ' # : :: , ] } [ {
5mm 50_um 1e3_Hz 5_degC 1_m**99 1_m/s/s/s 1_rad/s 1e400_m 7_W/m**2/K 1_um/1 1_m**-2 1_um_um 3_parsec
\u0000 \u2028 \U0001f600 \ud800 é 中文 ½ Ⅷ ٣ \x85 \x7f
"""
NASTY = tuple(_WRITTEN.split())
"""What stands in the place of something else; `_` is a space."""

_TOKEN = re.compile(r"[\w.+-]+|\S")


def _lines(text: str, chance: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    at, other = chance.randrange(len(lines)), chance.randrange(len(lines))
    match chance.randrange(4):
        case 0:
            del lines[at]
        case 1:
            lines.insert(other, lines[at])
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case 3:
            lines[at] = " " * chance.randrange(9) + lines[at].lstrip()
    return "".join(lines)


def _token(text: str, chance: random.Random) -> str:
    token = chance.choice(list(_TOKEN.finditer(text)))
    return text[: token.start()] + _nasty(chance) + text[token.end() :]


def _swap(text: str, chance: random.Random) -> str:
    one, two = (chance.choice(list(_TOKEN.finditer(text))) for _ in range(2))
    return text[: one.start()] + two[0] + text[one.end() :]


def _characters(text: str, chance: random.Random) -> str:
    at = chance.randrange(len(text))
    new = chance.choice(
        ["", chr(chance.randrange(1, 256)), chr(chance.randrange(256, 0x2FFF)), "\t", "\n", text[at] * 3]
    )
    return text[:at] + new + text[at + chance.randrange(3) :]


def _cut(text: str, chance: random.Random) -> str:
    at = chance.randrange(len(text))
    return text[:at] if chance.random() < 0.5 else text[at:]


def _much(text: str, chance: random.Random) -> str:
    token = chance.choice(list(_TOKEN.finditer(text)))
    size = 10 ** chance.randrange(1, 6)
    much = chance.choice(
        ["[" * size, "{a: " * size, "x" * size, "9" * size, "- " * size, f"[{'1, ' * size}1]", "&a [*a]" * size]
    )
    return text[: token.start()] + much + text[token.end() :]


def _nasty(chance: random.Random) -> str:
    return chance.choice(NASTY).replace("_", " ")


MUTATIONS: tuple[Callable[[str, random.Random], str], ...] = (
    *(_token,) * 6,
    *(_lines,) * 2,
    *(_swap,) * 3,
    *(_characters,) * 3,
    _cut,
    _much,
)


def study(seed: int) -> bytes:
    """Return the bytes of a mutated study."""
    chance = random.Random(seed)
    text = chance.choice(CORPUS)
    for _ in range(chance.choice((1, 1, 2, 3, 5))):
        text = chance.choice(MUTATIONS)(text, chance) or "\n"
        text = text if _TOKEN.search(text) else "x: 1\n"
    content = text.encode("utf-8", "surrogatepass")
    if chance.random() < 0.05:
        at = chance.randrange(len(content))
        content = content[:at] + bytes([chance.randrange(256)]) + content[at:]
    return content


def matrices(seed: int, sound: bytes) -> bytes:
    """Return the bytes of a mutated file of matrices: as those of an archive, and numbers of texts exchanged."""
    chance = random.Random(seed)
    try:
        text = sound.decode("ascii")
    except UnicodeDecodeError:
        return mutated(seed, sound)
    for _ in range(chance.choice((1, 1, 2, 5))):
        text = chance.choice(MUTATIONS)(text, chance) or "\n"
        text = text if _TOKEN.search(text) else "x 1\n"
    return text.encode("utf-8", "surrogatepass")
