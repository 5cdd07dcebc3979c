"""The cost of exchanging fields: 10 000 values to and from an FMU, and the three fields of one step of the heart.

Prints the table of docs/fmi.md for FMI 2.0 and FMI 3.0.
"""

import zipfile
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from cardiac_cosim.fmus.cache import cached_fmu
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from skfem import MeshTet

_REPEATS = 200


def _block() -> Mesh:
    """A block of 10 000 nodes."""
    grid = MeshTet.init_tensor(*(np.linspace(0.0, 20.0, count) for count in (20, 20, 25)))
    points, cells = grid.p.T, grid.t.T
    inverted = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0.0
    return Mesh(points, np.where(inverted[:, None], cells[:, [0, 2, 1, 3]], cells))


def _milliseconds(fmu: Path) -> tuple[float, float, float]:
    """Medians of setting and of getting a field, in ms, and the seconds to load the FMU."""
    begin = perf_counter()
    participant = FmuParticipant("active_stress", fmu, {})
    made = perf_counter() - begin
    try:
        participant.begin()
        participant.complete()
        random = np.random.default_rng(0)
        setting, reading = [], []
        for number in range(_REPEATS):
            potential = random.uniform(-80.0, 20.0, participant.inputs["potential"].shape)
            begin = perf_counter()
            participant.set("potential", potential)
            setting.append(perf_counter() - begin)
            # Without a step, the values that are read would be those that were read before.
            participant.start(1e-3 * number, 1e-3)
            begin = perf_counter()
            participant.get("active_stress")
            reading.append(perf_counter() - begin)
    finally:
        participant.close()
    return 1e3 * median(setting), 1e3 * median(reading), made


def heart_milliseconds(fmi: int, folder: Path, size_mm: float = 5.0) -> float:
    """Median over the steps of reading potential, active stress and stretch, and setting each where it goes, in ms."""
    heart = build("biventricle", size_mm)
    ways = {
        "electrophysiology": ("potential", "active_stress"),
        "active_stress": ("active_stress", "mechanics"),
        "mechanics": ("stretch", "electrophysiology"),
    }
    names = ["fiber_generator", *ways]
    units = {name: FmuParticipant(name, cached_fmu(UNITS[name], heart, folder, fmi), {}) for name in names}
    seconds = []
    try:
        for unit in units.values():
            unit.begin()
            for direction in {"fiber", "sheet"} & set(unit.inputs):
                unit.set(direction, units["fiber_generator"].get(direction))
            unit.complete()
        for number in range(_REPEATS // 10):
            for name in ways:
                units[name].start(1e-3 * number, 1e-3)
            begin = perf_counter()
            for name, (field, target) in ways.items():
                units[target].set(field, units[name].get(field))
            seconds.append(perf_counter() - begin)
    finally:
        for unit in units.values():
            unit.close()
    return 1e3 * median(seconds)


def _row(mesh: Mesh, fmi: int) -> str:
    with TemporaryDirectory() as folder:
        step = heart_milliseconds(fmi, Path(folder))
        path = cached_fmu(UNITS["active_stress"], mesh, Path(folder), fmi)
        setting, reading, made = _milliseconds(path)
        with zipfile.ZipFile(path) as archive:
            size = archive.getinfo("modelDescription.xml").file_size
    return f"| FMI {fmi}.0 | {setting:.2f} | {reading:.2f} | {step:.2f} | {made:.2f} | {size / 1e3:.0f} |"


if __name__ == "__main__":
    block = _block()
    columns = ("version", "set, ms", "get, ms", "fields of one heart step, ms", "loaded, s", "description, kB")
    print(f"| {' | '.join(columns)} |")
    print("|---|---|---|---|---|---|")
    for fmi in (2, 3):
        print(_row(block, fmi))
