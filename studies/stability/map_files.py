"""A map in its folder: tables, figures and a page."""

from pathlib import Path

from .figure import write_figures
from .map import StabilityMap
from .map_tables import write_tables
from .page import write_page


def write_map(stability: StabilityMap, folder: Path) -> None:
    """Write stability.csv, stability.json, stability.png, stability.svg and stability.html to `folder`."""
    write_tables(stability, folder)
    write_figures(stability, folder)
    write_page(stability, folder)
