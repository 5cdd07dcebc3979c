"""The FMI 3.0 FMUs of all units on the mesh of twelve elements, and a driver that knows FMI 3.0 only."""

import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.fmus.fmi3.build import build_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

_spec = importlib.util.spec_from_file_location("fmi3_driver", Path(__file__).parent / "fmi3_driver.py")
assert _spec is not None
assert _spec.loader is not None
_fmi3_driver = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_fmi3_driver)


@pytest.fixture(scope="session")
def fmus3(tiny: Mesh, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The FMI 3.0 FMUs of all units on the tiny mesh."""
    folder = tmp_path_factory.mktemp("tiny3")
    return {name: build_fmu(unit, tiny, folder / f"{name}.fmu") for name, unit in UNITS.items()}


@pytest.fixture(params=list(UNITS))
def case(request: pytest.FixtureRequest, cases: dict) -> Any:
    """Of each unit, inputs for four steps and its outputs when it is called without FMI."""
    return cases[request.param]


@pytest.fixture
def drive3() -> Iterator[Callable[..., Any]]:
    """Instantiate an FMU with the driver; freed when the test ends."""
    drivers = []

    def make(path: Path, instance: str = "driven") -> Any:
        drivers.append(_fmi3_driver.Driver(path, instance))
        return drivers[-1]

    yield make
    for driver in drivers:
        driver.close()
