"""Scripts of ``studies/`` as modules: they are run by a person, not imported by the package."""

import importlib.util
from pathlib import Path
from typing import Any

STUDIES = Path(__file__).parents[1] / "studies"


def script(name: str) -> Any:
    """Return ``studies/NAME.py`` as a module."""
    spec = importlib.util.spec_from_file_location(name, STUDIES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
