"""A model and a scheme of several contacts in plain matrices, beside those of the package."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from workflow import models, schemes

HERE = Path(__file__).parent
for place in (HERE, HERE.parent / "schemes"):
    sys.path.insert(0, str(place))


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    for package in (models, schemes):
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(HERE)])
