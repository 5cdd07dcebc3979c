"""The maps of scenarios/stability in the documentation: some minutes; or `python -m benchmarks.stability NAME`.

Runs what is missing of each study in results/<name>, copies the figure to docs/images/stability, and writes the tables
of the page.
"""

import argparse
import os
from pathlib import Path
from shutil import copyfile

from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.point import value_text
from cardiac_cosim.studies.stability import map_study, plan_map, write_map
from cardiac_cosim.studies.stability.counts import apart, counted
from cardiac_cosim.studies.stability.map import Panel, StabilityMap
from rich.console import Console

from .page import write_between

_ROOT = Path(__file__).parent.parent
STUDIES = _ROOT / "scenarios" / "stability"
_PAGE = _ROOT / "docs" / "stability.md"
_IMAGES = _ROOT / "docs" / "images" / "stability"


def stability_map(name: str) -> StabilityMap:
    """Map a study of that name, and put its figure into the documentation."""
    plan = plan_map(STUDIES / f"{name}.yaml")
    folder = _ROOT / "results" / plan.study.name
    with Bench(folder, Console(), workers=os.cpu_count()) as bench:
        found = map_study(plan, bench)
    write_map(found, folder)
    _IMAGES.mkdir(parents=True, exist_ok=True)
    copyfile(folder / "stability.png", _IMAGES / f"{name}.png")
    return found


def table(found: StabilityMap) -> str:
    """What each panel has: cells by class, and how far the boundary is from the predicted one at most."""
    kinds = list(counted(found.cells))
    rows = [f"| | {' | '.join(kinds)} | boundary |", "|---" * (2 + len(kinds)) + "|"]
    for panel in found.panels:
        numbers = counted(panel.cells)
        cells = [str(numbers.get(kind, 0)) for kind in kinds]
        rows.append(f"| {panel.name} | {' | '.join(cells)} | {_boundary(panel)} |")
    return "\n".join(rows)


def _boundary(panel: Panel) -> str:
    if not panel.crossings:
        return "none"
    y = panel.y_key.rpartition(".")[2]
    places = [f"{Path(value_text(each.x)).name}: {each.measured:.4g}" for each in panel.crossings]
    known = [distance for each in panel.crossings if (distance := apart(each)) is not None]
    told = f"{y} {', '.join(places)} at {panel.x_key.rpartition('.')[2]}"
    return f"{told}; theory at most {100.0 * max(map(abs, known)):.1f} % away" if known else told


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability", description=__doc__)
    parser.add_argument("studies", nargs="*", help="names of files in scenarios/stability; all if none is given")
    for each in parser.parse_args().studies or sorted(path.stem for path in STUDIES.glob("*.yaml")):
        write_between(_PAGE, each, table(stability_map(each)))
