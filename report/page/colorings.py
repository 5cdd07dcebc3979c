"""What the surface is coloured by: the scalar fields of a run, each with its range and its colours."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .packed import Packed, levels
from .shape import Shape
from .wording import split, spoken, with_unit

#: The fields that everybody looks for first, in this order.
_FIRST = ("potential_mV", "active_stress_kPa", "stretch", "activation_time_ms")

#: The ending of a field of the times of events, which has no value where nothing has happened yet.
_EVENTS = "_time_ms"

#: Widths in ms that isochrones may have, and how many of them there are at most.
_BANDS_MS, _MOST_BANDS = tuple(base * 10.0**power for power in range(-2, 4) for base in (1.0, 2.0, 5.0)), 16

_NOT_YET = "#c8c8c8"


@dataclass(frozen=True)
class Coloring:
    """A field as it is shown.

    Attributes
    ----------
    name, label, note:
        Of the data set; with its unit of measure, for the colour bar; and what a person has to know of it.
    values:
        At the mesh's nodes, shape (frames, nodes); of one frame where it is the same in all.
    low, high:
        The range of the colours.
    scale:
        Colours by their place in that range, from 0 to 1, as Plotly has them.
    ticks:
        Where the colour bar has numbers; empty to leave that to Plotly.
    """

    name: str
    label: str
    values: Values
    low: float
    high: float
    scale: list[list[Any]]
    note: str = ""
    ticks: tuple[float, ...] = ()

    def content(self, packed: Packed) -> dict[str, Any]:
        """For the page's program."""
        return {
            "name": self.name,
            "label": self.label,
            "note": self.note,
            "low": self.low,
            "high": self.high,
            "scale": self.scale,
            "ticks": list(self.ticks),
            "levels": packed.add(levels(self.values, self.low, self.high), "u2"),
        }


def colorings(run: StoredRun, shape: Shape, every: int) -> list[Coloring]:
    """All scalar fields that change in a run, the usual ones first; of every so-many-th frame."""
    found = []
    names = sorted(run.moving, key=lambda name: (_FIRST.index(name) if name in _FIRST else len(_FIRST), name))
    for name in names:
        values = run.frames(name, every)
        if values is None or values.ndim != 2 or not len(values):
            continue
        if name.endswith(_EVENTS):
            last = run.frame(name, len(run.frames_ms) - 1)
            coloring = None if last is None else _events(name, last, shape)
        else:
            coloring = _field(name, values, shape)
        if coloring is not None:
            found.append(coloring)
    return found


def _field(name: str, values: Values, shape: Shape) -> Coloring:
    note = ""
    if values.shape[1] == len(shape.cells):
        values, note = shape.at_nodes(values), "means of the elements at each node"
    stem, unit = split(name)
    label = with_unit(spoken(stem), unit)
    low, high = float(values.min()), float(values.max())
    if stem.rpartition(".")[2] == "stretch":
        # Longer and shorter than at rest are told apart by colour.
        reach = max(high - 1.0, 1.0 - low, 1e-6)
        return Coloring(name, label, values, 1.0 - reach, 1.0 + reach, _named("RdBu_r", "diverging"), note)
    if not high > low:
        high = low + 1.0
    names = {"potential": "Plasma", "active_stress": "Viridis"}
    return Coloring(name, label, values, low, high, _named(names.get(stem, "Cividis")), note)


def _events(name: str, times: Values, shape: Shape) -> Coloring | None:
    """Bands of colour between isochrones; None where nothing has happened anywhere."""
    if times.shape[0] == len(shape.cells):
        return None
    happened = np.isfinite(times) & (times >= 0.0)
    if not happened.any():
        return None
    latest = float(times[happened].max())
    width = next(band for band in _BANDS_MS if latest / band <= _MOST_BANDS)
    count = max(int(np.ceil(latest / width + 1e-9)), 1)
    stem, unit = split(name)
    everywhere = bool(happened.all())
    total = count if everywhere else count + 1
    scale: list[list[Any]] = []
    for band in range(total):
        color = _color_at("Viridis", band / max(count - 1, 1)) if band < count else _NOT_YET
        scale += [[band / total, color], [(band + 1) / total, color]]
    note = f"isochrones every {width:g} ms" + ("" if everywhere else "; grey: not activated by the end")
    values = np.where(happened, times, (count + 1) * width)[None, :]
    step = max(1, -(-count // 8))
    ticks = tuple(width * tick for tick in range(0, count + 1, step))
    return Coloring(name, with_unit(spoken(stem), unit), values, 0.0, total * width, scale, note, ticks)


def _named(name: str, kind: str = "sequential") -> list[list[Any]]:
    # Imported here: who has no heart to show need not wait for it.
    from plotly import colors

    hues = getattr(getattr(colors, kind), name)
    return [[place / (len(hues) - 1), hue] for place, hue in enumerate(hues)]


def _color_at(name: str, place: float) -> str:
    """The colour at a place from 0 to 1 of a scale."""
    from plotly.colors import sample_colorscale

    return str(sample_colorscale(name, [place])[0])
