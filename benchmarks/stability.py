"""The maps of scenarios/stability in the documentation; all of them take some minutes.

For each study, the runs that are missing in results/<name> are made, the figure is copied to docs/images/stability, and
the tables of the page are written. One study: `python -m benchmarks.stability NAME`.
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
    """Map the study of that name, and copy its figure into the documentation."""
    plan = plan_map(STUDIES / f"{name}.yaml")
    folder = _ROOT / "results" / plan.study.name
    with Bench(folder, Console(), workers=os.cpu_count()) as bench:
        found = map_study(plan, bench)
    write_map(found, folder)
    _IMAGES.mkdir(parents=True, exist_ok=True)
    copyfile(folder / "stability.png", _IMAGES / f"{name}.png")
    return found


def table(found: StabilityMap) -> str:
    """For each panel the number of cells of each class, the measured boundary, and its distance from theory."""
    kinds = list(counted(found.cells))
    rows = [f"| panel | {' | '.join(kinds)} | boundary |", "|---" * (2 + len(kinds)) + "|"]
    for panel in found.panels:
        numbers = counted(panel.cells)
        cells = [str(numbers.get(kind, 0)) for kind in kinds]
        rows.append(f"| {panel.name} | {' | '.join(cells)} | {_boundary(panel)} |")
    return "\n".join(rows)


def _boundary(panel: Panel) -> str:
    if not panel.crossings:
        return "none"
    x, y = (key.rpartition(".")[2] for key in (panel.x_key, panel.y_key))
    (first, at), *others = [(f"{each.measured:.4g}", Path(value_text(each.x)).name) for each in panel.crossings]
    places = [f"{y} = {first} at {x} = {at}", *(f"{limit} at {at}" for limit, at in others)]
    known = [distance for each in panel.crossings if (distance := apart(each)) is not None]
    told = ", ".join(places)
    return f"{told}; at most {100.0 * max(map(abs, known)):.1f} % from theory" if known else told


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability", description=__doc__)
    parser.add_argument("studies", nargs="*", help="names of files in scenarios/stability, without .yaml; default: all")
    for each in parser.parse_args().studies or sorted(path.stem for path in STUDIES.glob("*.yaml")):
        write_between(_PAGE, each, table(stability_map(each)))
