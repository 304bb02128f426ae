"""Studies of a chain of one node and a few steps, whose text tests put together."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studies import parsed
from workflow.archive import ArchiveError, Command, parts_of, provenance_of, start_parts
from workflow.cases import arrange, case_hashes
from workflow.study import Study

SCENE = {
    "chain": {
        "nodes": 1,
        "mass": 2.5e-3,
        "stiffness": 4.0e6,
        "spacing": 2.5e-3,
        "expansion": 8.6e-6,
        "heat_capacity": 1.3,
        "conductance": 0.6,
    },
    "casing": {"gap": 20e-6},
    "load": {"amplitude": 100.0, "frequency": 1000.0},
    "duration": 4e-3,
}
AXES = {"h": 1e-4, "e": [0.0, 0.5, 0.9], "alpha": [0.0, 5.0, 50.0]}
OUTPUT = {"interval": 5e-4, "histories": ["displacement", "contact_force"]}


def quick(axes: dict[str, Any] | None = None, **parts: Any) -> Study:
    """Return a study of nine cases, or with other axes (``None``: not one of them) and parts; JSON is YAML.

    A part ``scene`` names what is replaced in it by path: ``{"casing.gap": 1e-5}``.
    """
    scene = json.loads(json.dumps(SCENE))
    for path, value in parts.pop("scene", {}).items():
        *groups, name = path.split(".")
        owner = scene
        for group in groups:
            owner = owner.setdefault(group, {})
        owner[name] = value
    output = {**OUTPUT, **parts.pop("output", {})}
    given = {name: values for name, values in {**AXES, **(axes or {})}.items() if values is not None}
    return parsed(json.dumps({"study": "quick", "scene": scene, "axes": given, **parts, "output": output}))


def hashes_of(study: Study) -> list[bytes]:
    """Return the identities of a study's cases in archive order."""
    return [row.tobytes() for row in case_hashes(arrange(study))]


@contextmanager
def counted() -> Iterator[list[list[int]]]:
    """Collect the places of the cases for which tasks ask the solver."""
    from workflow.run import _task

    solve_in_parts, asked = _task.solve_in_parts, list[list[int]]()

    def counting(grid: Any, outer: int, inner: Any, **more: Any) -> Any:
        asked.append(inner.tolist())
        return solve_in_parts(grid, outer, inner, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_task, "solve_in_parts", counting)
        yield asked


@contextmanager
def room_for(shards: int) -> Iterator[list[bytes]]:
    """Let so many shards be written; the next one fails. Give the hashes of the cases that are in them."""
    from workflow.run import _task

    write, hashes, written = _task.write_shard, list[bytes](), []

    def failing(*words: Any) -> Path:
        if len(written) == shards:
            raise ArchiveError("no room")
        written.append(words[1])
        hashes.extend(row.tobytes() for row in words[2])
        return write(*words)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_task, "write_shard", failing)
        yield hashes


def interrupted(study: Study, archive: Path, shards: int, **options: bool) -> list[bytes]:
    """Run a study until so many shards are stored; return the hashes of their cases."""
    from workflow.run import run_study

    with room_for(shards) as hashes, pytest.raises(ArchiveError, match="no room"):
        run_study(study, archive, threads=1, **options)  # type: ignore[arg-type]
    return hashes


def begin(study: Study, archive: Path) -> None:
    """Begin the directory of the shards of a study, as a run does that is stopped at once."""
    start_parts(parts_of(archive), Command(provenance_of(arrange(study))))


def same_values(a: Any, b: Any) -> bool:
    """Tell whether two arrays agree in every bit, NaN equal to NaN."""
    return bool(np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind == "f"))
