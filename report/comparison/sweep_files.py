"""A sweep in its folder: sweep.csv with a row per run, and sweep.html, which shows the runs over one another."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from ...orchestrator.results.comparison import headlines, spoken, unit_of
from ...orchestrator.results.whole import write_whole
from ...studies.pictures.document import cell, document, table
from ...studies.pictures.markup import NOTHING, safe
from ...studies.point import value_text
from ...studies.sweep import Swept
from .compared import Compared
from .comparison_page import STYLE, body
from .differences import differences

SWEEP_CSV, SWEEP_HTML = "sweep.csv", "sweep.html"

#: Runs that can be told apart in one picture; the table has them all.
_MOST_SHOWN = 12


def write_sweep(swept: Sequence[Swept], folder: Path, name: str) -> tuple[Path, Path]:
    """Write the table and the page of the sweep of the scenario `name` into `folder`; returns both files."""
    numbers = _numbers(swept)
    write_whole(folder / SWEEP_CSV, _csv(swept, numbers).encode())
    write_whole(folder / SWEEP_HTML, _page(swept, numbers, f"{name}: {len(swept)} variants").encode())
    return folder / SWEEP_CSV, folder / SWEEP_HTML


# --- inside -----------------------------------------------------------------------------------------------------------


def _numbers(swept: Sequence[Swept]) -> list[dict[str, float]]:
    return [headlines(each.trial.run) if each.trial is not None and each.trial.is_done else {} for each in swept]


def _csv(swept: Sequence[Swept], numbers: Sequence[Mapping[str, float]]) -> str:
    """Settings, how it went, headline numbers, cost, and the folder with the whole results."""
    keys, names = list(swept[0].settings), list(dict.fromkeys(name for each in numbers for name in each))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*keys, "status", *names, "wall_s", "sweeps", "folder", "reason"])
    for each, found in zip(swept, numbers, strict=True):
        trial = each.trial
        done = trial is not None and trial.is_done
        costs = [f"{trial.wall_s:.4g}", trial.sweeps] if trial is not None and done else ["", ""]
        row = [value_text(each.settings[key]) for key in keys] + [each.status]
        row += [repr(found[name]) if name in found else "" for name in names]
        place = "" if trial is None else f"points/{trial.folder.name}"
        writer.writerow([*row, *costs, place, each.reason or ("" if trial is None else trial.reason)])
    return text.getvalue()


def _page(swept: Sequence[Swept], numbers: Sequence[Mapping[str, float]], title: str) -> str:
    done = {each.name: each.trial.run for each in swept if each.trial is not None and each.trial.is_done}
    shown = dict(list(done.items())[:_MOST_SHOWN])
    parts = [f"<h2>All runs</h2>\n{_table(swept, numbers)}"]
    if len(done) > len(shown):
        parts.append(f"<p>The first {len(shown)} of the {len(done)} complete runs are shown below.</p>")
    if len(shown) > 1:
        compared = Compared(shown)
        parts.append(body(compared, differences(compared)))
    return document(title, "\n".join(parts), STYLE)


def _table(swept: Sequence[Swept], numbers: Sequence[Mapping[str, float]]) -> str:
    names = list(dict.fromkeys(name for each in numbers for name in each))
    lines = []
    for each, found in zip(swept, numbers, strict=True):
        trial = each.trial
        line = "".join(cell(safe(value_text(value))) for value in each.settings.values()) + cell(each.status)
        line += "".join(cell(f"{found[name]:.4g}" if name in found else NOTHING, "number") for name in names)
        wall = f"{trial.wall_s:.3g}" if trial is not None and trial.is_done else NOTHING
        lines.append(line + cell(wall, "number") + cell(safe(each.reason or ("" if trial is None else trial.reason))))
    heads = [f"{spoken(name)} ({unit_of(name) or '1'})" for name in names]
    return table([*swept[0].settings, "status", *heads, "wall clock (s)", "reason"], lines)
