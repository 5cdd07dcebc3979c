"""What is said around the pictures of a chart: where its numbers are from."""

from math import isinf

from .chart import WALL, Chart
from .panel import Panel

_COSTS = {
    True: "Seconds are wall-clock seconds; each point ran alone on its core.",
    False: "Seconds are CPU seconds, because several points ran at the same time.",
}


def reference_text(chart: Chart) -> str:
    """A sentence on what the points are compared with."""
    first, *others = chart.references or ("",)
    text = f"Errors are differences from the reference ({first})."
    for other in others:
        text += f" Its own uncertainty is its difference from a second reference ({other})."
    return text


def uncertainty_text(panel: Panel) -> str:
    """The uncertainty of the reference in the unit of the panel's measure."""
    value = panel.uncertainty
    if value is None:
        return "unknown"
    if isinf(value):
        return "infinite"
    text = f"{value:.2g} {panel.measure.unit}".rstrip()
    return f"{text}, below these axes" if value <= panel.errors[0] else text


def limit_text(panel: Panel) -> str:
    """The largest error that is allowed, in the unit of the panel's measure; empty where none is given."""
    return "" if panel.limit is None else f"tolerance: {panel.limit:g} {panel.measure.unit}".rstrip()


def cost_text(chart: Chart) -> str:
    """A sentence on what the points' cost is."""
    return _COSTS[chart.cost == WALL]
