"""How many nodes or coordinates the structures of a study have, and how many modes they can keep."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from workflow import models
from workflow.study.addresses import MODES, Address
from workflow.study.axes import expanded
from workflow.study.cross_checks import WrittenStudy, mapping
from workflow.study.field_types import AxisValues, Spread
from workflow.study.forms import form as parameters_form
from workflow.study.settings import Sizes


def node_sizes(written: WrittenStudy, model: str, path: str, address: Address) -> Sizes:
    """Return the numbers of nodes that the cases have, given in the scene or varied at ``path``."""
    content = mapping(written.tree, "scene", model).get("nodes")
    for _, varied, values in written.varied():
        content = values if varied == path else content
    try:
        read = AxisValues(address.value).read(content, {})
        if isinstance(read, Spread) and read.count > 10_000:
            return Sizes()
        counts = tuple(int(count) for count in expanded(read, whole=True))
        return Sizes(counts, counts, large=models.MOST_FULL, most=models.MOST_ONE_BY_ONE)
    except (ValidationError, PydanticCustomError, ValueError):
        return Sizes()


def assembled_sizes(written: WrittenStudy, model: str, where: Mapping[str, Any]) -> Sizes:
    """Return the coordinates of the structure of a model without ``nodes``; a structure that is none is reported."""
    form = parameters_form(models.load(model).Parameters)
    try:
        read = TypeAdapter(form).validate_python(mapping(written.tree, "scene", model), context=where)
        structure = models.load(model).assemble(read)
        both = structure.mechanical_size, structure.thermal_size
        coordinates = {path: (size,) for path, size in zip(MODES, both, strict=True)}
        nodes, temperatures = ((size,) for size in structure.input_sizes)
        most = models.most_modes(model, read)
        large = inf if most is None else most + 1
        return Sizes(nodes, temperatures, coordinates, large, most or 0, structure.input_contact)
    except models.UnusableMatricesError as error:
        written.source.report(("scene", model), error.problem, error.remedy)
    except Exception:  # whatever a model from outside raises: its mistakes are reported where the scene is read
        pass
    return Sizes()
