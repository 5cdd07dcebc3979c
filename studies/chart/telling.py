"""What the page says of a point, as HTML that Plotly shows too: all that is known of it."""

from collections.abc import Mapping
from math import isinf, isnan, nan

from ...orchestrator.results.comparison import Measure
from ..pictures.markup import NOTHING, safe, safe_lines
from ..point import value_text
from .chart import ChartLine, Row


def error_text(row: Row, measure: Measure) -> str:
    """The error in its unit of measure."""
    error = row.errors.get(measure.name, nan)
    if isnan(error):
        return NOTHING
    return f"{'infinite' if isinf(error) else f'{error:.3g}'} {safe(measure.unit)}".rstrip()


def wall_text(row: Row) -> str:
    """Seconds of the wall clock, and how far repeated runs are apart."""
    if row.trial is None or not row.is_done:
        return NOTHING
    text, runs = f"{row.trial.wall_s:.3g} s", len(row.trial.costs)
    return text if runs == 1 else f"{text} (median of {runs} runs, spread {row.trial.wall_spread_s:.2g} s)"


def processor_text(row: Row) -> str:
    """Seconds of the processor, by unit too."""
    if row.trial is None or not row.is_done:
        return NOTHING
    trial = row.trial
    units = [unit for unit in trial.solves if all(unit in cost.cpu_s_units for cost in trial.costs)]
    return f"{trial.cpu_s:.3g} s{_parts({unit: f'{trial.unit_cpu_s(unit):.3g} s' for unit in units})}"


def solves_text(row: Row) -> str:
    """How often units made a step, by unit too."""
    if row.trial is None or not row.is_done:
        return NOTHING
    return f"{row.solves}{_parts({unit: str(count) for unit, count in row.trial.solves.items()})}"


def hover_text(line: ChartLine, row: Row, measure: Measure, is_on_front: bool) -> str:
    """All of a point, as it is shown in the panel of a measure, on whose front it is or is not."""
    said = [f"<b>{safe(line.name)}</b>", *_settings(row.settings), f"status: {safe(row.status)}"]
    if row.reason:
        said.append(safe_lines(row.reason))
    if row.trial is not None and row.is_done:
        said += [
            f"error: {error_text(row, measure)}",
            f"wall clock: {wall_text(row)}",
            f"processor: {processor_text(row)}",
            f"solves: {solves_text(row)}",
            f"sweeps: {row.trial.sweeps}",
            "on the front" if is_on_front else "not on the front",
        ]
    return "<br>".join(said)


def _settings(settings: Mapping[str, object]) -> list[str]:
    return [f"{safe(key)} = {safe(value_text(value))}" for key, value in settings.items()]


def _parts(parts: Mapping[str, str]) -> str:
    return f" ({', '.join(f'{safe(name)} {text}' for name, text in parts.items())})" if parts else ""
