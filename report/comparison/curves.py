"""The curves of several runs over one another, a panel for each column of the time series, for Plotly."""

import numpy as np
from plotly.graph_objects import Figure
from plotly.subplots import make_subplots

from ...orchestrator.results.comparison import spoken, unit_of
from ...studies.pictures.colors import COLORS
from ...studies.pictures.markup import safe
from .compared import Compared

#: Columns that are drawn; a run of foreign FMUs may have thousands.
_MOST = 24

_DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")

_PANEL_PX, _KEY_PX = 300, 90


def compared_columns(compared: Compared) -> list[str]:
    """The columns that change in any run, at most so many as can be drawn."""
    found: dict[str, None] = {}
    for run in compared.runs.values():
        for name, values in run.columns.items():
            known = values[np.isfinite(values)]
            if name != "time_ms" and len(known) and np.ptp(known) > 0.0:
                found[name] = None
    return list(found)[:_MOST]


def curves(compared: Compared) -> Figure | None:
    """A panel per column, a curve per run, in colours and dashes of its own; None where nothing changes."""
    columns = compared_columns(compared)
    if not columns:
        return None
    figure = make_subplots(rows=len(columns), cols=1, shared_xaxes=True, vertical_spacing=0.25 / len(columns) ** 1.2)
    for number, (name, run) in enumerate(compared.runs.items()):
        line = {"color": COLORS[number % len(COLORS)], "dash": _DASHES[number % len(_DASHES)], "width": 2}
        shown = False
        for row, column in enumerate(columns, start=1):
            values = run.columns.get(column)
            if values is None:
                continue
            known = np.isfinite(values)
            trace = {
                "type": "scatter",
                "mode": "lines" if known.sum() > 1 else "markers",
                "x": run.columns["time_ms"][known].tolist(),
                "y": values[known].tolist(),
                "name": safe(name),
                "legendgroup": str(number),
                "showlegend": not shown,
                "line": line,
            }
            figure.add_trace(trace, row=row, col=1)
            shown = True
    for row, column in enumerate(columns, start=1):
        unit = unit_of(column)
        figure.update_yaxes(title_text=f"{safe(spoken(column))}<br>({unit or '1'})", row=row, col=1)
    figure.update_xaxes(showticklabels=True)
    figure.update_xaxes(title_text="time (ms)", row=len(columns), col=1)
    figure.update_layout(
        template="plotly_white",
        height=_PANEL_PX * len(columns) + _KEY_PX,
        margin={"l": 70, "r": 15, "t": 50, "b": 50},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0},
        hovermode="x",
    )
    return figure
