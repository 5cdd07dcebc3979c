"""A unit as theories query it: brought to its initial state, outside of any coupling."""

from collections.abc import Mapping
from typing import Any, TypeVar

from ..mesh import Mesh
from ..unit import Unit
from .theory import Moment

Started = TypeVar("Started", bound=Unit)


def started(kind: type[Started], mesh: Mesh, parameters: Mapping[str, Any], inputs: Moment) -> Started:
    """A unit after its initialisation, with those of `inputs` that it takes once."""
    unit = kind(mesh)
    unit.instantiate(parameters)
    unit.setup_experiment()
    unit.enter_initialization_mode()
    for variable in kind.inputs():
        if variable.fixed and variable.name in inputs:
            unit.set(variable.name, inputs[variable.name])
    unit.exit_initialization_mode()
    return unit
