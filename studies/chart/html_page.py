"""A chart as a page in one file, which works without a network: panels to hover over, and a table of all points."""

from pathlib import Path

from ...orchestrator.results.whole import write_whole
from ..pictures.document import cell, document, embedded, table
from ..pictures.markup import NOTHING, safe
from ..pictures.provenance import machine_text, note_texts, versions_text
from ..point import value_text
from .caption import cost_text, reference_text
from .chart import Chart, ChartLine, Row
from .plot import plot
from .telling import error_text, processor_text, solves_text, wall_text

_STYLE = ".front { font-weight: bold }\n"


def write_page(chart: Chart, folder: Path, stem: str = "chart") -> Path:
    """Write `chart.html` into `folder`, or the same called after `stem`; returns the file."""
    path = folder / f"{stem}.html"
    write_whole(path, page(chart).encode())
    return path


def page(chart: Chart) -> str:
    """The whole page."""
    sentences = [reference_text(chart), cost_text(chart), machine_text(chart.machine), versions_text(chart.versions)]
    sentences += note_texts(chart.notes)
    about = "\n".join(f"<li>{safe(text)}</li>" for text in sentences if text)
    body = f"""<p>Every point is a run of the scenario <code>{safe(Path(chart.scenario).name)}</code> with other
settings. Lower is more accurate, farther left is cheaper. Full markers are on the front: no other point is both cheaper
and as accurate. Hollow markers are dominated by another point. The order is the observed order of accuracy: the error
grows as this power of the varied number. Arrows at an edge mark errors that are infinite or exactly zero; a cross marks
a point without a result. Hover over a point to see its data; click a name to hide a line.</p>
<ul>
{about}
</ul>
{embedded(plot(chart), "chart")}
<h2>All points</h2>
{_table(chart)}
<p>Errors in bold are on the front of their measure.</p>"""
    return document(f"{chart.name}: error against cost", body, _STYLE)


def _table(chart: Chart) -> str:
    units = [f"error in {measure.name}" for measure in chart.measures]
    names = ["line", *chart.varied, "status", *units, "wall clock", "processor", "solves", "sweeps", "reason"]
    return table(names, [_row(chart, line, row) for line in chart.lines for row in line.rows])


def _row(chart: Chart, line: ChartLine, row: Row) -> str:
    cells = [cell(safe(line.name))]
    cells += [cell(safe(value_text(row.settings[key])) if key in row.settings else NOTHING) for key in chart.varied]
    cells.append(cell(safe(row.status)))
    for measure in chart.measures:
        cells.append(cell(error_text(row, measure), "number front" if measure.name in row.front else "number"))
    sweeps = NOTHING if row.trial is None or not row.is_done else str(row.trial.sweeps)
    cells += [cell(wall_text(row)), cell(processor_text(row)), cell(solves_text(row)), cell(sweeps, "number")]
    cells.append(cell(safe(row.reason)))
    return "".join(cells)
