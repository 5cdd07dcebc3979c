"""The modelDescription.xml of a unit's FMU, from the unit's own declaration (FMI 2.0.4, section 2.2).

What depends on what. Outputs change in a step only; `dependencies` therefore names, for each output, the inputs that
the step carries over to it. An output that follows all inputs everywhere has no such attribute, which by the standard
means just that; a pointwise one (active stress) names the inputs at its own place; one without inputs (fibres) has
the empty list. What a unit computes with on the machine it runs on follows no variable: it is a calculated parameter.
"""

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.sparse import csr_matrix

from ...units.mesh import Mesh
from ...units.unit import Unit
from ...units.variable import Causality, Location
from ..annotations import TOOL, annotations
from ..layout import Run, layout
from ..xml_tag import tag
from .head import default_experiment, log_categories, origin
from .units_of_measure import unit_definitions

_CAPABILITIES = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}


def model_description(unit: type[Unit], mesh: Mesh, guid: str) -> str:
    """The XML text for `unit` on `mesh`."""
    runs = layout(unit, mesh)
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            tag(
                "fmiModelDescription",
                fmiVersion="2.0",
                modelName=unit.name,
                guid=guid,
                **origin(unit),
                end=False,
            ),
            tag("CoSimulation", modelIdentifier=unit.name, **_CAPABILITIES, **_abilities(unit), end=True),
            *unit_definitions(unit),
            *log_categories(2),
            default_experiment(),
            "<VendorAnnotations>",
            tag("Tool", name=TOOL),
            *annotations(unit),
            "</Tool></VendorAnnotations>",
            "<ModelVariables>",
            *(line for run in runs for line in _scalars(run)),
            "</ModelVariables>",
            "<ModelStructure>",
            "<Outputs>",
            *_unknowns(runs, mesh),
            "</Outputs>",
            "<InitialUnknowns>",
            *(
                tag("Unknown", index=str(run.first + 1 + k), end=True)
                for run in runs
                if run.variable.causality in (Causality.OUTPUT, Causality.CALCULATED_PARAMETER)
                for k in range(run.size)
            ),
            "</InitialUnknowns>",
            "</ModelStructure>",
            "</fmiModelDescription>",
            "",
        ]
    )


def _abilities(unit: type[Unit]) -> dict[str, str]:
    return {"canInterpolateInputs": "true"} if unit.interpolates else {}


def _outputs(runs: tuple[Run, ...]) -> list[Run]:
    return [run for run in runs if run.variable.causality is Causality.OUTPUT]


def _scalars(run: Run) -> Iterator[str]:
    variable = run.variable
    fmi_type = run.type_in(2)
    # Of a float, as many digits as it takes to read the same one back.
    start = quoteattr(str(variable.start))
    unit = f" unit={quoteattr(variable.unit)}" if fmi_type == "Real" else ""
    if variable.causality is Causality.PARAMETER:
        kind = ' causality="parameter" variability="fixed" initial="exact"'
        value = f"<{fmi_type} start={start}{unit}{_bounds(run)}/>"
    elif variable.causality is Causality.CALCULATED_PARAMETER:
        kind = ' causality="calculatedParameter" variability="fixed" initial="calculated"'
        value = f"<{fmi_type}/>"
    elif variable.causality is Causality.INPUT:
        kind = f' causality="input" variability="{"discrete" if variable.fixed else "continuous"}"'
        value = f"<Real start={start}{unit}/>"
    else:
        kind = (
            f' causality="output" variability="{"discrete" if variable.fixed else "continuous"}" initial="calculated"'
        )
        value = f"<Real{unit}/>"
    described = f"{kind} description={quoteattr(variable.description)}>{value}</ScalarVariable>"
    for reference, name in enumerate(run.names(), start=run.first):
        yield f'<ScalarVariable name="{name}" valueReference="{reference}"{described}'


def _bounds(run: Run) -> str:
    # FMI's bounds are inclusive: an exclusive one (above) stays with the unit, which checks it.
    return "" if run.variable.at_least is None else f' min="{run.variable.at_least:.17g}"'


def _unknowns(runs: tuple[Run, ...], mesh: Mesh) -> Iterator[str]:
    inputs = {run.variable.name: run for run in runs if run.variable.causality is Causality.INPUT}
    for run in _outputs(runs):
        followed = [inputs[name] for name in run.variable.depends_on]
        if run.variable.pointwise:
            places = [_places(source, run, mesh) for source in followed]
            lists = [
                " ".join(
                    str(source.first + 1 + k) for source, at in zip(followed, places, strict=True) for k in at[place]
                )
                for place in range(run.size)
            ]
        elif len(followed) == len(inputs) > 0:
            for k in range(run.size):
                yield f'<Unknown index="{run.first + 1 + k}"/>'
            continue
        else:
            all_of_them = " ".join(str(source.first + 1 + k) for source in followed for k in range(source.size))
            lists = [all_of_them] * run.size
        for k, dependencies in enumerate(lists):
            yield f'<Unknown index="{run.first + 1 + k}" dependencies="{dependencies}"/>'


def _places(source: Run, target: Run, mesh: Mesh) -> list[list[int]]:
    """For each place of `target`, the places of `source` that lie there."""
    if source.variable.location is target.variable.location:
        return [[place] for place in range(target.size)]
    if (source.variable.location, target.variable.location) != (Location.ELEMENT, Location.NODE):
        raise NotImplementedError(f"pointwise from {source.variable.location} to {target.variable.location}")
    elements = np.repeat(np.arange(mesh.elements), mesh.cells.shape[1])
    around = csr_matrix((np.ones(len(elements)), (mesh.cells.ravel(), elements)), shape=(mesh.nodes, mesh.elements))
    return [row.tolist() for row in np.split(around.indices, around.indptr[1:-1])]
