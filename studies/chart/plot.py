"""A chart as Plotly draws it: a panel for each measure, buttons for the view, and all of a point on hover."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isinf, isnan, log10
from typing import Any

from plotly.graph_objects import Figure

from .caption import uncertainty_text
from .model import Chart, ChartLine
from .panel import Panel, Spot, is_sweep, panel, path, views
from .style import Style, style_of
from .telling import hover_text, safe, safe_lines

#: Pixels: a panel, what is above and below it, what is above them all, and a line of the legend.
_PANEL, _ABOVE, _BELOW, _HEAD, _ENTRY = 330, 44, 62, 56, 21

#: The part of the width that panels have, and where their legends begin.
_WIDE, _LEGEND = 0.74, 0.76

#: Letters in a line of the legend.
_LETTERS = 34

_INK, _GRID = "#222222", "#e6e6e6"


@dataclass(frozen=True)
class _Places:
    """Where the panel `number` of a measure is, from top to bottom in parts of the plot, and its axes and legend."""

    number: int
    count: int
    top: float
    bottom: float
    strip: tuple[float, float]

    @property
    def axes(self) -> dict[str, Any]:
        return {"xaxis": f"x{_suffix(self.number)}", "yaxis": f"y{_suffix(self.number)}"}

    @property
    def strip_axes(self) -> dict[str, Any]:
        number = self.count + self.number
        return {"xaxis": f"x{_suffix(number)}", "yaxis": f"y{_suffix(number)}"}

    @property
    def legend(self) -> str:
        return f"legend{_suffix(self.number)}"


def plot(chart: Chart) -> Figure:
    """The chart; the height is set, the width is that of the page."""
    kinds = views(chart)
    panels = [[panel(chart, measure, view) for view in kinds] for measure in chart.measures]
    places, height = _layout_of(chart, panels)
    traces: list[dict[str, Any]] = []
    shown: list[tuple[bool, bool]] = []
    shapes, annotations = [], []
    layout: dict[str, Any] = {}
    for where, pair in zip(places, panels, strict=True):
        for number, each in enumerate(pair):
            found = _traces(chart, each, where)
            traces += found
            shown += [(number == 0, number == 1)] * len(found)
        strip = _strip_traces(chart, pair[0], where)
        traces += strip
        shown += [(True, True)] * len(strip)
        layout |= _axes(pair[0], where, bool(strip))
        layout[where.legend] = _legend_at(where)
        shapes += _uncertainty(pair[0], where)
        if strip:
            annotations.append(_strip_words(where))
    for trace, (first, _) in zip(traces, shown, strict=True):
        trace["visible"] = first
    buttons = [
        {
            "label": view.label,
            "method": "update",
            "args": [{"visible": [on[number] for on in shown]}, _view_of([pair[number] for pair in panels], places)],
        }
        for number, view in enumerate(kinds)
    ]
    menu = {
        "type": "buttons",
        "direction": "right",
        "buttons": buttons,
        "showactive": True,
        "x": 0.0,
        "xanchor": "left",
        "y": 1.0,
        "yanchor": "bottom",
        "pad": {"b": 12},
    }
    layout |= {
        "template": "none",
        "height": height,
        "margin": {"l": 84, "r": 10, "t": _HEAD, "b": 10},
        "font": {"family": "sans-serif", "size": 13, "color": _INK},
        "hovermode": "closest",
        "hoverlabel": {"align": "left", "bgcolor": "white", "font": {"color": _INK}},
        "updatemenus": [menu],
        "shapes": shapes,
        "annotations": annotations,
    }
    return Figure(data=traces, layout=layout)


# --- inside -----------------------------------------------------------------------------------------------------------


def _suffix(number: int) -> str:
    return "" if number == 0 else str(number + 1)


def _layout_of(chart: Chart, panels: Sequence[Sequence[Panel]]) -> tuple[list[_Places], int]:
    """Where every measure's panel is, and the height of the whole in pixels."""
    entries = sum(safe_lines(line.name, _LETTERS).count("<br>") + 2 for line in chart.lines) + 4
    panel_height = max(_PANEL, _ENTRY * entries)
    row = _ABOVE + panel_height + _BELOW
    inner = row * len(panels)
    found = []
    for number in range(len(panels)):
        top = 1.0 - (number * row + _ABOVE) / inner
        strip = (top + 8 / inner, top + 34 / inner)
        found.append(_Places(number, len(panels), top, top - panel_height / inner, strip))
    return found, inner + _HEAD + 10


def _traces(chart: Chart, each: Panel, where: _Places) -> list[dict[str, Any]]:
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


