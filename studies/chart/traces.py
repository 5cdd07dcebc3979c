"""The points of a chart, its lines and fronts, as Plotly takes them."""

from collections.abc import Sequence
from math import isinf, isnan
from typing import Any

from ..pictures.markup import safe_lines
from .chart import Chart, ChartLine
from .panel import Panel, Spot, is_sweep, path
from .panel_places import LETTERS, Places
from .style import Style, style_of
from .telling import hover_text


def panel_traces(chart: Chart, each: Panel, where: Places) -> list[dict[str, Any]]:
    """Front and lines of a panel."""
    across, up = each.stairs()
    traces = [
        {
            "type": "scatter",
            "x": across,
            "y": up,
            "mode": "lines",
            "line": {"color": "#d0d0d0", "width": 6, "simplify": False},
            "name": "front",
            "hoverinfo": "skip",
            "legend": where.legend,
            "legendgroup": "front",
            **where.axes,
        }
    ]
    for number, line in enumerate(chart.lines):
        traces += _line_traces(number, line, each, where)
    return traces


def _line_traces(number: int, line: ChartLine, each: Panel, where: Places) -> list[dict[str, Any]]:
    style = style_of(number)
    pieces = path(line, each.spots[number])
    connected: list[Spot | None] = []
    for piece in pieces:
        connected += [*([None] if connected else []), *piece]
    on_path = {id(spot.row) for spot in connected if spot is not None}
    others = [spot for spot in each.spots[number] if not isnan(spot.cost) and id(spot.row) not in on_path]
    name = safe_lines(line.name, LETTERS)
    order = line.orders.get(each.measure.name)
    if order is not None:
        name += f"<br>order {order:z.1f}"
    elif not is_sweep(line) and len(line.rows) > 1:
        name += "<br>line through its best points"
    traces: list[dict[str, Any]] = []
    # A line of which nothing is done is in the legend all the same.
    for spots, mode in ((connected, "lines+markers"), (others, "markers")):
        if spots or (mode == "markers" and not traces):
            trace = _points(line, spots, each, style)
            traces.append(
                {**trace, "mode": mode, "name": name, "showlegend": not traces, "legend": where.legend}
                | {"legendgroup": f"line {number}", **where.axes}
            )
    return traces


def _points(line: ChartLine, spots: Sequence[Spot | None], each: Panel, style: Style) -> dict[str, Any]:
    places = [(None, None) if spot is None else each.place(spot) for spot in spots]
    extents = [None if spot is None else each.view.extent(spot.row) for spot in spots]
    bars = [
        (0.0, 0.0) if spot is None or extent is None else (extent[1] - spot.cost, spot.cost - extent[0])
        for spot, extent in zip(spots, extents, strict=True)
    ]
    on_front = [spot is not None and spot.is_on_front for spot in spots]
    trace: dict[str, Any] = {
        "type": "scatter",
        # Without a point there is nothing in the plot, and still an entry in the legend.
        "x": [place[0] for place in places] or [None],
        "y": [place[1] for place in places] or [None],
        "marker": {
            "symbol": [_symbol(spot, style) for spot in spots] or style.symbol,
            "size": 10,
            "color": style.color,
            "opacity": [1.0 if on else 0.65 for on in on_front] or 1.0,
            "line": {"width": 1.5, "color": style.color},
        },
        "line": {"color": style.color, "width": 2, "dash": _dash(style)},
        "hovertext": [
            "" if spot is None else hover_text(line, spot.row, each.measure, spot.is_on_front) for spot in spots
        ],
        "hoverinfo": "text",
        # Markers at an edge are whole.
        "cliponaxis": False,
    }
    if any(extents):
        trace["error_x"] = {
            "type": "data",
            "symmetric": False,
            "array": [bar[0] for bar in bars],
            "arrayminus": [bar[1] for bar in bars],
            "color": style.color,
            "thickness": 1,
            "width": 3,
        }
    return trace


def _symbol(spot: Spot | None, style: Style) -> str:
    if spot is None or spot.is_placed:
        return style.symbol if spot is None or spot.is_on_front else f"{style.symbol}-open"
    if isnan(spot.error):
        return "x-thin-open"
    return "arrow-up" if isinf(spot.error) else "arrow-down"


def _dash(style: Style) -> str:
    return ",".join(f"{2 * length:g}px" for length in style.dashes) or "solid"


def strip_traces(chart: Chart, each: Panel, where: Places) -> list[dict[str, Any]]:
    """The points without a result, side by side above a panel."""
    traces, used = [], 0
    for number, (line, spots) in enumerate(zip(chart.lines, each.spots, strict=True)):
        missing = [spot for spot in spots if isnan(spot.cost)]
        if missing:
            style = style_of(number)
            traces.append(
                {
                    "type": "scatter",
                    "x": list(range(used, used + len(missing))),
                    "y": [0] * len(missing),
                    "mode": "markers+text",
                    "marker": {
                        "symbol": f"{style.symbol}-open",
                        "size": 12,
                        "color": style.color,
                        "line": {"width": 1.5, "color": style.color},
                    },
                    "text": ["×"] * len(missing),
                    "textfont": {"size": 18, "color": "black"},
                    "textposition": "middle center",
                    "name": safe_lines(line.name, LETTERS),
                    "showlegend": False,
                    "legendgroup": f"line {number}",
                    "hovertext": [hover_text(line, spot.row, each.measure, False) for spot in missing],
                    "hoverinfo": "text",
                    **where.strip_axes,
                }
            )
            used += len(missing)
    return traces
