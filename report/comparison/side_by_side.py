"""The tissue of several runs side by side: a row for each of some moments, a picture for each run."""

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from ..figures.frames import of_a_beat
from ..figures.layout import BAR_IN, TEXT_PT, color_bar, panels, wrapped
from ..figures.plane import frame_plane, sheet_of
from ..figures.scene import add_scale_bar, show
from ..figures.skin import Skin
from ..figures.viewpoints import TILTED
from .compared import Compared

#: Runs in a row, and rows.
_MOST_RUNS, _MOST_MOMENTS = 4, 5

_FIELD, _LABEL = "potential_mV", "transmembrane potential (mV)"

_DOTS_PER_INCH = 200

#: How far two times in ms may be apart and still be the same.
_SAME_MS = 1e-6


def side_by_side(compared: Compared) -> bytes | None:
    """The potential of all runs at the same times as a PNG; None unless two of them have it on a solid or a sheet.

    The times are those at which something happens in the first run, or the nearest that all of them have stored.
    """
    shown = [(name, run) for name, run in compared.runs.items() if _is_shown(run)]
    # Solids are seen in projection and sheets from above: those of the other kind would need another picture.
    runs = dict([(name, run) for name, run in shown if (run.mesh is None) == (shown[0][1].mesh is None)][:_MOST_RUNS])
    if len(runs) < 2:
        return None
    first = shown[0][1]
    # At the very start all runs of a scene are alike.
    common = [time for time in first.frames_ms[1:] if all(_at(run, time) is not None for run in runs.values())]
    if not common:
        return None
    moments = of_a_beat(first, _FIELD, "displacement_mm")
    times = sorted({min(common, key=lambda time: abs(time - frame.time_ms)) for frame in moments})
    places = np.linspace(0, len(times) - 1, min(len(times), _MOST_MOMENTS)).round().astype(int)
    figure = _drawn(runs, [times[place] for place in places])
    FigureCanvasAgg(figure)
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_DOTS_PER_INCH)
    return content.getvalue()


# --- inside -----------------------------------------------------------------------------------------------------------


def _drawn(runs: dict[str, StoredRun], times: Sequence[float]) -> Figure:
    shown = [
        (time, name, run, frame)
        for time in times
        for name, run in runs.items()
        if (frame := _at(run, time)) is not None
    ]
    values = {(time, name): _field(run, frame) for time, name, run, frame in shown}
    low, high = min(each.min() for each in values.values()), max(each.max() for each in values.values())
    colors = ScalarMappable(Normalize(low, high if high > low else low + 1.0), "viridis")
    solid = all(run.mesh is not None for run in runs.values())
    window = TILTED.window(np.concatenate([_places(run, frame) for _, _, run, frame in shown]))
    skins = {name: Skin(run.mesh) for name, run in runs.items() if run.mesh is not None}
    titles = [wrapped(f"{time:g} ms, {name}", len(runs)) for time, name, _, _ in shown]
    lines = max(title.count("\n") + 1 for title in titles)
    aspect = window.aspect if solid else 1.0
    array = panels(len(shown), len(runs), aspect, title_lines=lines, below_in=BAR_IN, square=True)
    for axis, title, (time, name, run, frame) in zip(array.axes, titles, shown, strict=True):
        axis.set_title(title, fontsize=TEXT_PT)
        triangles = sheet_of(run)
        if triangles is not None:
            axis.tripcolor(triangles, values[time, name], shading="gouraud", norm=colors.norm, cmap=colors.cmap)
            frame_plane(axis, triangles)
            axis.label_outer()
            continue
        points = _places(run, frame)
        body = [
            skins[name].painted(TILTED, values[time, name], colors, points=points),
            skins[name].edges(TILTED, points),
        ]
        show(axis, TILTED, [body], window)
    if solid:
        add_scale_bar(array.axes[0], TILTED, window)
    color_bar(array, colors, _LABEL)
    return array.figure


def _is_shown(run: StoredRun) -> bool:
    points, first = run.points_mm, run.frame(_FIELD, 0)
    on_tissue = run.mesh is not None or sheet_of(run) is not None
    return points is not None and first is not None and first.shape == (len(points),) and on_tissue


def _at(run: StoredRun, time_ms: float) -> int | None:
    """The number of the frame at a time; None if there is none."""
    found = np.flatnonzero(np.abs(run.frames_ms - time_ms) <= _SAME_MS)
    return int(found[0]) if len(found) else None


def _field(run: StoredRun, frame: int) -> Values:
    values = run.frame(_FIELD, frame)
    if values is None:
        raise KeyError(_FIELD)
    return values


def _places(run: StoredRun, frame: int) -> Values:
    points, moved = run.points_mm, run.frame("displacement_mm", frame)
    if points is None:
        raise TypeError("a run without nodes is not shown")
    return points if moved is None else points + moved
