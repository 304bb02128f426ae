"""JSON Schema of a study, for editors that complete and check."""

from __future__ import annotations

from typing import Any

from workflow import models, reduction, schemes
from workflow.study.addresses import scene_values, scheme_options, settings
from workflow.study.document import study_form


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a study, of any model and any scheme (draft 2020-12)."""
    names, methods, bases = models.names(), schemes.names(), reduction.names()
    addresses = settings(methods, bases) | scene_values(names)
    addresses |= scheme_options({method: (method,) for method in methods})
    schema = study_form(addresses, names, methods, bases).schema
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
