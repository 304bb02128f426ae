"""A model and schemes of several contacts beside those of the package."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from workflow import models, schemes


@pytest.fixture(scope="module", autouse=True)
def plain() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for package in (models, schemes):
            patch.setattr(package, "__path__", [*package.__path__, str(Path(__file__).parent)])
        yield
