"""If these fail, a host finds no function where the standard has one, or gets a crash instead of an error."""

import ctypes
from collections.abc import Callable
from typing import Any

import pytest
from cardiac_cosim.fmus import wrapper

Run = Callable[..., Any]

#: They need no instance, or are asked for one.
_WITHOUT_STATUS = {"GetVersion", "GetTypesPlatform", "FreeInstance"}

#: What no unit has, by the capability that the message names.
_ABSENT = {
    "hasEventMode is false": [
        "EnterEventMode",
        "EnterStepMode",
        "EvaluateDiscreteStates",
        "UpdateDiscreteStates",
    ],
    "structural parameters": ["EnterConfigurationMode", "ExitConfigurationMode"],
    "providesPerElementDependencies is false": ["GetNumberOfVariableDependencies", "GetVariableDependencies"],
    "maxOutputDerivativeOrder is 0": ["GetOutputDerivatives"],
    "no variables of type Clock": [
        *(f"Get{what}{how}" for what in ("Interval", "Shift") for how in ("Decimal", "Fraction")),
        *(f"Set{what}{how}" for what in ("Interval", "Shift") for how in ("Decimal", "Fraction")),
    ],
    "no ScheduledExecution": ["ActivateModelPartition"],
    "no ModelExchange": [
        "EnterContinuousTimeMode",
        "CompletedIntegratorStep",
        "SetTime",
        "SetContinuousStates",
        "GetContinuousStateDerivatives",
        "GetEventIndicators",
        "GetContinuousStates",
        "GetNominalsOfContinuousStates",
        "GetNumberOfEventIndicators",
        "GetNumberOfContinuousStates",
    ],
}


def _of(fmi: int, names: list[str]) -> list[str]:
    """Those that return a status and take an instance first."""
    plain = [name.removeprefix(f"fmi{fmi}") for name in names]
    return [name for name in plain if name not in _WITHOUT_STATUS and not name.startswith("Instantiate")]


def test_every_function_of_the_standard_is_there(fmi: int, functions: list[str]) -> None:
    assert len(functions) == {2: 34, 3: 75}[fmi]
    library = wrapper.library()
    assert library is not None
    shipped = ctypes.CDLL(str(library))
    assert [name for name in functions if not hasattr(shipped, name)] == []


def test_without_an_instance_every_function_is_an_error(run: Run, fmi: int, functions: list[str]) -> None:
    names = [f"fmi{fmi}{name}" for name in _of(fmi, functions)]
    assert run(fmi, *(f"void:{name}" for name in names), "free").lines == [f"{name} 3" for name in names]


def test_what_no_unit_has_names_the_capability(run: Run) -> None:
    for capability, names in _ABSENT.items():
        done = run(3, "new", *(f"call:fmi3{name}" for name in names), "free")
        assert done.lines[2::2] == [f"fmi3{name} 3" for name in names]
        for line in done.lines[1::2]:
            assert line.startswith("log 3 logStatusError env: this FMU")
            assert capability in line


def test_what_fmi_2_units_do_not_have_names_the_capability(run: Run) -> None:
    done = run(2, "new", "call:fmi2CancelStep", "call:fmi2GetRealOutputDerivatives", "free")
    assert done.lines[2::2] == ["fmi2CancelStep 3", "fmi2GetRealOutputDerivatives 3"]
    assert "canRunAsynchronuously is false" in done.lines[1]
    assert "maxOutputDerivativeOrder is 0" in done.lines[3]
    # Nothing is ever pending: asking for more is neither an error nor answered.
    names = ["fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"]
    assert run(2, "new", *(f"call:{name}" for name in names), "free").lines[1:] == [f"{name} 2" for name in names]


def test_zeros_for_everything_are_survived(run: Run, fmi: int, functions: list[str]) -> None:
    names = _of(fmi, functions)
    done = run(fmi, "new", *(f"call:fmi{fmi}{name}" for name in names), "free")
    statuses = [line.split() for line in done.lines[1:] if line.startswith("fmi")]
    assert [name for name, _ in statuses] == [f"fmi{fmi}{name}" for name in names]
    assert {int(status) for _, status in statuses} <= {0, 1, 2, 3}


def test_null_pointers_and_endless_arrays_are_refused(run: Run, fmi: int) -> None:
    lines = run(fmi, "new", "nulls", "free").lines[1:]
    answers = [line for line in lines if not line.startswith(("log", "update"))]
    # An instance that was refused is NULL; where nothing is to be freed, that is done; a step may give nothing back.
    fine = {line for line in answers if "!= NULL" in line or "FreeFMU" in line or "> 1" in line}
    assert len(fine) == {2: 7, 3: 10}[fmi]
    assert all(line.endswith(" 0") for line in fine)
    assert all(line.endswith(" 3") for line in set(answers) - fine)
    # Each says why, but for the ones that have no logger, or in FMI 3 ask for no log.
    assert sum(line.startswith("log") for line in lines) == len(answers) - {2: 2, 3: 10}[fmi]


@pytest.mark.parametrize("name", ["fmi2FreeInstance", "fmi3FreeInstance"])
def test_freeing_nothing_is_no_crash(name: str) -> None:
    library = wrapper.library()
    assert library is not None
    getattr(ctypes.CDLL(str(library)), name)(None)
