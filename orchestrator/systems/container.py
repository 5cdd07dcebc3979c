"""A system for fmu-manipulation-toolbox, which makes one FMU of it, a container.

The tool takes scalars `x[1]`, …, `x[N]` together as the array `x`, so that one link carries a field.
"""

import json
from pathlib import Path
from typing import Any

from ...fmus.archive import put_in_place
from ...fmus.layout import scalar_names
from .system import Component, System


def write_container(system: System, folder: Path) -> Path:
    """Write `<system name>.json` and the FMUs of `system` to `folder`; the path of that file.

    The container's outputs are the scalar ones of its FMUs, as `<component>.<output>`.

    Raises
    ------
    InputError
        If a link transforms its values.
    """
    system.require_plain("fmu-manipulation-toolbox")
    # The tool knows an FMU by a file name: a second instance is given one of its own, and the file that it stands for.
    names = {component.name: _instance(system, component) for component in system.components}
    system.copy_fmus(folder)
    content: dict[str, Any] = {
        "name": f"{system.name}_container.fmu",
        "step_size": system.step_s,
        "auto_link": False,
        "auto_input": False,
        "auto_output": False,
        "fmu": [names[component.name] for component in _order(system)],
        "path": {names[item.name]: system.files[item.fmu] for item in system.components},
        "link": [[names[link.source], link.output, names[link.target], link.input] for link in system.links],
        "start": [
            [names[component.name], value.name, value.text]
            for component in system.components
            for value in component.values()
        ],
        "output": [
            [names[component.name], name, f"{component.name}.{name}"]
            for component in system.components
            for name, shape in component.outputs.items()
            if not shape
        ],
    }
    path = folder / f"{system.name}.json"
    with put_in_place(path) as part:
        part.write_text(json.dumps(content, indent=1), encoding="utf-8")
    return path


def _order(system: System) -> list[Component]:
    """The components as the tool is to initialise them: each after those that feed it, as far as loops allow.

    The input at which a loop is cut is initialised with 0, whatever its start value; so a loop is cut where that is the
    start value, if there is such a place.
    """
    order: list[Component] = []
    waiting = list(system.components)
    while waiting:
        feeding = {component.name for component in waiting}
        open_inputs = {
            component.name: {
                link.input for link in system.links if link.target == component.name and link.source in feeding
            }
            for component in waiting
        }
        ready = [component for component in waiting if not open_inputs[component.name]]
        harmless = [component for component in waiting if _start_at_zero(component, open_inputs[component.name])]
        order.append((ready or harmless or waiting)[0])
        waiting.remove(order[-1])
    return order


def _start_at_zero(component: Component, inputs: set[str]) -> bool:
    scalars = (scalar for name in inputs for scalar in scalar_names(name, component.inputs[name]))
    return all(_is_nothing(component.variables[scalar]) for scalar in scalars)


def _is_nothing(variable: Any) -> bool:
    """Whether a variable starts with what its type has for nothing."""
    if variable.type in ("String", "Boolean"):
        return variable.start in (None, "", "false", "0")
    return float(variable.start or 0.0) == 0.0


def _instance(system: System, component: Component) -> str:
    first = next(other for other in system.components if other.fmu == component.fmu)
    return system.files[component.fmu] if first is component else f"{component.name}.fmu"
