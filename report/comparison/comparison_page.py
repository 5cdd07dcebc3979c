"""comparison.html: runs beside one another in one file, which works without a network."""

from base64 import b64encode
from math import isfinite, isnan
from pathlib import Path

from ...orchestrator.results.whole import write_whole
from ...studies.pictures.document import cell, document, embedded, table
from ...studies.pictures.markup import NOTHING, safe
from ...studies.point import value_text
from .compared import Compared
from .curves import compared_columns, curves
from .differences import Differences, Row
from .side_by_side import side_by_side

COMPARISON_HTML = "comparison.html"

STYLE = "img { max-width: 100%; height: auto } figure { margin: 1em 0 }\n"


def write_page(compared: Compared, found: Differences, folder: Path, title: str) -> Path:
    """Write comparison.html into `folder`; returns the file."""
    path = folder / COMPARISON_HTML
    write_whole(path, document(title, body(compared, found), STYLE).encode())
    return path


def body(compared: Compared, found: Differences) -> str:
    """Settings, headline numbers, differences, curves and bodies, as HTML."""
    notes = "".join(f"<p><strong>{safe(note)}</strong></p>\n" for note in compared.notes)
    parts = [
        f"<p>All runs are compared with <code>{safe(compared.reference)}</code>.</p>\n{notes}",
        _settings(compared),
    ]
    if found.headlines:
        parts.append(f"<h2>Numbers of each run</h2>\n{_headlines(compared, found.headlines)}")
    if found.measured:
        parts.append(f"<h2>Largest differences over the whole run</h2>\n{_measures(found.measured)}")
    picture = side_by_side(compared)
    if picture is not None:
        image = b64encode(picture).decode()
        parts.append(
            '<h2>Side by side</h2>\n<figure><img alt="The transmembrane potential of the runs at the same times" '
            f'src="data:image/png;base64,{image}"></figure>'
        )
    figure = curves(compared)
    if figure is not None:
        parts.append(
            f"<h2>Curves</h2>\n<p>The {len(compared_columns(compared))} columns of the time series that change. Hover "
            f"over a curve to read its values; click a name to hide a run.</p>\n{embedded(figure, 'curves')}"
        )
    return "\n".join(parts)


def _settings(compared: Compared) -> str:
    if not compared.settings:
        return "<p>The scenarios of all runs are the same.</p>"
    rows = []
    for key, values in compared.settings.items():
        told = [NOTHING if value is None else safe(value_text(value)) for value in values]
        rows.append("".join(cell(text) for text in (f"<code>{safe(key)}</code>", *told)))
    return f"<h2>Settings that differ</h2>\n{table(['key', *compared.runs], rows)}"


def _headlines(compared: Compared, rows: list[Row]) -> str:
    """A row per number: the reference's value, then each run's with its difference."""
    others = list(compared.others)
    by_name: dict[str, list[Row]] = {}
    for row in rows:
        by_name.setdefault(row.quantity, []).append(row)
    lines = []
    for found in by_name.values():
        first = found[0]
        line = cell(safe(f"{first.description} ({first.unit or '1'})")) + cell(_number(first.reference), "number")
        for row in found:
            line += cell(_number(row.value), "number") + cell(_signed(row.difference), "number")
        lines.append(line)
    head = ["number", compared.reference]
    for name in others:
        head += [name, "difference"]
    return table(head, lines)


def _measures(rows: list[Row]) -> str:
    lines = []
    for row in rows:
        when = NOTHING if row.time_ms is None else f"{row.time_ms:g}"
        size = NOTHING if isnan(row.difference) else ("∞" if not isfinite(row.difference) else f"{row.difference:.3g}")
        line = cell(safe(row.description)) + cell(safe(row.run)) + cell(size, "number") + cell(row.unit or "1")
        lines.append(line + cell(when, "number") + cell(safe(row.why)))
    return table(["quantity", "run", "difference", "unit of measure", "at time (ms)", "remark"], lines)


def _number(value: float | None) -> str:
    return NOTHING if value is None else f"{value:.4g}"


def _signed(value: float) -> str:
    return NOTHING if isnan(value) else f"{value:+.3g}"
