"""What a run has written, as tests read it."""

import csv
from pathlib import Path


def rows(folder: Path) -> list[dict[str, str]]:
    """The rows of the time series in a results folder, every cell as it stands there."""
    with (folder / "timeseries.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
