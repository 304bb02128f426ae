"""What a case says of the error that ended it."""

from __future__ import annotations

from workflow.schemes import RefusedStructureError


def reason_of(error: BaseException) -> str:
    """Return a refusal as it stands, any other error with its type: a defect of a model, basis or scheme."""
    by_compiler = type(error).__module__.startswith("numba.")  # which is imported where kernels run
    text = _innermost(str(error)) if by_compiler else str(error)
    return text if isinstance(error, RefusedStructureError) else f"{type(error).__name__}: {text}"


def _innermost(text: str) -> str:
    """Return the fault and its line of what numba says, which tells how it came to each caller."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    begins = [k + 1 for k, line in enumerate(lines) if "Failed in " in line]
    first = begins[-1] if begins else 0
    return " ".join(lines[first : first + 2]).rstrip(":")
