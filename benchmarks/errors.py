"""The error budgets in docs/errors.md: `python -m benchmarks.errors strand`, or `baseline`, which takes minutes.

Settings of the scenario may follow: `python -m benchmarks.errors baseline scene.mesh_size_mm=8`.
"""

import csv
import json
import subprocess
import sys
from pathlib import Path

from cardiac_cosim.studies.point import value_text

from .page import write_between

_ROOT = Path(__file__).parent.parent
_PAGE = _ROOT / "docs" / "errors.md"
_IMAGES = _ROOT / "docs" / "images"


def measure(name: str, settings: list[str]) -> str:
    """The budget of a scenario of this project: the command, its sentences, a table and the figure."""
    folder = _ROOT / "results" / f"{name}.errors"
    command = ["errors", f"scenarios/{name}.yaml", *(word for text in settings for word in ("--set", text))]
    subprocess.run(
        [sys.executable, "-m", "cardiac_cosim.cli", *command, "--output", str(folder)], cwd=_ROOT, check=True
    )
    sentences = json.loads((folder / "errors.json").read_text(encoding="utf-8"))["sentences"]
    picture = _IMAGES / f"errors_{name}.png"
    picture.write_bytes((folder / "errors.png").read_bytes())
    shown = "\n".join(["```sh", " ".join(["cosim", *command]), "```", "", "```", *sentences, "```"])
    return f"{shown}\n\n{_table(folder)}\n\n![Numerical errors of the scenario {name} by source](images/{picture.name})"


def _table(folder: Path) -> str:
    """A row per quantity, a column per source: the estimate and its order; in brackets if it is not trusted."""
    with (folder / "errors.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    sources = list(dict.fromkeys(row["source"] for row in rows))
    lines = [f"| quantity | {' | '.join(sources)} |", "|---|" + "---|" * len(sources)]
    for quantity in dict.fromkeys(row["quantity"] for row in rows):
        cells = {row["source"]: _cell(row) for row in rows if row["quantity"] == quantity}
        lines.append(f"| `{quantity}` | {' | '.join(cells[source] for source in sources)} |")
    return "\n".join(lines)


def _cell(row: dict[str, str]) -> str:
    if row["reason"].startswith("negligible"):
        return "–"
    if not row["estimate"]:
        return "unknown"
    estimate = f"{float(row['estimate']):+.2g}"
    return (
        f"{estimate}, order {value_text(round(float(row['order']), 1))}" if row["trusted"] == "1" else f"({estimate})"
    )


if __name__ == "__main__":
    given = sys.argv[1:] or ["strand"]
    write_between(_PAGE, given[0], measure(given[0], given[1:]))
