"""The system structure description: components with their connectors, connections, and the diagram of them."""

from collections.abc import Iterator
from importlib import metadata
from typing import Any

from ....fmus.annotations import TOOL
from ...systems.system import REAL, Component, Shape, System
from ..vocabulary import ANNOTATION, HINT, OWN, SSC, SSD, dimensions, version
from .diagram import Box, Diagram, Point
from .measures import definitions, measured


def structure(system: System, annotation: str | None = None) -> Any:
    """The element SystemStructureDescription of `system`; `annotation` is text that belongs to the whole."""
    shown = {component.name: _shown(system, component) for component in system.components}
    diagram = Diagram(system, {name: (list(inputs), list(outputs)) for name, (inputs, outputs) in shown.items()})
    root = SSD.SystemStructureDescription(
        {"version": version(system), "name": system.name, "generationTool": f"{TOOL} {metadata.version(TOOL)}"},
        SSD.System(
            {"name": system.name},
            SSD.Elements(
                *(_component(system, component, *shown[component.name], diagram) for component in system.components)
            ),
            *_connections(system, diagram),
            SSD.SystemGeometry(_corners(diagram.canvas)),
        ),
    )
    root.extend(
        definitions(
            SSD,
            [
                (each, {each.unit_of(name, shape) for fields in shown[each.name] for name, shape in fields.items()})
                for each in system.components
            ],
        )
    )
    step = HINT.Algorithm(HINT.FixedStepAlgorithm({"baseStepSize": repr(system.step_s)}))
    hint = SSD.Annotations(SSC.Annotation({"type": "com.opensimulationplatform"}, step))
    root.append(SSD.DefaultExperiment({"startTime": "0.0", "stopTime": repr(system.stop_s)}, hint))
    if annotation is not None:
        root.append(SSD.Annotations(SSC.Annotation({"type": ANNOTATION}, OWN.Scenario(annotation))))
    return root


def parameter_file(component: Component) -> str:
    """Where the parameter set of `component` is in the package."""
    return f"resources/{component.name}.ssv"


def _shown(system: System, component: Component) -> tuple[dict[str, Shape], dict[str, Shape]]:
    """The inputs and outputs that have connectors: those that are connected, and the numbers that a tool plots.

    The other fields have none, though the standard would have them: libcosim's time to read a package grows with the
    product of its connectors and connections. An input without a connection has none because FMPy then connects it to
    whatever it connected last.
    """
    linked = system.linked_outputs(component)
    outputs = {name: shape for name, shape in component.outputs.items() if name in linked or not shape}
    return system.linked_inputs(component), outputs


def _component(
    system: System, component: Component, inputs: dict[str, Shape], outputs: dict[str, Shape], diagram: Diagram
) -> Any:
    element = SSD.Component(
        {
            "name": component.name,
            "type": "application/x-fmu-sharedlibrary",
            "source": f"resources/{system.files[component.fmu]}",
            "implementation": "CoSimulation",
        }
    )
    connectors = [
        SSD.Connector(
            {"name": variable, "kind": kind},
            *_type(component, variable, name, shape),
            SSD.ConnectorGeometry(_place(diagram.pin(component.name, kind, name))),
        )
        for kind, fields in (("input", inputs), ("output", outputs))
        for name, shape in fields.items()
        for variable in component.names(name, shape)
    ]
    if connectors:
        element.append(SSD.Connectors(*connectors))
    element.append(SSD.ElementGeometry(_corners(diagram.boxes[component.name])))
    if component.given:
        element.append(SSD.ParameterBindings(SSD.ParameterBinding({"source": parameter_file(component)})))
    return element


def _type(component: Component, variable: str, name: str, shape: Shape) -> list[Any]:
    """The elements for the type and the dimensions of a connector; the items of an enumeration stay with the FMU."""
    kind, own_shape = component.variables[variable].type, component.variables[variable].shape or ()
    if kind == "Enumeration":
        return dimensions(own_shape)
    unit = measured(component, component.unit_of(name, shape)) if kind in REAL else {}
    return [SSC(kind, unit), *dimensions(own_shape)]


def _connections(system: System, diagram: Diagram) -> Iterator[Any]:
    elements = []
    for link in system.links:
        way = diagram.way(link)
        for output, target in system.pairs(link):
            ends = {"startElement": link.source, "startConnector": output}
            ends |= {"endElement": link.target, "endConnector": target}
            if link.law is None:
                elements.append(SSD.Connection(ends, _drawn(way)))
                continue
            # What is transformed by hand is not to be converted once more by units of measure.
            law = SSC.LinearTransformation({"factor": repr(link.law[0]), "offset": repr(link.law[1])})
            elements.append(SSD.Connection(ends | {"suppressUnitConversion": "true"}, law, _drawn(way)))
    if elements:
        yield SSD.Connections(*elements)


# --- geometry ---------------------------------------------------------------------------------------------------------


def _corners(box: Box) -> dict[str, str]:
    return {"x1": repr(box.left), "y1": repr(box.bottom), "x2": repr(box.right), "y2": repr(box.top)}


def _place(point: Point) -> dict[str, str]:
    return {"x": repr(point[0]), "y": repr(point[1])}


def _drawn(way: tuple[Point, ...]) -> Any:
    texts = {f"points{axis}": " ".join(repr(point[number]) for point in way) for number, axis in enumerate("XY")}
    return SSD.ConnectionGeometry(texts)