def _line_traces(number: int, line: ChartLine, each: Panel, where: _Places) -> list[dict[str, Any]]:
    style = style_of(number)
    pieces = path(line, each.spots[number])
    connected: list[Spot | None] = []
    for piece in pieces:
        connected += [*([None] if connected else []), *piece]
    on_path = {id(spot.row) for spot in connected if spot is not None}
    others = [spot for spot in each.spots[number] if not isnan(spot.cost) and id(spot.row) not in on_path]
    name = safe_lines(line.name, _LETTERS)
    order = line.orders.get(each.measure.name)
    if order is not None:
        name += f"<br>order {order:.1f}"
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


def _strip_traces(chart: Chart, each: Panel, where: _Places) -> list[dict[str, Any]]:
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
                    "name": safe_lines(line.name, _LETTERS),
                    "showlegend": False,
                    "legendgroup": f"line {number}",
                    "hovertext": [hover_text(line, spot.row, each.measure, False) for spot in missing],
                    "hoverinfo": "text",
                    **where.strip_axes,
                }
            )
            used += len(missing)
    return traces


def _strip_words(where: _Places) -> dict[str, Any]:
    return {
        "text": "no result",
        "xref": "paper",
        "x": 0.0,
        "xanchor": "left",
        "yref": "paper",
        "y": 0.5 * sum(where.strip),
        "yanchor": "middle",
        "showarrow": False,
        "font": {"size": 12},
    }


def _axes(each: Panel, where: _Places, has_strip: bool) -> dict[str, Any]:
    """Of a panel, as the first view has them, and of the strip above it."""
    unit = f" ({safe(each.measure.unit)})" if each.measure.unit else ""
    common = {
        "type": "log",
        "showline": True,
        "mirror": True,
        "linecolor": _INK,
        "gridcolor": _GRID,
        "ticks": "outside",
        "tickformat": "~g",
        "minor": {"ticks": "outside", "ticklen": 3},
        "zeroline": False,
    }
    x = {**common, "domain": [0.0, _WIDE], "anchor": where.axes["yaxis"]} | _scale(*each.costs)
    x["title"] = {"text": each.view.label, "standoff": 8}
    y = {**common, "domain": [where.bottom, where.top], "anchor": where.axes["xaxis"]} | _scale(*each.errors)
    y["title"] = {"text": f"{safe_lines(each.measure.description, 44)}{unit}", "standoff": 8}
    if not each.has_scale:
        y |= {"showticklabels": False, "ticks": "", "minor": {"ticks": ""}, "showgrid": False}
    found = {f"xaxis{_suffix(where.number)}": x, f"yaxis{_suffix(where.number)}": y}
    if has_strip:
        missing = sum(isnan(spot.cost) for spots in each.spots for spot in spots)
        number = _suffix(where.count + where.number)
        hidden = {"visible": False, "fixedrange": True}
        found[f"xaxis{number}"] = {
            **hidden,
            "domain": [0.09, _WIDE],
            "anchor": f"y{number}",
            "range": [-0.7, max(missing - 0.3, 24.0)],
        }
        found[f"yaxis{number}"] = {**hidden, "domain": list(where.strip), "anchor": f"x{number}", "range": [-1, 1]}
    return found


def _scale(low: float, high: float) -> dict[str, Any]:
    decades = log10(high / low)
    return {"range": [log10(low), log10(high)], "dtick": "D2" if decades < 1.8 else max(round(decades / 6), 1)}


def _view_of(panels: Sequence[Panel], places: Sequence[_Places]) -> dict[str, Any]:
    """What a button changes in the axes."""
    changes: dict[str, Any] = {}
    for each, where in zip(panels, places, strict=True):
        axis = f"xaxis{_suffix(where.number)}"
        changes[f"{axis}.title.text"] = each.view.label
        changes |= {f"{axis}.{key}": value for key, value in _scale(*each.costs).items()}
    return changes


def _legend_at(where: _Places) -> dict[str, Any]:
    return {"x": _LEGEND, "y": where.top, "xanchor": "left", "yanchor": "top", "groupclick": "togglegroup"}


def _uncertainty(each: Panel, where: _Places) -> list[dict[str, Any]]:
    """Shaded up to the uncertainty of the reference, where it is known."""
    if each.uncertainty is None:
        return []
    low, high = each.errors
    text = f"uncertainty of the reference:<br>{safe(uncertainty_text(each))}"
    return [
        {
            "type": "rect",
            "xref": f"{where.axes['xaxis']} domain",
            "yref": where.axes["yaxis"],
            "x0": 0,
            "x1": 1,
            "y0": low,
            "y1": min(max(each.uncertainty, low), high),
            "fillcolor": "#b8b8b8",
            "opacity": 0.4,
            "line": {"width": 0},
            "layer": "below",
            "name": text,
            "showlegend": True,
            "legend": where.legend,
        }
    ]
