"""A map in its folder: tables, and, where they are drawn, figures and a page."""

from pathlib import Path

from .map import StabilityMap
from .map_tables import write_tables


def write_map(stability: StabilityMap, folder: Path) -> None:
    """Write stability.csv and stability.json to `folder`."""
    write_tables(stability, folder)
