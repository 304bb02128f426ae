"""JSON Schema of a study, for editors that complete and check."""

from __future__ import annotations

from typing import Any

from workflow import models, reduction, schemes
from workflow.study.addresses import scene_values, scheme_options, settings
from workflow.study.document import study_form


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a study, of any model and any scheme (draft 2020-12)."""
    methods, bases = schemes.names(), reduction.names()
    addresses = settings(methods, bases) | scene_values(models.names())
    addresses |= scheme_options({method: (method,) for method in methods})
    schema = _tidied(study_form(addresses, methods, bases).model_json_schema())
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _tidied(schema: Any) -> Any:
    """Return a schema without the titles pydantic makes of names, and without defaults of ``null``."""
    if isinstance(schema, list):
        return [_tidied(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    generated = {key for key in ("title", "default") if not isinstance(schema.get(key), dict)}
    if schema.get("default") is not None:
        generated.discard("default")
    return {key: _tidied(item) for key, item in schema.items() if key not in generated}
