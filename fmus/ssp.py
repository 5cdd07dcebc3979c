"""System Structure and Parameterization 1.0: a system as one package that other tools open.

A package is an archive of `SystemStructure.ssd` (who there is and who feeds whom), the FMUs, and a parameter set for
every component that is given values. All connections are from component to component: connectors of the system itself,
which the standard allows, break libcosim and Ecos. A field is connected scalar by scalar; the standard knows no other.
"""

import zipfile
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lxml import etree
from lxml.builder import ElementMaker

from ..units.errors import InvalidInput
from .annotations import TOOL
from .archive import add, put_in_place
from .layout import scalar_names
from .system import Component, Shape, System, Value

#: The file that makes an archive a package.
STRUCTURE = "SystemStructure.ssd"

#: Namespaces of SSP 1.0, and of the annotation in which libcosim looks for its step.
NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
}
_OSP = {"osp": "http://opensimulationplatform.com/SSP/OSPAnnotations"}

#: Type of the annotation that holds what this project knows beyond the standard, as text.
ANNOTATION = f"{TOOL}.scenario"

_SSD = ElementMaker(namespace=NAMESPACES["ssd"], nsmap=NAMESPACES | _OSP)
_SSC = ElementMaker(namespace=NAMESPACES["ssc"], nsmap=NAMESPACES)
_SSV = ElementMaker(namespace=NAMESPACES["ssv"], nsmap={key: NAMESPACES[key] for key in ("ssv", "ssc")})
_HINT = ElementMaker(namespace=_OSP["osp"], nsmap=_OSP)
_OWN = ElementMaker(namespace=TOOL, nsmap={None: TOOL})

_BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


