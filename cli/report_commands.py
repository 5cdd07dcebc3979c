"""`cosim report`: what people look at, made again from a results folder."""

from pathlib import Path
from typing import Annotated

import typer


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The results folder of a run of `cosim run`.")],
) -> None:
    """Write report.html and the figures of a results folder anew; the run is not repeated."""
    # Imported here, so that help does not wait for numerical and plotting libraries.
    from ..report.rewritten import rewrite

    typer.echo(rewrite(folder))
