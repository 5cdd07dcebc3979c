"""A panel of a map as Plotly draws it: boxes, boundaries and signs as in the figure, and all of a run on hover."""

from itertools import pairwise
from math import log10
from typing import Any

from plotly.graph_objects import Figure

from ..pictures.markup import safe_lines
from .axis_words import pair_words
from .look import LOOKS
from .map import KINDS, Cell
from .placed_axis import PlacedAxis
from .placed_panel import PlacedPanel
from .telling import LETTERS, crossing_text, hover_text

_INK = "#000000"

#: Pixels: the height of a panel, and of a panel for each line of a label beside it.
_HEIGHT, _LINE = 420, 17

#: Letters in a line of a label below a box, of all boxes together, and of a label beside the axis.
_BELOW, _BESIDE = 60, 14

#: The values of the grid stand at an axis where neighbours are not closer than this part of it.
_CLOSEST = 0.055

#: Pixels within which a sign is hovered over, and not the box below it.
_NEAR = 8


def plot(placed: PlacedPanel) -> Figure:
    """One panel; the height is set, the width is that of the page."""
    traces = [
        *(_boxes(placed, kind) for kind in KINDS),
        _hover(placed),
        *(strips for kind in KINDS for strips in _strips(placed, kind)),
        *_limit(placed),
        *_crossings(placed),
    ]
    x, y = pair_words(placed.panel.x_key, placed.panel.y_key)
    beside = max(_lines(label, _BESIDE).count("<br>") + 1 for label in placed.y.labels)
    layout = {
        "template": "none",
        "height": max(_HEIGHT, 130 + len(placed.y.values) * _LINE * beside),
        "margin": {"l": 8, "r": 12, "t": 12, "b": 8},
        "font": {"family": "sans-serif", "size": 13, "color": "#222222"},
        "hovermode": "closest",
        "hoverdistance": _NEAR,
        "hoverlabel": {"align": "left", "bgcolor": "white", "font": {"color": "#222222", "size": 12}},
        "showlegend": False,
        "xaxis": _axis(placed.x, x, _BELOW // max(len(placed.x.values), 1)),
        "yaxis": _axis(placed.y, y, _BESIDE),
    }
    return Figure(data=[trace for trace in traces if trace is not None], layout=layout)


# --- inside -----------------------------------------------------------------------------------------------------------


def _boxes(placed: PlacedPanel, kind: str) -> dict[str, Any] | None:
    """The boxes of a class as polygons, for areas alone have hatching."""
    across: list[float | None] = []
    up: list[float | None] = []
    for box, cell in placed.boxes.items():
        if cell.kind == kind:
            left, right, low, high = placed.corners(box)
            across += [left, right, right, left, left, None]
            up += [low, low, high, high, low, None]
    if not across:
        return None
    look = LOOKS[kind]
    pattern = {"shape": look.pattern, "fgcolor": look.ink, "bgcolor": look.color, "size": 8, "solidity": 0.25}
    return {
        "type": "scatter",
        "name": kind,
        "x": across,
        "y": up,
        "mode": "lines",
        "line": {"color": "white", "width": 1},
        "fill": "toself",
        "fillcolor": look.color,
        "fillpattern": {**pattern, "fillmode": "replace"},
        "hoverinfo": "skip",
    }


def _hover(placed: PlacedPanel) -> dict[str, Any]:
    """A clear layer over the boxes that knows what to say anywhere in them: polygons say only one thing together."""
    columns, rows = range(len(placed.x.places)), range(len(placed.y.places))
    cells = [[placed.boxes.get((across, up)) for across in columns] for up in rows]
    return {
        "type": "heatmap",
        "name": "cells",
        "x": list(placed.x.edges),
        "y": list(placed.y.edges),
        "z": [[None if cell is None else KINDS.index(cell.kind) for cell in row] for row in cells],
        "hovertext": [[_said(placed, cell) for cell in row] for row in cells],
        "hoverinfo": "text",
        "hoverongaps": False,
        "zmin": 0,
        "zmax": len(KINDS),
        "colorscale": [[0.0, "rgba(0,0,0,0)"], [1.0, "rgba(0,0,0,0)"]],
        "showscale": False,
    }


def _said(placed: PlacedPanel, cell: Cell | None) -> str:
    return "" if cell is None else hover_text(placed.panel, cell)


def _strips(placed: PlacedPanel, kind: str) -> list[dict[str, Any]]:
    """The runs of a class between those of the grid, with a dark rim."""
    marks = [mark for mark in placed.marks if mark.cell.kind == kind]
    if not marks:
        return []
    places = {
        "type": "scatter",
        "x": [placed.x.part(mark.left, mark.right, 0.5) for mark in marks],
        "y": [mark.y for mark in marks],
        "mode": "markers",
    }
    rim = {"symbol": "line-ew", "size": 24, "line": {"width": 6, "color": "#222222"}}
    strip = {"symbol": "line-ew", "size": 23, "line": {"width": 4, "color": LOOKS[kind].color}}
    said = [hover_text(placed.panel, mark.cell) for mark in marks]
    return [
        {**places, "name": "rim", "marker": rim, "hoverinfo": "skip"},
        {**places, "name": f"bisection: {kind}", "marker": strip, "hovertext": said, "hoverinfo": "text"},
    ]


def _limit(placed: PlacedPanel) -> list[dict[str, Any]]:
    """The predicted boundary, with a light rim that parts it from dark boxes."""
    traces = []
    for color, width in (("white", 7), (_INK, 4)):
        for piece in placed.limit:
            traces.append(
                {
                    "type": "scatter",
                    "name": "rim" if color == "white" else "theory",
                    "x": piece[:, 0].tolist(),
                    "y": piece[:, 1].tolist(),
                    "mode": "lines",
                    "line": {"color": color, "width": width},
                    "hoverinfo": "skip",
                }
            )
    return traces


def _crossings(placed: PlacedPanel) -> list[dict[str, Any]]:
    if not placed.crossings:
        return []
    crossings = [each.crossing for each in placed.crossings]
    return [
        {
            "type": "scatter",
            "name": "measured",
            "x": [each.x for each in placed.crossings],
            "y": [crossing.measured for crossing in crossings],
            "error_y": {
                "type": "data",
                "symmetric": False,
                "array": [crossing.high - crossing.measured for crossing in crossings],
                "arrayminus": [crossing.measured - crossing.low for crossing in crossings],
                "color": _INK,
                "thickness": 1.5,
                "width": 5,
            },
            "mode": "markers",
            "marker": {"symbol": "diamond", "size": 9, "color": "white", "line": {"color": _INK, "width": 1.5}},
            "hovertext": [crossing_text(placed.panel, crossing) for crossing in crossings],
            "hoverinfo": "text",
        }
    ]


def _axis(axis: PlacedAxis, words: str, letters: int) -> dict[str, Any]:
    first, last = axis.edges[0], axis.edges[-1]
    found: dict[str, Any] = {
        "title": {"text": safe_lines(words, LETTERS), "standoff": 8},
        "type": "log" if axis.is_logarithmic else "linear",
        "range": [log10(first), log10(last)] if axis.is_logarithmic else [first, last],
        "automargin": True,
        "showgrid": False,
        "zeroline": False,
        "showline": True,
        "mirror": True,
        "linecolor": "#222222",
        "ticks": "outside",
        "ticklen": 4,
        "tickformat": "~g",
    }
    if not axis.is_number or all(other - one >= _CLOSEST for one, other in pairwise(axis.parts)):
        labels = [_lines(label, max(letters, 8)) for label in axis.labels]
        found |= {"tickmode": "array", "tickvals": list(axis.places), "ticktext": labels}
    return found


def _lines(label: str, letters: int) -> str:
    return safe_lines(label, letters)
