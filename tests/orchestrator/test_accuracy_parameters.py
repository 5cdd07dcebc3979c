"""If these fail, a study refines a unit from another value than it runs with, or asks for values that it refuses."""

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.participants.accuracy import AccuracyParameter
from cardiac_cosim.orchestrator.participants.native import accuracy_parameters, check_unit
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.registry import UNITS


@pytest.mark.parametrize("unit", sorted(UNITS))
def test_defaults_and_limits_are_those_that_the_unit_runs_with(unit: str) -> None:
    running = UNITS[unit](build("cell", 1.0))
    for name, parameter in accuracy_parameters(unit).items():
        assert parameter.name == name
        assert parameter.default == running.get(name)
        assert type(parameter.default) is (int if parameter.kind == "mesh" else float)
        lowest = parameter.lower_limit
        assert lowest > -1.0
        for value, accepted in (
            (lowest, parameter.limit_is_allowed),
            (lowest + 1 if parameter.kind == "mesh" else 1.001 * lowest + 1e-300, True),
            (lowest - 1 if parameter.kind == "mesh" else 0.999 * lowest - 1e-300, False),
        ):
            if accepted:
                check_unit(unit, {name: value})
            else:
                with pytest.raises(InputError, match=name):
                    check_unit(unit, {name: value})


def test_what_decides_the_error_of_the_waves_and_of_the_wall() -> None:
    assert dict(accuracy_parameters("electrophysiology")) == {
        "longest_substep_ms": AccuracyParameter("longest_substep_ms", "step", 0.25, 1e-4, True),
        "refine": AccuracyParameter("refine", "mesh", 0, 0, True),
    }
    assert dict(accuracy_parameters("mechanics")) == {
        "equilibrium_tolerance": AccuracyParameter("equilibrium_tolerance", "tolerance", 1e-6, 0.0, False)
    }
    # Exact in every step, or solved to rounding.
    assert not any(accuracy_parameters(unit) for unit in ("active_stress", "fiber_generator", "local_mechanics"))


def test_an_unknown_unit_is_named_with_the_one_that_was_meant() -> None:
    with pytest.raises(InputError, match="unknown unit 'mechanic'; did you mean 'mechanics'"):
        accuracy_parameters("mechanic")
