"""Notebooks are tests. ``first_blade`` and those whose metadata says ``"slow": true`` run in a kernel of their own.

The others run cell by cell in the process of the tests, which has imported and compiled what they need.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from nbmake.pytest_items import NotebookFile

IN_A_KERNEL = "first_blade"


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    if file_path.suffix != ".ipynb":
        return None
    content = json.loads(file_path.read_text(encoding="utf-8"))
    if file_path.stem == IN_A_KERNEL or content["metadata"].get("slow"):
        return NotebookFile.from_parent(parent, path=file_path)
    return CellsFile.from_parent(parent, path=file_path)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if isinstance(item.parent, NotebookFile) and item.path.stem != IN_A_KERNEL:
            item.add_marker(pytest.mark.slow)


class CellsFile(pytest.File):
    """A notebook that runs in this process."""

    def collect(self) -> Iterator[pytest.Item]:
        yield Cells.from_parent(self, name=self.path.name)


class Cells(pytest.Item):
    """Its code cells in their order."""

    def runtest(self) -> None:
        import matplotlib
        from matplotlib import pyplot

        cells = json.loads(self.path.read_text(encoding="utf-8"))["cells"]
        namespace: dict[str, Any] = {"__name__": "__main__"}
        with contextlib.chdir(self.path.parent), pytest.MonkeyPatch.context() as patch, matplotlib.rc_context():
            matplotlib.use("agg")
            patch.setattr(pyplot, "show", draw_figures)
            for number, cell in enumerate(cells):
                if cell["cell_type"] == "code":
                    run_cell("".join(cell["source"]), f"{self.path.name}[{number}]", namespace)
                    draw_figures()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # temporary directories live as long as the notebook
            namespace.clear()

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, self.name


def run_cell(source: str, name: str, namespace: dict[str, Any]) -> None:
    """Run a cell; where its last line is an expression, its value is shown."""
    tree = ast.parse(source, name)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, name, "exec"), namespace)
    if isinstance(last, ast.Expr):
        show(eval(compile(ast.Expression(last.value), name, "eval"), namespace))


def show(value: Any) -> None:
    """Make what a notebook makes of a value: a picture, or text and HTML."""
    from matplotlib.figure import Figure

    if isinstance(value, Figure):
        value.savefig(io.BytesIO())
        return
    for name in ("__repr__", "_repr_html_"):
        getattr(value, name, str)()


def draw_figures() -> None:
    """Draw the open figures and close them, as a cell does that ends or shows them."""
    from matplotlib import pyplot

    for number in pyplot.get_fignums():
        pyplot.figure(number).savefig(io.BytesIO())
    pyplot.close("all")
