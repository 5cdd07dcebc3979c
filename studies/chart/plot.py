"""A chart as Plotly draws it: a panel for each measure, buttons for the view, and all of a point on hover."""

from collections.abc import Sequence
from math import isnan, log10
from typing import Any

from plotly.graph_objects import Figure

from ..pictures.markup import safe, safe_lines
from .caption import limit_text, uncertainty_text
from .chart import Chart
from .panel import Panel, panel, views
from .panel_places import FOOT_PX, HEAD_PX, Places, places_of, suffix
from .traces import panel_traces, strip_traces

#: The part of the width that panels have, and where their legends begin.
_WIDE, _LEGEND = 0.74, 0.76

_INK, _GRID = "#222222", "#e6e6e6"


def plot(chart: Chart) -> Figure:
    """The chart; the height is set, the width is that of the page."""
    kinds = views(chart)
    panels = [[panel(chart, measure, view) for view in kinds] for measure in chart.measures]
    places, height = places_of(chart)
    traces: list[dict[str, Any]] = []
    shown: list[tuple[bool, bool]] = []
    shapes, annotations = [], []
    layout: dict[str, Any] = {}
    for where, pair in zip(places, panels, strict=True):
        for number, each in enumerate(pair):
            found = panel_traces(chart, each, where)
            traces += found
            shown += [(number == 0, number == 1)] * len(found)
        strip = strip_traces(chart, pair[0], where)
        traces += strip
        shown += [(True, True)] * len(strip)
        layout |= _axes(pair[0], where, bool(strip))
        layout[where.legend] = _legend_at(where)
        shapes += [*_uncertainty(pair[0], where), *_limit(pair[0], where)]
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
        "margin": {"l": 84, "r": 10, "t": HEAD_PX, "b": FOOT_PX},
        "font": {"family": "sans-serif", "size": 13, "color": _INK},
        "hovermode": "closest",
        "hoverlabel": {"align": "left", "bgcolor": "white", "font": {"color": _INK}},
        "updatemenus": [menu],
        "shapes": shapes,
        "annotations": annotations,
    }
    return Figure(data=traces, layout=layout)


# --- inside -----------------------------------------------------------------------------------------------------------


def _strip_words(where: Places) -> dict[str, Any]:
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


def _axes(each: Panel, where: Places, has_strip: bool) -> dict[str, Any]:
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
    found = {f"xaxis{suffix(where.number)}": x, f"yaxis{suffix(where.number)}": y}
    if has_strip:
        missing = sum(isnan(spot.cost) for spots in each.spots for spot in spots)
        number = suffix(where.count + where.number)
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
    first, last = log10(low), log10(high)
    decades = last - first
    return {"range": [first, last], "dtick": "D2" if decades < 1.8 else max(round(decades / 6), 1)}


def _view_of(panels: Sequence[Panel], places: Sequence[Places]) -> dict[str, Any]:
    """What a button changes in the axes."""
    changes: dict[str, Any] = {}
    for each, where in zip(panels, places, strict=True):
        axis = f"xaxis{suffix(where.number)}"
        changes[f"{axis}.title.text"] = each.view.label
        changes |= {f"{axis}.{key}": value for key, value in _scale(*each.costs).items()}
    return changes


def _legend_at(where: Places) -> dict[str, Any]:
    return {
        "x": _LEGEND,
        "y": where.top,
        "xanchor": "left",
        "yanchor": "top",
        "maxheight": where.legend_px,
        "groupclick": "togglegroup",
    }


def _uncertainty(each: Panel, where: Places) -> list[dict[str, Any]]:
    """Shaded up to the uncertainty of the reference, where it is known."""
    if each.uncertainty is None:
        return []
    low, high = each.errors
    text = f"uncertainty of the reference:<br>{safe(uncertainty_text(each))}"
    look = {"type": "rect", "fillcolor": "#b8b8b8", "opacity": 0.4, "line": {"width": 0}}
    return [look | _across(where, low, min(max(each.uncertainty, low), high), text)]


def _limit(each: Panel, where: Places) -> list[dict[str, Any]]:
    """A line at the tolerance, where there is one on these axes."""
    if each.limit is None or not each.errors[0] < each.limit < each.errors[1]:
        return []
    look = {"type": "line", "line": {"color": _INK, "width": 1, "dash": "dash"}}
    return [look | _across(where, each.limit, each.limit, safe(limit_text(each)))]


def _across(where: Places, low: float, high: float, name: str) -> dict[str, Any]:
    """A shape over the whole width of a panel, between two errors, with an entry in the legend."""
    return {
        "xref": f"{where.axes['xaxis']} domain",
        "yref": where.axes["yaxis"],
        "x0": 0,
        "x1": 1,
        "y0": low,
        "y1": high,
        "layer": "below",
        "name": name,
        "showlegend": True,
        "legend": where.legend,
    }
