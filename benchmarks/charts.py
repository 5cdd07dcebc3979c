"""The charts of scenarios/studies in the documentation; all of them take a quarter of an hour.

For each study, the points that are missing in results/<name> are run, the figure is copied to docs/images/charts, and
the tables of the pages are written. Use a machine that does nothing else. `python -m benchmarks.charts NAME` does this
for one study.
"""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from shutil import copyfile

from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.chart import Chart, Row, chart_study, write_chart
from cardiac_cosim.studies.plan import plan_study
from cardiac_cosim.studies.point import told
from rich.console import Console

from .page import write_between

_ROOT = Path(__file__).parent.parent
_STUDIES = _ROOT / "scenarios" / "studies"
_PAGE, _COUPLING = _ROOT / "docs" / "charts.md", _ROOT / "docs" / "coupling.md"
_IMAGES = _ROOT / "docs" / "images" / "charts"


def chart(name: str) -> Chart:
    """Chart the study of that name, and copy its figure into the documentation."""
    plan = plan_study(_STUDIES / f"{name}.yaml")
    folder = _ROOT / "results" / plan.study.name
    with Bench(folder, Console()) as bench:
        found = chart_study(plan, bench)
    write_chart(found, folder)
    _IMAGES.mkdir(exist_ok=True)
    copyfile(folder / "chart.png", _IMAGES / f"{name}.png")
    return found


def front(found: Chart) -> str:
    """The table of all points that are on the front of at least one measure, the cheapest first."""
    names = [measure.name for measure in found.measures]
    rows = [f"| settings | seconds | sweeps | {' | '.join(names)} |", "|---" * (3 + len(names)) + "|"]
    on = [(line.name, row) for line in found.lines for row in line.rows if row.front]
    for name, row in sorted(on, key=lambda pair: pair[1].cost(found.cost)):
        cells = [f"**{row.errors[each]:.3g}**" if each in row.front else _error(row, each) for each in names]
        assert row.trial is not None
        what = f"{name}, {told(row.settings)}" if row.settings else name
        rows.append(f"| {what} | {row.cost(found.cost):.2f} | {row.trial.sweeps} | {' | '.join(cells)} |")
    rows += [f"| *uncertainty of the reference* | | | {' | '.join(_uncertainty(found, each) for each in names)} |"]
    return "\n".join(rows)


def _error(row: Row, name: str) -> str:
    return f"{row.errors[name]:.3g}" if name in row.errors else ""


def _uncertainty(found: Chart, name: str) -> str:
    return f"{found.uncertainty[name]:.2g}" if name in found.uncertainty else ""


def coupling(found: Chart) -> str:
    """The table of the cost and the errors of every coupling that was run to its end."""
    rows = [
        "| coupling | sweeps | seconds | largest error, LV volume | largest error, activation | on a front |",
        "|---" * 6 + "|",
    ]
    for line in found.lines:
        for row in line.rows:
            if row.trial is None or not row.is_done:
                continue
            cells = [f"{line.name}, {_setting(row)}", str(row.trial.sweeps), f"{row.cost(found.cost):.2f}"]
            cells += [f"{row.errors['lv_volume_ml']:.3f} ml", f"{row.errors['activation_ms']:.2f} ms"]
            rows.append(f"| {' | '.join([*cells, 'yes' if row.front else ''])} |")
    return "\n".join(rows)


def _setting(row: Row) -> str:
    ((key, value),) = row.settings.items()
    return f"{value:g} ms" if key.endswith("_ms") else f"{key.rpartition('.')[2]} {value:g}"


#: Tables of studies other than that of the front: the page, the marker on it, and the function that makes the table.
_TABLES: dict[str, tuple[Path, str, Callable[[Chart], str]]] = {"heartbeat": (_COUPLING, "coupling", coupling)}


def _studies(chosen: list[str]) -> Iterator[str]:
    known = sorted(path.stem for path in _STUDIES.glob("*.yaml"))
    yield from chosen or known


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks.charts", description=__doc__)
    parser.add_argument("studies", nargs="*", help="names of files in scenarios/studies, without .yaml; default: all")
    for each in _studies(parser.parse_args().studies):
        charted = chart(each)
        write_between(_PAGE, each, front(charted))
        if each in _TABLES:
            page, marker, table = _TABLES[each]
            write_between(page, marker, table(charted))
