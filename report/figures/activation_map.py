"""When the wave reached each place: isochrones on the surface and in sections, or over a sheet."""

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import Body, StoredRun
from .excitation import activation_times
from .isochrones import Isochrones, isochrones
from .layout import BAR_IN, TEXT_PT, TITLE_PT, color_bar, panels
from .plane import sheet_of
from .plane_activation import plane_activation
from .probes import mark, probes
from .scene import View, add_scale_bar, show
from .skin import Skin
from .viewpoints import BACK, FRONT, long_axis, short_axis

_LABEL = "activation time (ms)"

# Probes are marked in a section that they are so near to, relative to the size of the body.
_NEAR = 0.05


def activation_map(run: StoredRun) -> Figure | None:
    """The map of a solid or of a sheet; None for a run without activation times that differ, or in another scene."""
    times = activation_times(run)
    bands = None if times is None else isochrones(times)
    if times is None or bands is None:
        return None
    if run.mesh is not None:
        return _of_a_solid(run, run.mesh, times, bands)
    sheet = sheet_of(run)
    return None if sheet is None else plane_activation(run, sheet, times, bands)


def _of_a_solid(run: StoredRun, mesh: Body, times: Values, bands: Isochrones) -> Figure:
    skin, colors = Skin(mesh), bands.colors
    sections = {"long-axis section": long_axis(mesh.points), "short-axis section, from above": short_axis(mesh.points)}
    scenes = {"from the front": FRONT, "from behind": BACK, **sections}
    windows = [skin.window(view) for view in scenes.values()]
    windows = [window.as_large_as(windows) for window in windows]
    missing = bool(np.isnan(times).any())
    shown = panels(4, 2, windows[0].aspect, below_in=BAR_IN + 0.25 * missing)
    for axis, (title, view), window in zip(shown.axes, scenes.items(), windows, strict=True):
        on_skin, on_cut = skin.lines(view, times, bands.inner)
        body = [skin.painted(view, times, colors, levels=bands.inner), skin.edges(view), on_skin]
        face, rim = skin.cut(view, times, colors, bands.inner)
        show(axis, view, [body, face, [*rim, on_cut]], window)
        axis.set_title(title, fontsize=TITLE_PT)
        if title in sections:
            mark(axis, _near(run, view, skin.size_mm))
    add_scale_bar(shown.axes[0], FRONT, windows[0])
    color_bar(shown, colors, _LABEL, ticks=bands.ticks)
    if missing:
        shown.figure.supxlabel(f"grey: not activated by {run.end_ms:g} ms", fontsize=TEXT_PT)
    return shown.figure


def _near(run: StoredRun, view: View, size_mm: float) -> dict[str, tuple[float, float]]:
    """Where the probes on the face of the cut are on the picture."""
    right, upward, _ = view.axes
    return {
        name: (float(place @ right), float(place @ upward))
        for name, place in probes(run).items()
        if abs(view.beyond(place)) < _NEAR * size_mm
    }
