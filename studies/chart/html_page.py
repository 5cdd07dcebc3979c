"""A chart as a page in one file, which works without a network: panels to hover over, and a table of all points."""

from pathlib import Path

from plotly.io import to_html

from ...orchestrator.results.whole import write_whole
from ..point import value_text
from .caption import cost_text, machine_text, note_texts, reference_text, versions_text
from .chart import Chart, ChartLine, Row
from .plot import plot
from .telling import NOTHING, error_text, processor_text, safe, solves_text, wall_text

#: The browser is to load nothing, whatever names and reasons in a chart say.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"

_STYLE = """
body { font-family: sans-serif; color: #222; margin: 1.5em auto; max-width: 80em; padding: 0 1em; line-height: 1.4 }
table { border-collapse: collapse; font-size: 0.85em }
th, td { border: 1px solid #ccc; padding: 0.25em 0.5em; text-align: left; vertical-align: top }
td:first-child { min-width: 11em }
td.number { text-align: right; white-space: nowrap }
th { background: #f2f2f2; position: sticky; top: 0 }
.front { font-weight: bold }
.wide { overflow-x: auto }
"""


def write_page(chart: Chart, folder: Path, stem: str = "chart") -> Path:
    """Write `chart.html` into `folder`, or the same called after `stem`; returns the file."""
    path = folder / f"{stem}.html"
    write_whole(path, page(chart).encode())
    return path


def page(chart: Chart) -> str:
    """The whole page."""
    config: dict[str, object] = {"displaylogo": False, "responsive": True, "doubleClick": "reset"}
    config["modeBarButtons"] = [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]]
    figure = to_html(plot(chart), config, include_plotlyjs=True, full_html=False, div_id="chart", default_height="auto")
    sentences = [reference_text(chart), cost_text(chart), machine_text(chart), versions_text(chart), *note_texts(chart)]
    about = "\n".join(f"<li>{safe(text)}</li>" for text in sentences if text)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{safe(chart.name)}: error against cost</title>
<style>{_STYLE}</style>
</head>
<body>
<h1>{safe(chart.name)}: error against cost</h1>
<p>Every point is a run of the scenario <code>{safe(Path(chart.scenario).name)}</code> with other settings. Lower is
more accurate, farther left is cheaper. Full markers are on the front, for no point is both cheaper and as accurate;
hollow ones are dominated. The order is the observed order of accuracy: the power of the varied number by which the
error grows. Arrows at an edge are errors that are infinite or exactly zero; a cross is a point without a result.
Hover over a point for all that is known of it; click a name to hide a line.</p>
<ul>
{about}
</ul>
{figure}
<h2>All points</h2>
<div class="wide">
{_table(chart)}
</div>
</body>
</html>
"""


def _table(chart: Chart) -> str:
    units = [f"error in {measure.name}" for measure in chart.measures]
    names = ["line", *chart.varied, "status", *units, "wall clock", "processor", "solves", "sweeps", "reason"]
    head = "".join(f"<th>{safe(name)}</th>" for name in names)
    rows = "\n".join(_row(chart, line, row) for line in chart.lines for row in line.rows)
    return f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody>\n</table>\n<p>Bold: on the front.</p>"


def _row(chart: Chart, line: ChartLine, row: Row) -> str:
    cells = [_cell(safe(line.name))]
    cells += [_cell(safe(value_text(row.settings[key])) if key in row.settings else NOTHING) for key in chart.varied]
    cells.append(_cell(safe(row.status)))
    for measure in chart.measures:
        cells.append(_cell(error_text(row, measure), "number front" if measure.name in row.front else "number"))
    sweeps = NOTHING if row.trial is None or not row.is_done else str(row.trial.sweeps)
    cells += [_cell(wall_text(row)), _cell(processor_text(row)), _cell(solves_text(row)), _cell(sweeps, "number")]
    cells.append(_cell(safe(row.reason)))
    return f"<tr>{''.join(cells)}</tr>"


def _cell(content: str, kind: str = "") -> str:
    return f'<td class="{kind}">{content}</td>' if kind else f"<td>{content}</td>"
