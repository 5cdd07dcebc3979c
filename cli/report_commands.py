"""`cosim report` and `cosim movie`: what people look at, made from a results folder."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..orchestrator.errors import InputError


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The results folder of a run of `cosim run`.")],
    times: Annotated[
        str | None,
        typer.Option(
            metavar="MS,MS...",
            help="The times whose nearest frames the figures show, e.g. 5,35,100. Default: frames are chosen by what "
            "happens in the run.",
        ),
    ] = None,
) -> None:
    """Write report.html and the figures of a results folder again; the run is not repeated."""
    # Imported here, so that help does not wait for numerical and plotting libraries.
    from ..report.rewritten import rewrite

    typer.echo(rewrite(folder, _numbers(times)))


def movie(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The results folder of a run.")],
    output: Annotated[
        Path | None, typer.Option(help="The movie, a file that ends in .mp4 or .gif; default DIR/movie.mp4.")
    ] = None,
    field: Annotated[
        str | None,
        typer.Option(help="The field that colours the tissue: potential (the default), active_stress or stretch."),
    ] = None,
    frames_per_second: Annotated[int, typer.Option(min=1, max=60, help="Stored frames per second of the movie.")] = 10,
) -> None:
    """Film a run: the moving tissue, coloured by a field, with the time and a curve. No screen is needed.

    Every stored frame is a picture of the movie; `output.every_ms` in the scenario says how many there are.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..orchestrator.results.names import FIELDS
    from ..orchestrator.results.stored_run import StoredRun
    from ..report.movie.movie import write_movie

    if not (folder / FIELDS).is_file():
        raise InputError(
            f"{folder}: there is no {FIELDS} here; give the results folder of a run that had a scene, as "
            "`cosim run` writes it"
        )
    path = output or folder / "movie.mp4"
    console = Console(stderr=True)
    bar = Progress(
        TextColumn("filming"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("remaining"),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
    )
    with bar:
        task = bar.add_task("movie", total=None)
        write_movie(
            StoredRun(folder),
            path,
            field,
            frames_per_second,
            lambda done, count: bar.update(task, completed=done, total=count),
        )
    typer.echo(path)


def _numbers(text: str | None) -> list[float]:
    """The times in ms; InputError if there is another text among them."""
    try:
        return [] if text is None else [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"--times {text}: give times in ms, separated by commas, e.g. --times 5,35,100") from None
