"""A picture of a movie: heading and time, the tissue, its colours, and below a curve with the moment marked."""

import textwrap

import numpy as np
from matplotlib.figure import Figure

from ...orchestrator.results.stored_run import StoredRun
from ..figures.cavity_volumes import chamber
from ..figures.plot_axes import curve, styled
from ..heading import heading_of
from .field import MovieField
from .stage import stage_of

#: Inches; at this resolution the numbers of pixels are even, as coders of movies need them.
_WIDTH, _HEIGHT, DOTS_PER_INCH = 6.4, 7.2, 150

#: Letters of a heading in a line.
_LETTERS = 75

#: Curves below the tissue, at most.
_MOST = 4


class Picture:
    """One after the other on the same figure, so that nothing but what moves is different."""

    def __init__(self, field: MovieField) -> None:
        self._run, self._stage, self._colors = field.run, stage_of(field), field.colors()
        curves, label = _curves(field.run)
        self.figure = Figure(figsize=(_WIDTH, _HEIGHT))
        self._heading = textwrap.fill(heading_of(field.run), _LETTERS, max_lines=2, placeholder=" …")
        left, low = (0.13, 0.44) if self._stage.has_labels else (0.02, 0.36)
        self._place = (left, low, (0.8 if self._stage.has_bar else 0.95) - left, 0.89 - low)
        if self._stage.has_bar:
            bar = self.figure.add_axes((0.83, 0.42, 0.025, 0.4))
            self.figure.colorbar(self._colors, cax=bar).set_label(field.label, fontsize=11)
        self._axis = self.figure.add_axes(self._place)
        self._time = self.figure.text(0.5, 0.9, "", fontsize=13, ha="center", va="bottom")
        self.figure.text(0.02, 0.99, self._heading, fontsize=11, fontweight="bold", va="top")
        self._cursor = None
        if curves:
            below = self.figure.add_axes((0.13, 0.09, 0.82, 0.2))
            styled(below)
            time = field.run.columns["time_ms"]
            for number, (name, values) in enumerate(curves.items()):
                curve(below, number, time, values, name)
            below.set(xlim=(time[0], max(time[-1], time[0] + 1e-9)), xlabel="time (ms)", ylabel=label)
            below.legend(fontsize=9, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=_MOST)
            self._cursor = below.axvline(time[0], color="black", linewidth=1.2)

    def show(self, frame: int) -> None:
        """Change the figure to a frame."""
        self._axis.remove()
        self._axis = self.figure.add_axes(self._place)
        self._stage.draw(self._axis, frame, self._colors)
        time = float(self._run.frames_ms[frame])
        self._time.set_text(f"{time:g} ms")
        if self._cursor is not None:
            self._cursor.set_xdata([time, time])


def _curves(run: StoredRun) -> tuple[dict[str, np.ndarray], str]:
    """The volumes of the cavities, or else the potential at the probes, and the label of their axis."""
    columns = run.columns
    if len(columns.get("time_ms", ())) < 2:
        return {}, ""
    volumes = {name: values for name, values in columns.items() if name.endswith("_volume_ml") and np.any(values > 0)}
    if volumes:
        found = {chamber(name.removesuffix("_volume_ml")): values for name, values in volumes.items()}
        return dict(list(found.items())[:_MOST]), "volume (ml)"
    probes = {
        name.removeprefix("potential_").removesuffix("_mV"): values
        for name, values in columns.items()
        if name.startswith("potential_") and name.endswith("_mV")
    }
    return dict(list(probes.items())[:_MOST]), "potential (mV)"
