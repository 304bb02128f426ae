"""How many nodes or coordinates the structures of a study have, and how many modes they can keep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from workflow import models
from workflow.models import Array
from workflow.study.addresses import MODES
from workflow.study.settings import Scene

Counts = tuple[int, ...]
"""Of the cases; empty where they are not known."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of the structures of a study.

    Attributes
    ----------
    inputs
        By what a list has a value for each of, the numbers of values.
    coordinates
        Numbers of mechanical and of thermal coordinates, by the setting of their modes.
    large, most
        Coordinates above which a structure cannot be kept full, and the most modes of each kind that it then has.
    contact
        Weights w of the displacements that a start is given for, x_n = wᵀx; ``None`` where the last one is the tip.
    """

    inputs: Mapping[str, Counts]
    coordinates: Mapping[str, Counts]
    large: float = inf
    most: int = 0
    contact: Array | None = None


def sizes_of(scene: Scene, nodes: Counts) -> Sizes:
    """Return the sizes of the structures of all cases; ``nodes`` are the numbers of them where the model has any.

    Raises
    ------
    UnusableMatricesError
        The matrices of the scene are no structure.
    """
    if nodes:
        inputs = dict.fromkeys(("node", "spring", "temperature"), nodes)
        return Sizes(inputs, dict.fromkeys(MODES, nodes), models.MOST_FULL, models.MOST_ONE_BY_ONE)
    try:
        structure = models.structure_of(scene.model, scene.parameters)
        both = structure.mechanical_size, structure.thermal_size
        displacements, temperatures = ((size,) for size in structure.input_sizes)
        most = models.most_modes(scene.model, scene.parameters)
    except models.UnusableMatricesError:
        raise
    except Exception:  # whatever a model from outside raises: its cases say it
        return Sizes({}, dict.fromkeys(MODES, ()))
    inputs = {"node": displacements, "spring": displacements, "temperature": temperatures}
    coordinates = {path: (size,) for path, size in zip(MODES, both, strict=True)}
    return Sizes(inputs, coordinates, inf if most is None else most + 1, most or 0, structure.input_contact)
