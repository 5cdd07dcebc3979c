"""Figures and page of a run that is over, made again from what it left."""

from pathlib import Path

from ..orchestrator.errors import InputError
from ..orchestrator.results.lock import FolderLock
from ..orchestrator.results.names import FIELDS, PAGE, SUMMARY, TIME_SERIES


def rewrite(folder: Path) -> Path:
    """Draw the figures and write the page of the results in `folder` anew; returns the page.

    Raises
    ------
    InputError
        Where there are no results, where a run is writing them, and where they cannot be read or the page not written.
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
        draw_figures(folder)
        return write_page(folder)
    except OSError as error:
        place = error.filename or folder
        raise InputError(
            f"{folder}: {PAGE} cannot be made ({place}: {error.strerror or error}); run the scenario again if a file "
            "is damaged, or make the folder writable"
        ) from error
    finally:
        lock.release()
