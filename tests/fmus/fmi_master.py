"""Couples FMUs by Gauss-Seidel, knowing nothing but FMI 2.0: what has one name belongs together. Run as a script.

    python fmi_master.py STEP_S STEPS PARAMETERS.json RESULT.npz FIRST.fmu SECOND.fmu ...

The FMUs step in the order given; those whose outputs are all fixed do not. PARAMETERS holds values by model name.
RESULT holds the scalar outputs over time, with a value for the start and every step, and all output fields at the end.
"""

import json
import sys
from pathlib import Path

import numpy as np
from fmi_driver import Driver


def main(step: float, steps: int, parameters: dict[str, dict[str, object]], result: Path, fmus: list[Path]) -> None:
    units = [Driver(path, path.stem) for path in fmus]
    known: dict[str, list[float]] = {}
    for unit in units:
        start = {name: values for name, values in known.items() if name in inputs(unit)}
        unit.start(parameters.get(unit.description.modelName, {}), start)
        known |= unit.outputs()
    course = {name: list(values) for name, values in known.items() if len(values) == 1}
    stepping = [unit for unit in units if not all(output.variability == "fixed" for output in outputs(unit))]
    for number in range(steps):
        for unit in stepping:
            names = {name for name, variable in inputs(unit).items() if variable.variability != "fixed"}
            status = unit.step(number * step, step, {name: known[name] for name in names if name in known})
            if status:
                raise RuntimeError(f"{unit.description.modelName} came back with {status}: {unit.errors()}")
            known |= unit.outputs()
        for name, values in course.items():
            values += known[name]
    for unit in units:
        if unit.messages or unit.refused:
            raise RuntimeError(f"{unit.description.modelName}: {unit.messages} {unit.refused}")
        unit.close()
    np.savez(result, **course, **{name: values for name, values in known.items() if len(values) > 1})


def inputs(unit: Driver) -> dict[str, object]:
    """The first scalar of every input."""
    firsts = {name: unit.description.modelVariables[place[0]] for name, place in unit.fields.items()}
    return {name: variable for name, variable in firsts.items() if variable.causality == "input"}


def outputs(unit: Driver) -> list[object]:
    return [variable for variable in unit.description.modelVariables if variable.causality == "output"]


if __name__ == "__main__":
    given = sys.argv[1:]
    main(
        float(given[0]), int(given[1]), json.loads(Path(given[2]).read_text()), Path(given[3]), [*map(Path, given[4:])]
    )
