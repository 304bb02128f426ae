"""The application: one command for each module of its name."""

from __future__ import annotations

from typing import Annotated

import typer

from workflow.cli._terminal import say
from workflow.cli.limits import limits
from workflow.cli.plan import plan
from workflow.cli.recommend import recommend
from workflow.cli.report import report
from workflow.cli.run import run
from workflow.cli.schema import schema
from workflow.cli.show import show
from workflow.cli.verify import verify

app = typer.Typer(
    name="workflow",
    no_args_is_help=True,
    invoke_without_command=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def workflow(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, help="Say the version of this workflow and of its solver.")
    ] = False,
) -> None:
    """From a YAML study of a blade rubbing on its casing to a labelled NetCDF archive."""
    if version:
        from workflow import __version__
        from workflow.schemes import SOLVER_VERSION

        say(f"rotor-stator-workflow {__version__}, solver {SOLVER_VERSION}")
        raise typer.Exit


for command in (run, plan, show, recommend, limits, verify, report, schema):
    app.command()(command)
