"""The application with all commands."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from workflow.cli._archives import limits, recommend, report, show, verify
from workflow.cli._failures import tell, warnings_in_words
from workflow.cli._stop import ignore_signals
from workflow.cli._studies import example, plan, run, schema
from workflow.cli._terminal import clean, say, write_anything


class Commands(TyperGroup):
    """The commands. An error in one becomes a clear message and an exit status, none ends in a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was called."""
        try:
            with warnings_in_words():
                return super().invoke(ctx)
        except Exception as error:
            usage: Any = error
            if hasattr(error, "format_message"):  # the parser's own
                usage.message = clean(usage.message)
                raise
            if isinstance(error, typer.Exit | typer.Abort):
                raise
            raise typer.Exit(tell(error)) from None


app = typer.Typer(
    name="workflow",
    cls=Commands,
    no_args_is_help=True,
    invoke_without_command=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def workflow(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, help="Print the version of this workflow and of its solver.")
    ] = False,
) -> None:
    """From a YAML study of a blade rubbing on its casing to a labelled NetCDF archive."""
    if version:
        from workflow import __version__
        from workflow.schemes import SOLVER_VERSION

        say(f"rotor-stator-workflow {__version__}, solver {SOLVER_VERSION}")
        raise typer.Exit


for command in (run, plan, show, recommend, limits, verify, report, schema, example):
    app.command()(command)


def run_application() -> None:
    """Run the command that was called and exit with its status."""
    write_anything()
    try:
        app()
    except Exception as error:
        sys.exit(tell(error))
    finally:
        ignore_signals()
