"""How long a heartbeat takes, and how that grows with the mesh: writes the tables and the figure of docs/speed.md.

It takes some ten minutes. Durations are given in seconds, and also as the number of times that the same process could
factorise the undeformed stiffness of the same mesh in that time, which can be compared between machines. With
`--sizes 8 5` only those meshes are measured, and the tables are printed only. Each measurement is kept in history.json,
with the machine and the versions of the packages.
"""

import argparse
import json
import subprocess
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from cardiac_cosim.studies.machine import machine

from ..page import write_between
from .figure import draw
from .tables import tables

_ROOT = Path(__file__).parent.parent.parent
_HISTORY = Path(__file__).parent / "history.json"
_SIZES, _FINEST = (8.0, 5.0, 3.0, 2.0), 1.0
#: The mesh size at which the ways of calling the units are compared.
_BASELINE = 5.0


def _measured(*arguments: object) -> dict[str, Any]:
    command = [sys.executable, "-m", "benchmarks.speed.measure", *map(str, arguments)]
    print(" ".join(command[3:]), flush=True)
    done = subprocess.run(command, cwd=_ROOT, check=True, stdout=subprocess.PIPE, text=True)
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))


def _machine() -> dict[str, Any]:
    """The machine and the versions of the packages that decide the speed, as the tables name them."""
    versions = {}
    for package in ("numpy", "scipy", "rslab"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    here = machine()
    return {"processor": f"{here['processor']}, {here['cores']} threads", "python": here["python"], **versions}


def _measure(sizes: list[float]) -> list[dict[str, Any]]:
    # FMUs are built and unpacked once before anything is timed.
    _measured("heartbeat", _BASELINE, "fmu", 5)
    found = [_measured("heartbeat", size, "native", 320) for size in sizes]
    if _BASELINE in sizes:
        found += [_measured("heartbeat", _BASELINE, kind, 320) for kind in ("fmu", "fmu3")]
    for kind in ("solid", "exchange"):
        found += [_measured(kind, size) for size in sizes]
    fine = [*sizes, _FINEST] if sizes == list(_SIZES) else sizes
    return found + [_measured("electrophysiology", size, 20) for size in fine]


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__)
    parser.add_argument("--sizes", type=float, nargs="+", default=list(_SIZES), help="sizes of the meshes in mm")
    sizes: list[float] = parser.parse_args().sizes
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=_ROOT, capture_output=True, text=True)
    record = {
        "date": datetime.now(UTC).date().isoformat(),
        "commit": commit.stdout.strip(),
        "machine": _machine(),
        "measured": _measure(sizes),
    }
    text = tables(record)
    print(text)
    if sizes == list(_SIZES):
        history = json.loads(_HISTORY.read_text(encoding="utf-8")) if _HISTORY.exists() else []
        _HISTORY.write_text(json.dumps([*history, record], indent=1) + "\n", encoding="utf-8")
        write_between(_ROOT / "docs" / "speed.md", "speed", text)
        draw(record, _ROOT / "docs" / "images" / "speed.png")


if __name__ == "__main__":
    main()
