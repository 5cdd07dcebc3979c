"""Pictures in a folder: the same one in several formats, and the same content the same file."""

import io
from collections.abc import Mapping
from pathlib import Path

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ...orchestrator.results.whole import write_whole

_DOTS_PER_INCH = 160

#: The same SVG for the same content.
_SVG = {"hashsalt": "cardiac-cosim"}


def write_figure(figure: Figure, folder: Path, stem: str) -> list[Path]:
    """Write `figure` into `folder` as PNG and as SVG, called after `stem`; returns the files."""
    paths = {kind: folder / f"{stem}.{kind}" for kind in ("png", "svg")}
    write_pictures(figure, paths, _SVG)
    return list(paths.values())


def write_pictures(figure: Figure, paths: Mapping[str, Path], svg: Mapping[str, str]) -> None:
    """Write `figure` to `paths` by format, `png` and `svg`; `svg` are Matplotlib's settings for the latter."""
    FigureCanvasAgg(figure)
    with rc_context({f"svg.{name}": value for name, value in svg.items()}):
        for kind, path in paths.items():
            content = io.BytesIO()
            figure.savefig(content, format=kind, dpi=_DOTS_PER_INCH, metadata={"Date": None} if kind == "svg" else None)
            write_whole(path, content.getvalue())
