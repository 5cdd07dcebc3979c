"""A map in numbers: how many cells of each class, and how far the measured boundary is from the predicted one."""

from collections import Counter
from collections.abc import Sequence

from ..point import value_text
from .map import KINDS, Cell, Crossing, Panel, StabilityMap


def counted(cells: Sequence[Cell]) -> dict[str, int]:
    """The number of cells of each class that there is, the soundest first."""
    counts = Counter(cell.kind for cell in cells)
    return {kind: counts[kind] for kind in KINDS if counts[kind]}


def apart(crossing: Crossing) -> float | None:
    """How far a measured crossing is from the predicted one, relative to that; None where nothing is predicted."""
    if not crossing.predicted:
        return None
    return (crossing.measured - crossing.predicted) / abs(crossing.predicted)


def summary(stability: StabilityMap) -> str:
    """For a terminal: a line for each panel."""
    return "\n".join(_line(panel) for panel in stability.panels)


def _line(panel: Panel) -> str:
    counts = ", ".join(f"{count} {kind}" for kind, count in counted(panel.cells).items())
    text = f"{panel.name}: {counts}"
    if panel.crossings:
        text += f"; limit of {panel.y_key} at {panel.x_key} = {', '.join(map(_crossing, panel.crossings))}"
    return text


def _crossing(crossing: Crossing) -> str:
    half = 0.5 * (crossing.high - crossing.low)
    text = f"{value_text(crossing.x)}: {crossing.measured:.4g} ± {half:.1g}"
    distance = apart(crossing)
    return text if distance is None else f"{text} (predicted {crossing.predicted:.4g}, {distance:+.1%})"
