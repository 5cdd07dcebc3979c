"""What the page says of a cell or a crossing, as HTML that Plotly shows too: all that is known of it."""

from ..pictures.markup import NOTHING, safe, safe_lines
from ..point import value_text
from .caption import error_text
from .map import Cell, Crossing, Panel

#: Letters in a line, so that it fits on a telephone.
LETTERS = 44


def hover_text(panel: Panel, cell: Cell) -> str:
    """All of a cell."""
    said = [*_setting(panel.x_key, cell.x), *_setting(panel.y_key, cell.y), f"<b>{safe(cell.kind)}</b>"]
    if cell.reason:
        said.append(safe_lines(cell.reason, LETTERS))
    said.append(f"measured growth: {growth_text(cell.measure)}")
    said.append(f"predicted growth: {growth_text(cell.predicted)}")
    said += [safe_lines(f"error in {name}: {error_text(name, error)}", LETTERS) for name, error in cell.errors.items()]
    said.append(f"wall clock: {wall_text(cell)}")
    if cell.bisected:
        said.append("run of the bisection")
    return "<br>".join(said)


def crossing_text(panel: Panel, crossing: Crossing) -> str:
    """Where a boundary was measured."""
    said = [
        *_setting(panel.x_key, crossing.x),
        "<b>measured boundary</b>",
        *wrapped(f"{panel.y_key} between {crossing.low:.5g} and {crossing.high:.5g}"),
    ]
    if crossing.predicted is not None:
        said.append(f"predicted: {crossing.predicted:.5g}")
        if crossing.predicted != 0.0:
            said.append(f"difference: {100.0 * (crossing.measured / crossing.predicted - 1.0):+.2g} %")
    return "<br>".join(said)


def growth_text(factor: float | None) -> str:
    """By how much disturbances grow from one exchange to the next."""
    if factor is None:
        return NOTHING
    # How far it is from 1 is what counts, however close it is.
    return f"{factor:.4g}" if abs(factor - 1.0) > 1e-3 else f"{factor:.10g}"


def wall_text(cell: Cell) -> str:
    """Seconds of the wall clock."""
    return NOTHING if cell.trial is None or not cell.trial.costs else f"{cell.trial.wall_s:.3g} s"


def wrapped(text: str) -> list[str]:
    """The same as its letters, in lines that fit on a telephone."""
    return [safe_lines(text, LETTERS)]


# --- inside -----------------------------------------------------------------------------------------------------------


def _setting(key: str, value: object) -> list[str]:
    return wrapped(f"{key} = {value_text(value)}")
