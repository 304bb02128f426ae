"""Messages of cases that ended by an error."""

from __future__ import annotations

from workflow.schemes import RefusedStructureError


def reason_of(error: BaseException) -> str:
    """Return the text of a refusal, or of any other error, a defect of a model, basis or scheme, with its type."""
    by_compiler = type(error).__module__.startswith("numba.")  # by name: numba is imported where kernels run
    text = _innermost(str(error)) if by_compiler else str(error)
    return text if isinstance(error, RefusedStructureError) else f"{type(error).__name__}: {text}"


def _innermost(text: str) -> str:
    """Return the innermost fault and its line from numba's message, which lists all callers."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    begins = [k + 1 for k, line in enumerate(lines) if "Failed in " in line]
    first = begins[-1] if begins else 0
    return " ".join(lines[first : first + 2]).rstrip(":")
