"""Couples FMUs by Gauss-Seidel, knowing nothing but FMI: what has one name belongs together. Run as a script.

    python fmi_master.py STEP_S STEPS PARAMETERS.json RESULT.npz FIRST.fmu SECOND.fmu ...

The FMUs, of FMI 2.0 or 3.0, step in the order given; those whose outputs do not move do not. PARAMETERS holds values by
model name. RESULT holds the scalar outputs over time, with a value for the start and every step, and all output fields
at the end.
"""

import json
import sys
from pathlib import Path

import numpy as np
from fmi_driver import drive


def main(step: float, steps: int, parameters: dict[str, dict[str, object]], result: Path, fmus: list[Path]) -> None:
    units = [drive(path, path.stem) for path in fmus]
    known: dict[str, list[float]] = {}
    for unit in units:
        start = {name: known[name] for name in unit.names("input") if name in known}
        unit.start(parameters.get(unit.description.modelName, {}), start, stop=steps * step)
        known |= unit.outputs()
    course = {name: list(values) for name, values in known.items() if len(values) == 1}
    stepping = [unit for unit in units if unit.names("output", moving=True)]
    for number in range(steps):
        for unit in stepping:
            names = [name for name in unit.names("input", moving=True) if name in known]
            status = unit.step(number * step, step, {name: known[name] for name in names})
            if status:
                raise RuntimeError(f"{unit.description.modelName} came back with {status}: {unit.errors()}")
            known |= unit.outputs()
        for name, values in course.items():
            values += known[name]
    for unit in units:
        unit.terminate()
        if unit.messages or unit.refused:
            raise RuntimeError(f"{unit.description.modelName}: {unit.messages} {unit.refused}")
        unit.close()
    np.savez(result, **course, **{name: values for name, values in known.items() if len(values) > 1})


if __name__ == "__main__":
    given = sys.argv[1:]
    main(
        float(given[0]), int(given[1]), json.loads(Path(given[2]).read_text()), Path(given[3]), [*map(Path, given[4:])]
    )
