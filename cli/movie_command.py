"""`cosim movie`: a film of a run."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..orchestrator.errors import InputError


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
