"""A chart in its folder: tables, figures and a page."""

from pathlib import Path

from .chart import Chart
from .chart_tables import write_tables
from .figure import write_figures
from .html_page import write_page


def write_chart(chart: Chart, folder: Path, stem: str = "chart") -> None:
    """Write chart.csv, chart.json, chart.png, chart.svg and chart.html to `folder`, or the same called after `stem`.

    What was considered and not run stands in the tables, and is not drawn.
    """
    write_tables(chart, folder, stem)
    write_figures(chart.tried, folder, stem)
    write_page(chart.tried, folder, stem)
