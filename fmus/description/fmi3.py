"""The modelDescription.xml of a unit's FMI 3.0 FMU, from the unit's own declaration (FMI 3.0, section 2.4).

A field is one Float64 variable with fixed dimensions, so that the text has the same length on every mesh.

What depends on what. As in the FMI 2.0 description, `dependencies` names for each output the inputs that a step
carries over to it; the list is absent where an output follows all inputs. FMI 3.0 lists whole variables: that a
pointwise output follows its inputs at its own place only has no place in it.
"""

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

from ...units.mesh import Mesh
from ...units.unit import Unit
from ...units.variable import Causality
from ..annotations import TOOL, annotations
from ..layout import TIME, Run, layout
from ..xml_tag import tag
from .head import default_experiment, log_categories, origin
from .units_of_measure import unit_definitions

_CAPABILITIES = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
    "canHandleVariableCommunicationStepSize": "true",
}


def model_description(unit: type[Unit], mesh: Mesh, token: str) -> str:
    """The XML text for `unit` on `mesh`; `token` is the instantiation token."""
    runs = layout(unit, mesh)
    outputs = [run for run in runs if run.variable.causality is Causality.OUTPUT]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            tag(
                "fmiModelDescription",
                fmiVersion="3.0",
                modelName=unit.name,
                instantiationToken=token,
                **origin(unit),
                end=False,
            ),
            tag("CoSimulation", modelIdentifier=unit.name, **_CAPABILITIES, **_abilities(unit), end=True),
            *unit_definitions(unit, "s"),
            *log_categories(3),
            default_experiment(),
            "<ModelVariables>",
            tag(
                "Float64",
                name="time",
                valueReference=str(TIME.reference),
                causality="independent",
                variability="continuous",
                unit="s",
                description=TIME.variable.description,
                end=True,
            ),
            *(_variable(run) for run in runs),
            "</ModelVariables>",
            "<ModelStructure>",
            *_outputs(runs, outputs),
            *(tag("InitialUnknown", valueReference=str(run.reference), end=True) for run in runs if _is_unknown(run)),
            "</ModelStructure>",
            "<Annotations>",
            tag("Annotation", type=TOOL),
            *annotations(unit),
            "</Annotation></Annotations>",
            "</fmiModelDescription>",
            "",
        ]
    )


def _abilities(unit: type[Unit]) -> dict[str, str]:
    return {"providesIntermediateUpdate": "true"} if unit.interpolates else {}


def _is_unknown(run: Run) -> bool:
    """Whether the unit computes its initial value."""
    return run.variable.causality in (Causality.OUTPUT, Causality.CALCULATED_PARAMETER)


def _variable(run: Run) -> str:
    variable = run.variable
    attributes = {"name": variable.name, "valueReference": str(run.reference), "causality": variable.causality.value}
    if variable.causality is Causality.PARAMETER:
        attributes |= {"variability": "fixed", "initial": "exact"}
    elif variable.causality is Causality.CALCULATED_PARAMETER:
        attributes |= {"variability": "fixed", "initial": "calculated"}
    else:
        attributes |= {"variability": "discrete" if variable.fixed else "continuous"}
    if variable.causality is Causality.OUTPUT:
        attributes |= {"initial": "calculated"}
    attributes |= {"description": variable.description}
    if run.type_in(3) == "Float64":
        attributes |= {"unit": variable.unit}
    # FMI's bounds are inclusive: an exclusive one (above) stays with the unit, which checks it.
    if variable.at_least is not None:
        attributes |= {"min": f"{variable.at_least:.17g}"}
    nested = "".join(tag("Dimension", start=str(count), end=True) for count in run.shape)
    if not _is_unknown(run):
        if run.type_in(3) == "String":
            nested += f"<Start value={quoteattr(str(variable.start))}/>"
        else:
            # Of a float, as many digits as it takes to read the same one back; of a field, one value for all places.
            attributes |= {"start": str(variable.start)}
    return tag(run.type_in(3), **attributes, end=False) + nested + f"</{run.type_in(3)}>"


def _outputs(runs: tuple[Run, ...], outputs: list[Run]) -> Iterator[str]:
    inputs = {run.variable.name: run for run in runs if run.variable.causality is Causality.INPUT}
    for run in outputs:
        followed = run.variable.depends_on
        attributes = {"valueReference": str(run.reference)}
        # Where there are no inputs, an absent list would mean a dependence on the time all the same.
        if not len(followed) == len(inputs) > 0:
            attributes |= {"dependencies": " ".join(str(inputs[name].reference) for name in followed)}
        yield tag("Output", **attributes, end=True)
