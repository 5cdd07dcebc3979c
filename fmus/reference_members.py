"""Members of an FMU by the layered standard FMI-LS-REF: its reference experiment, and the manifest of that.

The manifest is that of FMI-LS-REF 1.0.0-beta.1, the experiment in the format of its predecessor's appendix, which the
harmonized specification of experiments began with. Inputs and results are tables of comma-separated values: a column
for every variable, and in FMI 3.0 an array is one, with its values in row-major order separated by blanks, as in the
Reference-FMUs. Elements of arrays that are results are columns of their own, named `fiber[1,2]` in both versions.
"""

from collections.abc import Sequence
from itertools import islice

import numpy as np

from ..units.arrays import FloatArray
from ..units.mesh import Mesh
from ..units.unit import Unit
from .layout import scalar_names
from .reference_experiment import TOLERANCE, ReferenceExperiment, driven_places, reference_experiment
from .xml_tag import tag

#: The standard's name; its namespace, and the text that its manifests have to carry.
STANDARD = "org.fmi-standard.fmi-ls-ref"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
STATEMENT = "Layered Standard providing information on related files included in an FMU."

#: Where its files are in an FMU, and what they are called.
FOLDER = f"extra/{STANDARD}"
MANIFEST = "fmi-ls-manifest.xml"

#: The type of a file of experiments.
EXPERIMENTS = "application/x-ma-hs-experiments"

_VERSION = "1.0.0-beta.1"

#: Digits of a number: a hundredth of the tolerance, so that rounding does not use it up. Processors that differ in the
#: last bits of a result make the same FMU.
_DIGITS = 9


def reference_members(kind: type[Unit], mesh: Mesh, fmi: int) -> dict[str, bytes]:
    """The files of the reference experiment of a unit of this `kind` on `mesh`, by their names in its FMU (`fmi`).

    None at all where the unit has no initial state with its default parameters.
    """
    experiment = reference_experiment(kind, mesh)
    if experiment is None:
        return {}
    files = {MANIFEST: _manifest(), "experiments.exp": _experiments(kind, experiment)}
    if experiment.inputs:
        files["inputs.csv"] = _inputs(kind, mesh, experiment, fmi)
    files["results.csv"] = _table(
        list(experiment.answers), experiment.times_s, np.array([*experiment.answers.values()]).T
    )
    members = {f"{FOLDER}/{name}": text.encode() for name, text in files.items()}
    return members | {"documentation/fmi-ls-ref.txt": _explained(experiment).encode()}


def _manifest() -> str:
    head = {
        "xmlns:fmi-ls": NAMESPACE,
        "fmi-ls:fmi-ls-name": STANDARD,
        "fmi-ls:fmi-ls-version": _VERSION,
        "fmi-ls:fmi-ls-description": STATEMENT,
    }
    related = {
        "type": EXPERIMENTS,
        "source": "experiments.exp",
        "role": "experiment/smoke-test",
        "description": "A short experiment with its results",
    }
    return _document(tag("fmiReferences", False, **head), tag("Related", True, **related), "</fmiReferences>")


def _experiments(kind: type[Unit], experiment: ReferenceExperiment) -> str:
    what = {
        "name": "start",
        "description": "Default parameters and constant inputs; results of the unit without FMI",
        "startTime": "0",
        "stopTime": f"{experiment.times_s[-1]:g}",
        "tolerance": f"{TOLERANCE:g}",
        "stepSize": f"{experiment.step_s:g}",
    }
    return _document(
        tag("Experiments", name=kind.name, description=f"Reference experiments of the unit {kind.name}"),
        tag("Experiment", False, **what),
        *([tag("Stimuli", source="inputs.csv", end=True)] if experiment.inputs else []),
        tag("References", source="results.csv", end=True),
        "</Experiment>",
        "</Experiments>",
    )


def _inputs(kind: type[Unit], mesh: Mesh, experiment: ReferenceExperiment, fmi: int) -> str:
    """The table of inputs, its one row repeated at the end."""
    names: list[str] = []
    cells: list[str] = []
    for name, values in experiment.inputs.items():
        variable = kind.variable(name)
        if fmi == 3:
            names.append(name)
            cells.append(" ".join(map(_number, values.reshape(-1).tolist())))
            continue
        # The others keep their start values.
        places = driven_places(variable, mesh)
        names += islice(scalar_names(name, values.shape), places)
        cells += map(_number, values.reshape(-1)[:places].tolist())
    times = experiment.times_s[0], experiment.times_s[-1]
    return "".join(f"{line}\n" for line in (_line(["time", *names]), *(_line([_number(t), *cells]) for t in times)))


def _table(names: Sequence[str], times: Sequence[float], values: FloatArray) -> str:
    rows = (_line([_number(time), *map(_number, row)]) for time, row in zip(times, values.tolist(), strict=True))
    return "".join(f"{line}\n" for line in (_line(["time", *names]), *rows))


def _line(cells: Sequence[str]) -> str:
    # The names of elements have commas in them.
    return ",".join(f'"{cell}"' if "," in cell else cell for cell in cells)


def _number(value: float) -> str:
    # Zero has one sign.
    return f"{value + 0.0:.{_DIGITS}g}"


def _document(*lines: str) -> str:
    return "\n".join(('<?xml version="1.0" encoding="UTF-8"?>', *lines, ""))


def _explained(experiment: ReferenceExperiment) -> str:
    given = ", ".join(experiment.inputs) or "none"
    return (
        f"This FMU contains a reference experiment with its results, in {FOLDER} (FMI-LS-REF).\n\n"
        f"The experiment begins at t = 0 and ends at t = {experiment.times_s[-1]:g} s, in steps of "
        f"{experiment.step_s:g} s. All parameters have their defaults. The following inputs are set at the "
        "initialisation and stay constant: "
        f"{given}. Of a field, only the first values differ from the start value. All other inputs keep their start "
        "values.\n\n"
        "The results were computed by the unit without FMI on the machine that built this FMU. On another processor, "
        f"they differ in their last bits. A deviation of more than {TOLERANCE:g} times the largest magnitude of a "
        "variable is an error.\n\n"
        "To run the experiment again and compare: cosim verify FILE.fmu\n"
    )
