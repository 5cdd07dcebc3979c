"""If these fail, an FMU serves for one run only, or hides what happened in it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.fmus import build
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

Make = Callable[..., Any]


def test_reset_starts_anew(case: Any, make: Make) -> None:
    driver = make(case.unit)
    for _ in range(2):
        driver.start(case.parameters, case.first())
        case.compare(driver.outputs(), 0)
        case.run(driver)
        assert driver.reset() == 0
    # Back to the declared start values, too.
    for name in case.parameters:
        assert driver.parameter(name) == UNITS[case.unit].variable(name).start
    assert driver.messages == []


def test_terminate_free_and_instantiate_again(case: Any, make: Make) -> None:
    driver = make(case.unit)
    for _ in range(2):
        driver.start(case.parameters, case.first())
        case.run(driver)
        assert driver.terminate() == 0
        case.compare(driver.outputs(), 4)
        assert driver.messages == []
        driver.free()
        driver.instantiate()


def test_a_failing_step_is_discarded_and_changes_nothing(make: Make, tiny: Mesh) -> None:
    driver, other = make("active_stress"), make("active_stress")
    for one in (driver, other):
        one.start({"delay_function": "as_printed"}, {})
        assert one.step(0.0, 1e-3, {"potential": np.full(tiny.nodes, -79.0)}) == 0
    before = driver.outputs()
    depolarised = np.full(tiny.nodes, -79.0)
    depolarised[4] = 20.0
    for _ in range(2):
        assert driver.step(1e-3, 1e-3, {"potential": depolarised}) == 2
        ((status, category, text),) = driver.messages
        # The reason is an error, though the step is one that may be tried again.
        assert (status, category) == (3, "logStatusError")
        assert "at node 4 (potential 20.0 mV)" in text
        assert "delay_function: gompertz" in text
        driver.messages.clear()
        assert driver.outputs() == before
        assert driver.reached() == 1e-3
    # With a potential that it can follow it goes on as if nothing had been tried.
    for one in (driver, other):
        assert one.step(1e-3, 1e-3, {"potential": np.full(tiny.nodes, -78.0)}) == 0
    assert driver.outputs() == other.outputs() != before
    assert driver.packed() == other.packed()


@pytest.mark.parametrize(("unit", "boundary"), [("mechanics", "base"), ("fiber_generator", "epicardium")])
def test_a_mesh_without_a_boundary(
    unit: str, boundary: str, fmi: int, tiny: Mesh, cases: dict, drive: Make, tmp_path: Path
) -> None:
    mesh = Mesh(tiny.points, tiny.cells, {name: faces for name, faces in tiny.boundaries.items() if name != boundary})
    driver = drive(build_fmu(UNITS[unit], mesh, tmp_path / "x.fmu", fmi))
    driver.start({}, cases[unit].first())
    assert driver.refused == [("ExitInitializationMode", 3)]
    ((status, category, text),) = driver.messages
    assert (status, category) == (3, "invalidInput")
    assert f"no boundary named '{boundary}'" in text
    # The initialization has not ended: outputs have no values yet.
    assert all(np.isnan(values).all() for values in driver.outputs().values())


def test_a_bug_in_a_unit_is_told_with_its_traceback(
    fmi: int, tiny: Mesh, drive: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = build.sources()
    broken = files["units/active_stress.py"].replace(b"        rate = self._tension.rate(potential)", b"        1 / 0")
    assert broken != files["units/active_stress.py"]
    monkeypatch.setattr(build, "sources", lambda: files | {"units/active_stress.py": broken})
    driver = drive(build_fmu(UNITS["active_stress"], tiny, tmp_path / "x.fmu", fmi))
    driver.start({}, {})
    # Nobody foresaw it: an error, and no step that might be tried with another size.
    assert driver.step(0.0, 1e-3) == 3
    ((status, category, text),) = driver.messages
    assert (status, category) == (3, "logStatusError")
    # First the reason, because hosts cut long messages.
    assert text.startswith("ZeroDivisionError: division by zero\n")
    assert "active_stress.py" in text
    assert "Traceback" in text
    assert driver.reached() == 0.0
