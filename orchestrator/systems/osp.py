"""A system for libcosim and the other tools of the Open Simulation Platform.

`OspSystemStructure.xml` connects groups of variables, and a file `<model name>_OspModelDescription.xml` beside it says
what the groups of an FMU are: here one for every field. That is the fast way of a field into libcosim.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lxml import etree
from lxml.builder import ElementMaker

from ...fmus.archive import put_in_place
from ...fmus.layout import scalar_names
from ..errors import InputError
from .system import Component, System, Value

STRUCTURE = "OspSystemStructure.xml"

_STRUCTURE_NAMESPACE = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"
_MODEL_NAMESPACE = "https://open-simulation-platform.com/OspModelDescription/1.0.0"

_SYSTEM = ElementMaker(namespace=_STRUCTURE_NAMESPACE, nsmap={None: _STRUCTURE_NAMESPACE})
_MODEL = ElementMaker(namespace=_MODEL_NAMESPACE, nsmap={None: _MODEL_NAMESPACE})


def write_osp(system: System, folder: Path) -> Path:
    """Write the files for `system` and its FMUs to `folder`; the path of the system structure.

    Raises
    ------
    InputError
        If a link transforms its values, or two FMUs that differ have one model name, by which libcosim finds groups.
    """
    system.require_plain("libcosim")
    models: dict[str, Component] = {}
    for component in system.components:
        first = models.setdefault(component.description.modelName, component)
        if first.fmu != component.fmu:
            raise InputError(
                f"the FMUs of '{first.name}' and '{component.name}' are both called "
                f"{component.description.modelName} (modelName), and libcosim tells FMUs apart by that"
            )
    system.copy_fmus(folder)
    for model, component in models.items():
        _write(_groups(component), folder / f"{model}_OspModelDescription.xml")
    return _write(_structure(system), folder / STRUCTURE)


def _write(element: Any, path: Path) -> Path:
    with put_in_place(path) as part:
        part.write_bytes(etree.tostring(element, xml_declaration=True, encoding="UTF-8", pretty_print=True))
    return path


def _structure(system: System) -> Any:
    root = _SYSTEM.OspSystemStructure(
        {"version": "0.1"},
        _SYSTEM.StartTime("0.0"),
        _SYSTEM.BaseStepSize(repr(system.step_s)),
        _SYSTEM.Algorithm("fixedStep"),
        _SYSTEM.Simulators(*(_simulator(system, component) for component in system.components)),
    )
    if system.links:
        root.append(_SYSTEM.Connections(*_connections(system)))
    return root


def _simulator(system: System, component: Component) -> Any:
    source = {"name": component.name, "source": system.files[component.fmu], "stepSize": repr(system.step_s)}
    element = _SYSTEM.Simulator(source)
    if component.given:
        element.append(_SYSTEM.InitialValues(*(_initial(value) for value in component.values())))
    return element


def _initial(value: Value) -> Any:
    fmi_type = "Integer" if value.fmi_type == "Enumeration" else value.fmi_type
    return _SYSTEM.InitialValue({"variable": value.name}, _SYSTEM(fmi_type, {"value": value.text}))


def _connections(system: System) -> Iterator[Any]:
    for link in system.links:
        yield _SYSTEM.VariableGroupConnection(
            _SYSTEM.VariableGroup({"simulator": link.source, "name": link.output}),
            _SYSTEM.VariableGroup({"simulator": link.target, "name": link.input}),
        )


def _groups(component: Component) -> Any:
    groups = [
        _MODEL.Generic({"name": name}, *(_MODEL.Variable({"ref": scalar}) for scalar in scalar_names(name, shape)))
        for name, shape in (*component.inputs.items(), *component.outputs.items())
    ]
    return _MODEL.OspModelDescription({"version": "1.0"}, _MODEL.VariableGroups(*groups))
