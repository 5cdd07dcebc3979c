"""Panels over time as one figure for Plotly: above one another, with one axis of time."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...orchestrator.participants.participant import Values
from ...studies.pictures.colors import COLORS
from ...studies.pictures.line_breaks import in_lines
from ...studies.pictures.markup import safe

#: Rows of a curve that a page holds at most, and curves of a panel.
_MOST_ROWS, MOST_CURVES = 4000, 12

#: Heights in pixels: of a panel, of a line of its title, of the axis of time, of the spaces below title and panel.
_PANEL, _LINE, _AXIS, _BELOW_TITLE, _GAP = 130, 18, 44, 6, 14

#: Numbers at an axis of values at most.
_TICKS = 5

#: Values that differ by less, relative to the largest, are the same.
_SAME = 1e-9

#: Letters in a line of a title, so that it fits a narrow screen.
_LETTERS = 44

#: Lines are told apart without colours too.
_DASHES = ("solid", "dash", "dot", "dashdot")
_SIGNS = {"solid": "━", "dash": "╍", "dot": "┅", "dashdot": "┉"}

#: Letters that stand between two names of a key.
_BETWEEN = 5


@dataclass(frozen=True)
class Curve:
    """Values over time in ms; NaN where there is none."""

    name: str
    time_ms: Values
    values: Values


@dataclass(frozen=True)
class Panel:
    """Curves in one unit of measure.

    Attributes
    ----------
    title:
        What is shown, with the unit; it stands above the panel.
    mode:
        How curves are drawn, as Plotly calls it.
    steps:
        Whether a value holds for the step before its time.
    has_gaps:
        Whether nothing is drawn across values that are missing; otherwise they are of a unit that steps less often.
    """

    title: str
    curves: Sequence[Curve]
    is_logarithmic: bool = False
    mode: str = "lines"
    steps: bool = False
    has_gaps: bool = False
    whole_numbers: bool = False


def figure(panels: Sequence[Panel], end_ms: float) -> dict[str, Any] | None:
    """Data and layout for Plotly; None without panels."""
    if not panels:
        return None
    titles = [_title(panel) for panel in panels]
    heads = [_LINE * len(lines) + _BELOW_TITLE for lines in titles]
    height = sum(heads) + len(panels) * (_PANEL + _GAP) + _AXIS
    inner = height - _AXIS
    data: list[dict[str, Any]] = []
    layout: dict[str, Any] = {
        "height": height,
        "margin": {"l": 62, "r": 14, "t": 0, "b": _AXIS},
        "hovermode": "x",
        "hoverdistance": -1,
        "dragmode": "zoom",
        "font": {"family": "inherit", "size": 12, "color": "#333"},
        "plot_bgcolor": "white",
        "paper_bgcolor": "white",
        "annotations": [],
        "shapes": [],
    }
    top = 0
    for number, (panel, head, title) in enumerate(zip(panels, heads, titles, strict=True), start=1):
        suffix = "" if number == 1 else str(number)
        upper, lower = (1.0 - at / inner for at in (top + head, top + head + _PANEL))
        layout[f"yaxis{suffix}"] = {
            "domain": [max(lower, 0.0), upper],
            "type": "log" if panel.is_logarithmic else "linear",
            "gridcolor": "#e8e8e8",
            "zeroline": False,
            "automargin": False,
            "nticks": _TICKS,
            "exponentformat": "power" if panel.is_logarithmic else "e",
            "fixedrange": True,
            **_ticks(panel),
        }
        layout[f"xaxis{suffix}"] = {
            "range": [0.0, end_ms],
            "gridcolor": "#e8e8e8",
            "zeroline": False,
            "anchor": f"y{suffix}",
            "showticklabels": number == len(panels),
            **({"title": {"text": "time (ms)", "standoff": 6}} if number == len(panels) else {}),
            **({} if number == 1 else {"matches": "x"}),
        }
        layout["annotations"].append(
            {
                "text": "<br>".join(title),
                "xref": "paper",
                "yref": "paper",
                "x": 0.0,
                "y": 1.0 - top / inner,
                "xshift": -56,
                "xanchor": "left",
                "yanchor": "top",
                "showarrow": False,
                "align": "left",
            }
        )
        data += [_trace(panel, place, curve, suffix) for place, curve in enumerate(panel.curves)]
        top += head + _PANEL + _GAP
    return {"data": data, "layout": layout}


def _ticks(panel: Panel) -> dict[str, Any]:
    """What Plotly does not choose well by itself."""
    known = np.concatenate([curve.values[np.isfinite(curve.values)] for curve in panel.curves])
    if panel.is_logarithmic:
        known = np.log10(known[known > 0.0])
        return {"dtick": max(1, int(np.ceil(np.ptp(known) / _TICKS)))} if len(known) and np.ptp(known) > 1.0 else {}
    low, high = float(known.min()), float(known.max())
    if panel.whole_numbers:
        return {"tick0": 0, "dtick": max(1, -(-int(high) // _TICKS)), "range": [0.0, 1.08 * max(high, 1.0)]}
    largest = max(abs(low), abs(high))
    if high - low < _SAME * largest:
        # Rounding is no curve.
        return {"range": [min(0.0, 1.2 * low), max(0.0, 1.2 * high)]}
    return {}


def _title(panel: Panel) -> list[str]:
    """The lines above a panel: what it shows, and the names of its curves in their colours."""
    lines = [f"<b>{safe(line)}</b>" for line in in_lines(panel.title, _LETTERS, len)]
    if len(panel.curves) == 1:
        return lines
    key: list[list[str]] = [[]]
    letters = 0
    for place, curve in enumerate(panel.curves):
        letters += len(curve.name) + _BETWEEN
        if key[-1] and letters > _LETTERS:
            key.append([])
            letters = len(curve.name) + _BETWEEN
        color = COLORS[place % len(COLORS)]
        key[-1].append(f'<span style="color:{color}">{_SIGNS[_dash(panel, place)]} {safe(curve.name)}</span>')
    return [*lines, *("   ".join(line) for line in key)]


def _dash(panel: Panel, place: int) -> str:
    return _DASHES[place // len(COLORS) % len(_DASHES)] if len(panel.curves) > len(COLORS) else _DASHES[0]


def _trace(panel: Panel, place: int, curve: Curve, suffix: str) -> dict[str, Any]:
    time, values = curve.time_ms, curve.values
    if panel.is_logarithmic:
        values = np.where(values > 0.0, values, np.nan)
    every = max(1, -(-len(time) // _MOST_ROWS))
    line: dict[str, Any] = {
        "color": COLORS[place % len(COLORS)],
        "width": 1.8,
        "dash": _dash(panel, place),
    }
    if panel.steps:
        line["shape"] = "vh"
    # A line of one point is none; a dot shows that it is there.
    single = int(np.isfinite(values).sum()) == 1
    return {
        "type": "scatter",
        "mode": "markers" if single else panel.mode,
        "name": safe(curve.name),
        "x": _numbers(time[::every]),
        "y": _numbers(values[::every]),
        "xaxis": f"x{suffix}",
        "yaxis": f"y{suffix}",
        "showlegend": False,
        "line": line,
        "marker": {"color": line["color"], "size": 4},
        "connectgaps": not panel.has_gaps,
        "hovertemplate": "%{y:.5g}",
    }


def _numbers(values: Values) -> dict[str, str]:
    """Numbers as Plotly reads them without a loss."""
    content = np.ascontiguousarray(values, "<f8").tobytes()
    return {"dtype": "f8", "bdata": base64.b64encode(content).decode("ascii")}