def write_ssp(
    system: System, path: Path, annotation: str | None = None, extra: Mapping[str, bytes] | None = None
) -> Path:
    """Write `system` to the file `path` and return it.

    `annotation` is text that belongs to the whole system, and `extra` are files, by their names in the folder `extra`.

    Raises
    ------
    InvalidInput
        If two FMUs mean different things by the same name of a unit of measure.
    """
    with put_in_place(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        add(archive, STRUCTURE, _text(_structure(system, annotation)))
        for component in system.components:
            if component.given:
                add(archive, _parameter_file(component), _text(_parameter_set(component, system.name)))
        for fmu, name in system.files.items():
            add(archive, f"resources/{name}", fmu.read_bytes(), zipfile.ZIP_STORED)
        for name, content in (extra or {}).items():
            add(archive, f"extra/{name}", content, zipfile.ZIP_STORED)
    return path


def _text(element: Any) -> bytes:
    text: bytes = etree.tostring(element, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return text


def _parameter_file(component: Component) -> str:
    return f"resources/{component.name}.ssv"


def _structure(system: System, annotation: str | None) -> Any:
    root = _SSD.SystemStructureDescription(
        {"version": "1.0", "name": system.name, "generationTool": f"{TOOL} {version(TOOL)}"},
        _SSD.System(
            {"name": system.name},
            _SSD.Elements(*(_component(system, component) for component in system.components)),
            *_connections(system),
        ),
    )
    root.extend(_units(_SSD, [(component, _shown(system, component)) for component in system.components]))
    step = _HINT.Algorithm(_HINT.FixedStepAlgorithm({"baseStepSize": repr(system.step_s)}))
    hint = _SSD.Annotations(_SSC.Annotation({"type": "com.opensimulationplatform"}, step))
    root.append(_SSD.DefaultExperiment({"startTime": "0.0", "stopTime": repr(system.stop_s)}, hint))
    if annotation is not None:
        root.append(_SSD.Annotations(_SSC.Annotation({"type": ANNOTATION}, _OWN.Scenario(annotation))))
    return root


def _component(system: System, component: Component) -> Any:
    element = _SSD.Component(
        {
            "name": component.name,
            "type": "application/x-fmu-sharedlibrary",
            "source": f"resources/{system.files[component.fmu]}",
            "implementation": "CoSimulation",
        }
    )
    kinds = {"input": system.linked_inputs(component), "output": _visible_outputs(system, component)}
    connectors = [
        _SSD.Connector({"name": scalar, "kind": kind}, *_type(component, scalar, name, shape))
        for kind, fields in kinds.items()
        for name, shape in fields.items()
        for scalar in scalar_names(name, shape)
    ]
    if connectors:
        element.append(_SSD.Connectors(*connectors))
    if component.given:
        element.append(_SSD.ParameterBindings(_SSD.ParameterBinding({"source": _parameter_file(component)})))
    return element


def _type(component: Component, scalar: str, name: str, shape: Shape) -> list[Any]:
    """The element for the type of a connector; an enumeration has none, as the FMU has its items."""
    kind = component.variables[scalar].type
    if kind == "Enumeration":
        return []
    return [_SSC(kind, _measured(component, component.unit_of(name, shape)) if kind == "Real" else {})]


def _visible_outputs(system: System, component: Component) -> dict[str, Shape]:
    """Outputs that feed something, and the numbers that a tool plots by itself.

    The other fields have no connectors, though the standard would have them: libcosim's time to read a package grows
    with the product of its connectors and connections. An input without a connection has none because FMPy then
    connects it to whatever it connected last.
    """
    linked = system.linked_outputs(component)
    return {name: shape for name, shape in component.outputs.items() if name in linked or not shape}


def _connections(system: System) -> Iterator[Any]:
    elements = []
    for link in system.links:
        for output, target in link.scalars():
            ends = {"startElement": link.source, "startConnector": output}
            ends |= {"endElement": link.target, "endConnector": target}
            if link.law is None:
                elements.append(_SSD.Connection(ends))
                continue
            # What is transformed by hand is not to be converted once more by units of measure.
            law = _SSC.LinearTransformation({"factor": repr(link.law[0]), "offset": repr(link.law[1])})
            elements.append(_SSD.Connection(ends | {"suppressUnitConversion": "true"}, law))
    if elements:
        yield _SSD.Connections(*elements)


# --- units of measure -------------------------------------------------------------------------------------------------


def _shown(system: System, component: Component) -> set[str | None]:
    """Units of the connectors of `component`."""
    fields = system.linked_inputs(component) | _visible_outputs(system, component)
    return {component.unit_of(name, shape) for name, shape in fields.items()}


def _units(maker: Any, used: Iterable[tuple[Component, set[str | None]]]) -> list[Any]:
    """The element of all unit definitions, in the namespace of `maker`; none if there is nothing to define."""
    bases: dict[str, dict[str, str]] = {}
    for component, names in used:
        for name in names & component.units.keys():
            base = _base(component.units[str(name)])
            if bases.setdefault(str(name), base) != base:
                raise InvalidInput(
                    f"the FMU {component.fmu.name} of '{component.name}' defines the unit of measure '{name}' "
                    "otherwise than another FMU; a package has one definition"
                )
    elements = [_SSC.Unit({"name": name}, _SSC.BaseUnit(base)) for name, base in sorted(bases.items())]
    return [maker.Units(*elements)] if elements else []


def _base(unit: Any) -> dict[str, str]:
    exponents = {key: str(getattr(unit, key)) for key in _BASE_UNITS if getattr(unit, key)}
    return exponents | {"factor": repr(float(unit.factor)), "offset": repr(float(unit.offset))}


def _measured(component: Component, unit: str | None) -> dict[str, str]:
    """The attribute for a unit that the FMU defines; one that it only names stays with the FMU."""
    return {"unit": unit} if unit in component.units else {}


# --- parameters -------------------------------------------------------------------------------------------------------


def _parameter_set(component: Component, name: str) -> Any:
    """The values of `component`; the sets of a system have one name, because Ecos is asked for all of them by that."""
    values = list(component.values())
    root = _SSV.ParameterSet(
        {"version": "1.0", "name": name},
        _SSV.Parameters(*(_SSV.Parameter({"name": value.name}, _typed(component, value)) for value in values)),
    )
    root.extend(_units(_SSV, [(component, {value.unit for value in values if value.fmi_type == "Real"})]))
    return root


def _typed(component: Component, value: Value) -> Any:
    if value.fmi_type == "Enumeration":
        # A parameter set has the names of items, where FMI has their numbers.
        items = component.variables[value.name].declaredType.items
        named = {str(item.value): item.name for item in items}
        if value.text not in named:
            raise InvalidInput(
                f"'{value.name}' of '{component.name}' has no item {value.text} (known: {', '.join(named)})"
            )
        return _SSV.Enumeration({"value": named[value.text]})
    unit = _measured(component, value.unit) if value.fmi_type == "Real" else {}
    return _SSV(value.fmi_type, {"value": value.text} | unit)
