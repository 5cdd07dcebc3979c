"""A chart in its folder: tables, figures and a page."""

from pathlib import Path

from .figure import write_figures
from .model import Chart
from .page import write_page
from .table import write_tables


def write_chart(chart: Chart, folder: Path) -> None:
    """Write chart.csv, chart.json, chart.png, chart.svg and chart.html to `folder`."""
    write_tables(chart, folder)
    write_figures(chart, folder)
    write_page(chart, folder)
