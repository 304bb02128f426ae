"""A YAML study of a blade rubbing on its casing becomes a labelled NetCDF archive."""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:  # importing typing itself takes longer than all else here
    from typing import Any

__version__ = "1.0.0"

_EXPORTS = {
    "casing_contacts": "workflow.models",
    "compare": "workflow.analysis",
    "contact_phases": "workflow.analysis",
    "labels": "workflow.analysis",
    "matrices_at_speeds": "workflow.models",
    "observed_order": "workflow.analysis",
    "open_archive": "workflow.archive",
    "pin": "workflow.pinning",
    "plan_study": "workflow.plan",
    "plots": "workflow.plots",
    "read_matrices": "workflow.models",
    "read_study": "workflow.study",
    "recommend": "workflow.analysis",
    "run_study": "workflow.run",
    "sobol": "workflow.analysis",
    "spectrum": "workflow.analysis",
    "work_precision": "workflow.analysis",
    "write_matrices": "workflow.models",
}

__all__ = ["__version__", *_EXPORTS]


def __dir__() -> list[str]:
    """Return the public names, also of what is not imported yet."""
    return __all__


def __getattr__(name: str) -> Any:
    """Import what is asked for, a name or a whole module, when it is asked for: the command line starts fast."""
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    module = import_module(_EXPORTS[name])
    return getattr(module, name, module)
