"""What a case says of the error that ended it."""

from __future__ import annotations

from workflow.schemes import RefusedStructureError


def reason_of(error: BaseException) -> str:
    """Return a refusal as it stands, any other error with its type: a defect of a model, basis or scheme."""
    return str(error) if isinstance(error, RefusedStructureError) else f"{type(error).__name__}: {error}"
