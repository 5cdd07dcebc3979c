"""If these fail, a study of accuracy leaves out an error that a unit makes, or refines what makes none."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Refinement, Variable

_VARIABLES = [(unit.name, variable) for unit in UNITS.values() for variable in unit.variables()]
_ROLES = [(unit, variable) for unit, variable in _VARIABLES if variable.refines is not None]

#: What those who add a unit call such parameters, or say of them.
_TELLING = re.compile(r"toleranc|\b[ar]tol|sub-?step|refine|residual", re.IGNORECASE)

each_role = pytest.mark.parametrize(
    ("unit", "variable"), _ROLES, ids=[f"{unit}.{variable.name}" for unit, variable in _ROLES]
)


def test_every_number_that_looks_like_a_tolerance_a_substep_or_a_refinement_has_a_role() -> None:
    looks = {
        (unit, variable.name)
        for unit, variable in _VARIABLES
        if variable.causality.value == "parameter"
        and not isinstance(variable.start, str | bool)
        and _TELLING.search(f"{variable.name} {variable.description}")
    }
    assert ("electrophysiology", "longest_substep_ms") in looks
    assert looks == {(unit, variable.name) for unit, variable in _ROLES}


@each_role
def test_a_role_is_on_a_number_that_can_be_refined(unit: str, variable: Variable) -> None:
    assert variable.causality.value == "parameter"
    assert type(variable.start) is (int if variable.refines is Refinement.MESH else float)
    if variable.refines is Refinement.STEP:
        assert variable.unit in ("ms", "s")
    # Studies divide until they are told that no smaller value is accepted.
    lowest = variable.above if variable.at_least is None else variable.at_least
    assert lowest is not None
    assert lowest >= 0.0
    finer = variable.start + 1 if variable.refines is Refinement.MESH else variable.start / 8
    assert variable.checked(finer) == finer


def _activation(started: Callable[..., Any], **parameters: float) -> np.ndarray:
    mesh = build("strand", 2.0)
    fiber = started(FiberGenerator, mesh).get("fiber")
    box = {"stimulus_x_min_mm": -1.0, "stimulus_x_max_mm": 8.0, "stretch_conductance": 0.0}
    unit = started(Electrophysiology, mesh, box | {"time_scale_reduction": 0.0} | parameters, fiber=fiber)
    unit.do_step(0.0, 0.05)
    return np.asarray(unit.get("activation_time")[5:10])


def _stretch(started: Callable[..., Any], mesh: Mesh, **parameters: float) -> np.ndarray:
    generator = started(FiberGenerator, mesh)
    unit = started(Mechanics, mesh, parameters, fiber=generator.get("fiber"), sheet=generator.get("sheet"))
    unit.set("active_stress", np.full(mesh.nodes, 50.0))
    unit.do_step(0.0, 1e-3)
    return np.asarray(unit.get("stretch"))


#: Of each parameter three values, each finer than the one before, and the last as good as none.
_FINER: dict[tuple[str, str], tuple[float, ...]] = {
    ("electrophysiology", "longest_substep_ms"): (0.5, 0.125, 0.01),
    ("electrophysiology", "refine"): (0, 1, 4),
    ("mechanics", "equilibrium_tolerance"): (5e-3, 1e-5, 1e-11),
}


@each_role
def test_the_error_falls_where_a_parameter_is_refined(
    unit: str, variable: Variable, started: Callable[..., Any], small_heart: Mesh
) -> None:
    values = _FINER[unit, variable.name]
    finer = np.sign(values[1] - values[0])
    assert (finer > 0) == (variable.refines is Refinement.MESH)
    results = [
        _activation(started, **{variable.name: value})
        if unit == "electrophysiology"
        else _stretch(started, small_heart, **{variable.name: value})
        for value in values
    ]
    coarse, fine = (float(np.abs(result - results[-1]).max()) for result in results[:2])
    assert 0.0 < fine < 0.5 * coarse
