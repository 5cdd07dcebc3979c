"""What a search leaves in its folder: the tuned scenario, and the evidence."""

import textwrap
from contextlib import suppress
from pathlib import Path

from ...orchestrator.results.whole import write_whole
from ...orchestrator.scenario import rewritten
from ..chart import write_chart
from ..machine import machine
from ..point import value_text
from .report import compared_costs, errors_told, kept
from .result import Tuning

#: Columns of a comment.
_WIDTH = 118


def write_tuning(tuning: Tuning, folder: Path) -> Path | None:
    """Write tune.csv, tune.json and the chart to `folder`, and the tuned scenario, whose path is returned.

    Where nothing keeps the tolerances there is none, nor one that an earlier search has left.
    """
    write_chart(tuning.chart, folder, "tune")
    path = folder / f"{tuning.task.scenario.name}.tuned.yaml"
    if tuning.best is None:
        with suppress(FileNotFoundError):
            path.unlink()
        return None
    settings = {**tuning.settings(tuning.best), "name": f"{tuning.task.scenario.name}.tuned"}
    text = rewritten(tuning.task.file, settings, folder)
    write_whole(path, f"{_comment(tuning, tuning.best)}{text}".encode())
    return path


def _comment(tuning: Tuning, best: int) -> str:
    here = machine()
    where = f"{here['processor']}, {here['cores']} cores, {here['system']}, Python {here['python']}"
    common = ", ".join(f"{key}={value_text(value)}" for key, value in tuning.task.common.items())
    sentences = [
        f"Tuned from {tuning.task.file.name}: the cheapest setting found that keeps {kept(tuning)}.",
        f"Errors: {errors_told(tuning, tuning.rows[best])}, against the reference {tuning.chart.references[0]}.",
        f"Cost: {compared_costs(tuning, best)}, measured on {where}.",
        *([f"With {common}, like all settings with which it was compared."] if common else []),
        "All settings that were considered are in tune.csv.",
    ]
    lines = [line for sentence in sentences for line in textwrap.wrap(sentence, _WIDTH, break_on_hyphens=False)]
    return "".join(f"# {line}\n" for line in lines)
