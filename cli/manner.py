"""How much a command says: `--quiet` and `--verbose`."""

import logging
from typing import Annotated

import typer
from rich.console import Console

from ..orchestrator.errors import InputError

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print warnings and errors only.")]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose",
        "-v",
        help="Also print what is set up, what it computes with, and every output time or finished point.",
    ),
]

#: The program, of all whose floors a person may want to hear.
_PROGRAM = __name__.partition(".")[0]


class _ConsoleHandler(logging.Handler):
    """Prints above a progress bar, if there is one."""

    def __init__(self, console: Console) -> None:
        super().__init__()
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        self._console.print(self.format(record), markup=False, highlight=False, soft_wrap=True)


class Manner:
    """What was asked for: `console` is where warnings and progress go; `is_quiet` says that no report is wanted."""

    def __init__(self, quiet: bool, verbose: bool) -> None:
        if quiet and verbose:
            raise InputError("--quiet and --verbose contradict each other; give one of the two")
        self.is_quiet = quiet
        self.console = Console(stderr=True)
        logger = logging.getLogger(_PROGRAM)
        # Those of an earlier call in the same process.
        for handler in [each for each in logger.handlers if isinstance(each, _ConsoleHandler)]:
            logger.removeHandler(handler)
        logger.setLevel(logging.INFO if verbose else logging.NOTSET)
        if verbose:
            logger.addHandler(_ConsoleHandler(self.console))

    @property
    def progress_console(self) -> Console:
        """Where progress alone goes."""
        return Console(quiet=True) if self.is_quiet else self.console

    def note(self, text: str) -> None:
        """Tell a person of something remarkable that is not wrong, unless nothing is to be said."""
        if not self.is_quiet:
            typer.echo(f"note: {text}", err=True)

    def say(self, text: object) -> None:
        """Tell a person of results, unless nothing is to be said."""
        if not self.is_quiet:
            typer.echo(text)
