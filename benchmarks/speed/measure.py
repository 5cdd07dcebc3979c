"""One measurement in a process of its own, so that the peak memory is that of the measurement: prints a line of JSON.

python -m benchmarks.speed.measure heartbeat 5 fmu 320
python -m benchmarks.speed.measure electrophysiology 2 20
python -m benchmarks.speed.measure solid 5
python -m benchmarks.speed.measure exchange 5
"""

import json
import resource
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from cardiac_cosim.orchestrator.simulation import simulate
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh

from ..exchange_cost import heart_milliseconds
from .factorisation import factorisation_ms, fibers_of, shortest_ms, solid_of

_SCENARIO = Path(__file__).parent.parent.parent / "scenarios" / "baseline.yaml"


def heartbeat(size_mm: float, participants: str, stop_ms: float) -> dict[str, Any]:
    """The baseline on a mesh of `size_mm`, with results written and without figures; then one factorisation."""
    settings = {"scene.mesh_size_mm": size_mm, "run.participants": participants, "run.stop_ms": stop_ms}
    with TemporaryDirectory() as folder:
        begin = perf_counter()
        summary = simulate(_SCENARIO, settings, folder).summary
        whole = perf_counter() - begin
    wall, peak = summary["wall_s"], _peak_megabytes()
    mesh = build("biventricle", size_mm)
    solid = solid_of(mesh)
    return _size(mesh) | {
        "participants": participants,
        "stop_ms": stop_ms,
        "unknowns": solid.unknowns,
        "loop_s": wall["total"],
        "whole_s": whole,
        "master_s": wall["master"],
        "units_s": wall["units"],
        "peak_MB": peak,
        "factorisation_ms": factorisation_ms(solid),
        "implementation": summary["implementation"],
    }


def electrophysiology(size_mm: float, stop_ms: float) -> dict[str, Any]:
    """The unit alone, unstretched: seconds for the set-up, and ms for each step of 1 ms."""
    mesh = build("biventricle", size_mm)
    fiber = fibers_of(mesh).get("fiber")
    before = _peak_megabytes()
    begin = perf_counter()
    unit = Electrophysiology(mesh)
    unit.enter_initialization_mode()
    unit.set("fiber", fiber)
    unit.exit_initialization_mode()
    ready = perf_counter()
    for number in range(int(stop_ms)):
        unit.do_step(1e-3 * number, 1e-3)
    done = perf_counter()
    return _size(mesh) | {
        "setup_s": ready - begin,
        "ms_per_step": 1e3 * (done - ready) / int(stop_ms),
        "peak_MB": _peak_megabytes(),
        "peak_before_MB": before,
    }


def solid(size_mm: float) -> dict[str, Any]:
    """The parts of the mechanics, each alone, in ms."""
    mesh = build("biventricle", size_mm)
    solid = solid_of(mesh)
    displacement = 1e-3 * np.sin(solid.space.points) * solid.free
    loads = np.full(solid.loads, 0.1)
    return _size(mesh) | {
        "unknowns": solid.unknowns,
        "residual_ms": shortest_ms(lambda: solid.residual(displacement, loads)),
        "tangent_ms": shortest_ms(lambda: solid.tangent(displacement, loads)),
        "stretch_ms": shortest_ms(lambda: solid.stretch(displacement)),
        "factorisation_ms": factorisation_ms(solid),
    }


def exchange(size_mm: float) -> dict[str, Any]:
    """The exchange of the three fields of a step, from the FMU of one unit to that of the next, in ms."""
    with TemporaryDirectory() as folder:
        times = {f"fmi{fmi}_ms": heart_milliseconds(fmi, Path(folder), size_mm) for fmi in (2, 3)}
    return _size(build("biventricle", size_mm)) | times


def _size(mesh: Mesh) -> dict[str, Any]:
    return {"nodes": mesh.nodes, "elements": mesh.elements}


def _peak_megabytes() -> float:
    # Kilobytes on Linux.
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


_MEASURES: dict[str, Callable[..., dict[str, Any]]] = {
    "heartbeat": heartbeat,
    "electrophysiology": electrophysiology,
    "solid": solid,
    "exchange": exchange,
}


def _number(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text


if __name__ == "__main__":
    kind, *arguments = sys.argv[1:]
    given = [_number(argument) for argument in arguments]
    print(json.dumps({"kind": kind, "size_mm": given[0]} | _MEASURES[kind](*given)))
