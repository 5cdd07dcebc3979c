"""Writes a movie of a run: MP4 or GIF, by the ending of its name, without a screen."""

from collections.abc import Callable
from pathlib import Path

from matplotlib import rc_context
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ...orchestrator.errors import InputError
from ...orchestrator.results.stored_run import StoredRun
from ...orchestrator.writing import allowed
from .field import MovieField
from .picture import DOTS_PER_INCH, Picture

#: Pictures per second if nobody asks for others: those of a heartbeat then take some seconds.
FRAMES_PER_SECOND = 10

KINDS = (".mp4", ".gif")


def write_movie(
    run: StoredRun,
    path: Path,
    asked: str | None = None,
    frames_per_second: int = FRAMES_PER_SECOND,
    progress: Callable[[int, int], None] = lambda done, count: None,
) -> None:
    """Write a movie of all stored frames of `run` to `path`.

    Parameters
    ----------
    asked:
        The field that colours the tissue; if None, the potential, or the first of the others that there is.
    progress:
        Called with the number of pictures that are done and that of all.

    Raises
    ------
    InputError
        For an ending that is no movie's, a run without frames or without such a field, and a place that cannot be
        written.
    """
    if path.suffix.lower() not in KINDS:
        raise InputError(f"{path}: a movie is written as .mp4 or .gif; choose a name that ends in one of them")
    count = len(run.frames_ms)
    if not count:
        raise InputError(
            f"{run.folder}: there are no stored frames to film; give the folder of a run with a scene, which has a "
            "fields.h5"
        )
    picture = Picture(MovieField.of(run, asked))
    FigureCanvasAgg(picture.figure)
    writer, settings = _writer(path.suffix.lower(), frames_per_second)
    # The movie is there whole or not at all.
    partial = path.with_name(f"{path.stem}.partial{path.suffix.lower()}")
    with allowed(path.parent, "--output"), rc_context(settings):
        try:
            with writer.saving(picture.figure, str(partial), DOTS_PER_INCH):
                for frame in range(count):
                    picture.show(frame)
                    writer.grab_frame()
                    progress(frame + 1, count)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


def _writer(kind: str, frames_per_second: int) -> tuple[AbstractMovieWriter, dict[str, str]]:
    """What writes movies of that kind, and Matplotlib's settings for it."""
    if kind == ".gif":
        return PillowWriter(fps=frames_per_second), {}
    # Brings the program ffmpeg along, which few machines have.
    from imageio_ffmpeg import get_ffmpeg_exe

    try:
        settings = {"animation.ffmpeg_path": get_ffmpeg_exe()}
    except RuntimeError as error:
        raise InputError(
            f"MP4 needs the program ffmpeg, which is not there ({error}); install it, or write a .gif"
        ) from None
    # The one form of colours that every player has.
    return FFMpegWriter(frames_per_second, "h264", extra_args=["-pix_fmt", "yuv420p", "-crf", "20"]), settings
