"""The command, put together."""

import sys
from collections.abc import Callable
from inspect import getdoc

import typer

from ..orchestrator.errors import InputError, RunError
from ..orchestrator.supervision import watch
from . import (
    comparison_commands,
    movie_command,
    report_commands,
    scenario_commands,
    schema_command,
    study_commands,
    verify_command,
    version,
)
from .exit_codes import INPUT_WRONG, RUN_FAILED


def _paragraphs(command: Callable[..., None]) -> str:
    """The help of a command without the line breaks of its source: a terminal has its own."""
    paragraphs = getdoc(command) or ""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs.split("\n\n"))


app = typer.Typer(
    pretty_exceptions_enable=False,
)
app.callback(
    help="A beating two-chamber heart as FMI co-simulation of exchangeable physics units.", no_args_is_help=True
)(version.options)
for command in (
    scenario_commands.run,
    scenario_commands.build,
    scenario_commands.show,
    study_commands.chart,
    study_commands.errors,
    study_commands.stability,
    study_commands.tune,
    comparison_commands.sweep,
    comparison_commands.compare,
    report_commands.report,
    movie_command.movie,
    verify_command.verify,
    schema_command.schema,
):
    app.command(help=_paragraphs(command))(command)


def main() -> None:
    """The command, in this process.

    Exit code 0: done; 2: the input is wrong; 3: the run failed; 128 + signal: stopped; 1: a bug.
    """
    try:
        app()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(INPUT_WRONG)
    except RunError as error:
        print(f"failed: {error}", file=sys.stderr)
        sys.exit(RUN_FAILED)


def supervised_main() -> None:
    """The same, watched by a process that knows if foreign code ended it (`supervision`)."""
    watch(main)
