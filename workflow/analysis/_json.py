"""Results as JSON has them, for commands and pages."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any


def json_value(value: Any, text: Callable[[str], str] = str) -> Any:
    """Return nested dataclasses, mappings and sequences as JSON has them; numbers that are not finite become null.

    ``text`` changes every text and key on the way.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {entry.name: getattr(value, entry.name) for entry in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {json_value(key, text): json_value(item, text) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item, text) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return text(value) if isinstance(value, str) else value
