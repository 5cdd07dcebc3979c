"""`cosim --version`."""

from importlib.metadata import version as installed
from typing import Annotated

import typer


def _show(wanted: bool) -> None:
    if wanted:
        typer.echo(f"cosim {installed('cardiac-cosim')}")
        raise typer.Exit


def options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_show, help="Print the version of the program.")
    ] = False,
) -> None:
    """What stands before a command; all is done by the callbacks of the options."""
