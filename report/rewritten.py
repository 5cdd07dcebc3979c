"""Figures and page of a run that is over, made again from what it left."""

from collections.abc import Sequence
from pathlib import Path

from ..orchestrator.errors import InputError
from ..orchestrator.results.lock import FolderLock
from ..orchestrator.results.names import FIELDS, PAGE, SUMMARY, TIME_SERIES


def rewrite(folder: Path, times_ms: Sequence[float] = ()) -> Path:
    """Draw the figures and write the page of the results in `folder` again; returns the page.

    `times_ms` are the times whose nearest frames the figures show, in place of those that are chosen by what happens.

    Raises
    ------
    InputError
        Where there are no results, where a run is writing them, where they cannot be read or the page not written, and
        for a time outside the run.
    """
    if not any((folder / name).is_file() for name in (SUMMARY, TIME_SERIES, FIELDS)):
        raise InputError(
            f"{folder}: there are no results of a run in this folder (no {SUMMARY}, {TIME_SERIES} or {FIELDS}); name "
            "the folder that `cosim run` said it wrote, or run the scenario first"
        )
    from .figures.draw import draw_figures
    from .page import write_page

    lock = FolderLock(folder)
    try:
        draw_figures(folder, times_ms=times_ms)
        return write_page(folder)
    except OSError as error:
        place = error.filename or folder
        raise InputError(
            f"{folder}: {PAGE} cannot be made ({place}: {error.strerror or error}); run the scenario again if a file "
            "is damaged, or make the folder writable"
        ) from error
    finally:
        lock.release()
