"""A mesh of twelve elements, its FMUs, a driver that knows FMI only, and what a unit does without FMI."""

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.geometry import registry
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

HERE = Path(__file__).parent

_spec = importlib.util.spec_from_file_location("fmi_driver", HERE / "fmi_driver.py")
assert _spec is not None
assert _spec.loader is not None
_fmi_driver = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_fmi_driver)

#: Parameters other than the defaults: of every FMI type, and such that every input matters.
PARAMETERS: dict[str, dict[str, Any]] = {
    "fiber_generator": {"endocardial_angle_deg": 51.5},
    "electrophysiology": {"activation_time_map": "as_printed", "longest_substep_ms": 0.05},
    "active_stress": {"length_dependence": 0.7, "delay_slope_per_mV": 0.5},
    "eikonal": {"activation_time_map": "as_printed", "diffusion_anisotropic_mm2_per_ms": 0.3},
    "local_mechanics": {"hold": "isometric", "shear_modulus_MPa": 0.3},
    "mechanics": {"newton_iterations": 30, "shear_modulus_MPa": 0.3},
    "mass": {"k": 5.0, "k_c": 20.0, "c_c": 0.5, "x_start": 1.0},
    "response": {"gain": -0.7, "delay_rate_per_ms": 0.4, "rate_gain_ms": 0.3, "disturbance": 0.2},
}

Fields = dict[str, np.ndarray]


def _tiny() -> Mesh:
    """Two ventricles of 16 nodes and 24 elements: the left one is the wall between two pyramids on their heads.

    A second layer runs around it and leaves it on the right, where it encloses the other cavity.
    """
    corners = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], dtype=float)
    outer = 40 * corners + [[20.0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
    points = np.vstack([20 * corners, [[0, 0, -50]], 30 * corners, [[0, 0, -60]], outer, [[0, 0, -70]], [[50, 0, 0]]])
    inner_wall = [((side, (side + 1) % 4, 4), 5) for side in range(4)]
    around = [((15, 6, 9), 5), ((6, 7, 9), 5), ((7, 8, 9), 5), ((8, 15, 9), 5)]
    cells = []
    for triangle, further in (*inner_wall, *around):
        # A prism cut in the order of its node numbers, so that neighbours agree on the diagonal between them.
        a, b, c = sorted(triangle)
        beyond = {node: 10 if node == 15 else node + further for node in triangle}
        cells += [[a, b, c, beyond[c]], [a, b, beyond[b], beyond[c]], [a, beyond[a], beyond[b], beyond[c]]]
    numbers = np.array(cells)
    inverted = np.linalg.det(points[numbers[:, 1:]] - points[numbers[:, :1]]) < 0.0
    numbers[inverted] = numbers[inverted][:, [0, 2, 1, 3]]
    surface = Mesh(points, numbers).surface
    base = (points[surface, 2] == 0.0).all(axis=1)
    inside, outside = (surface < 5).all(axis=1), ((surface >= 10) & (surface < 15)).all(axis=1)
    free = (surface == 15).any(axis=1) & ~base
    boundaries = {
        "base": surface[base],
        "lv_endocardium": surface[inside],
        "epicardium": surface[outside],
        "rv_endocardium": surface[free],
        "rv_septum": surface[~(base | inside | outside | free)],
    }
    return Mesh(points, numbers, boundaries)


@dataclass(frozen=True)
class Case:
    """A unit, what it is given, and what it does with it when called directly."""

    unit: str
    mesh: Mesh
    parameters: dict[str, Any]
    fixed: Fields
    inputs: list[Fields]
    #: Times and sizes of the steps in s, which are of different lengths.
    steps: tuple[tuple[float, float], ...] = ((0.0, 1e-3), (1e-3, 0.5e-3), (1.5e-3, 2.5e-3), (4e-3, 1e-3))
    expected: list[Fields] = field(default_factory=list)

    def first(self) -> Fields:
        return self.fixed | self.inputs[0]

    def compare(self, seen: Mapping[str, Any], number: int) -> None:
        """Outputs after so many steps are those of the unit, to the last bit."""
        assert set(seen) == set(self.expected[number])
        for name, values in self.expected[number].items():
            np.testing.assert_array_equal(np.array(seen[name]), values.ravel(), err_msg=name)

    def run(self, driver: Any, first: int = 0) -> None:
        """The steps from number `first` on, each compared with the unit's own."""
        for number in range(first, len(self.steps)):
            assert driver.step(*self.steps[number], self.inputs[number]) == 0, driver.errors()
            self.compare(driver.outputs(), number + 1)


def _native(case: Case) -> list[Fields]:
    kind = UNITS[case.unit]
    unit = kind(case.mesh)
    unit.instantiate(case.parameters)
    unit.setup_experiment()
    unit.enter_initialization_mode()
    for name, values in case.first().items():
        unit.set(name, values)
    unit.exit_initialization_mode()
    names = [variable.name for variable in kind.outputs()]
    seen = [{name: np.array(unit.get(name)) for name in names}]
    for (time, size), inputs in zip(case.steps, case.inputs, strict=True):
        for name, values in inputs.items():
            unit.set(name, values)
        unit.do_step(time, size)
        seen.append({name: np.array(unit.get(name)) for name in names})
    return seen


def _cases(mesh: Mesh) -> dict[str, Case]:
    fibers = _native(Case("fiber_generator", mesh, {}, {}, [{}] * 4))[0]
    random = np.random.default_rng(7)
    ranges = {"potential": (-80.0, 20.0), "stretch": (0.95, 1.05), "active_stress": (0.0, 5.0)}
    ranges |= {"lv_pressure": (0.0, 2.0), "rv_pressure": (0.0, 0.5)}
    ranges |= dict.fromkeys(("F_in", "x_in", "v_in", "u"), (-1.0, 1.0))
    ranges |= {"active_stiffness": (0.0, 50.0), "reference_stretch": (0.95, 1.05)}
    cases = {}
    for name, kind in UNITS.items():
        taken = kind.inputs()
        fixed = {variable.name: fibers[variable.name] for variable in taken if variable.fixed}
        varying = [variable for variable in taken if not variable.fixed]
        inputs = [
            {v.name: np.asarray(random.uniform(*ranges[v.name], v.shape(mesh))) for v in varying} for _ in range(4)
        ]
        case = Case(name, mesh, PARAMETERS[name], fixed, inputs)
        case.expected.extend(_native(case))
        cases[name] = case
    return cases


@pytest.fixture(scope="session")
def tiny() -> Mesh:
    """A very small mesh with all boundaries: 16 nodes, 24 elements."""
    return _tiny()


@pytest.fixture(scope="session")
def cases(tiny: Mesh) -> dict[str, Case]:
    """Of every unit, inputs for four steps on the tiny mesh, and its outputs when it is called without FMI."""
    return _cases(tiny)


@pytest.fixture(scope="session", params=[2, 3])
def fmi(request: pytest.FixtureRequest) -> int:
    """The version of FMI: what is tested with it holds for both."""
    return int(request.param)


@pytest.fixture(params=list(UNITS))
def case(request: pytest.FixtureRequest, cases: dict[str, Case]) -> Case:
    """Each unit's."""
    return cases[request.param]


@pytest.fixture(params=["electrophysiology", "active_stress", "mechanics"])
def stepping(request: pytest.FixtureRequest, cases: dict[str, Case]) -> Case:
    """Those of the units that change in a step and have fields."""
    return cases[request.param]


@pytest.fixture(scope="session")
def fmus(tiny: Mesh, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The FMI 2.0 FMUs of all units on the tiny mesh."""
    folder = tmp_path_factory.mktemp("tiny")
    return {name: build_fmu(unit, tiny, folder / f"{name}.fmu") for name, unit in UNITS.items()}


@pytest.fixture(scope="session")
def fmus3(tiny: Mesh, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The FMI 3.0 FMUs of all units on the tiny mesh."""
    folder = tmp_path_factory.mktemp("tiny3")
    return {name: build_fmu(unit, tiny, folder / f"{name}.fmu", fmi=3) for name, unit in UNITS.items()}


@pytest.fixture(scope="session")
def packed(fmi: int, request: pytest.FixtureRequest) -> dict[str, Path]:
    """The FMUs of all units on the tiny mesh, of the version that is tested."""
    fmus: dict[str, Path] = request.getfixturevalue("fmus" if fmi == 2 else "fmus3")
    return fmus


@pytest.fixture(scope="session")
def baseline() -> Mesh:
    """The heart that is shipped, 5 mm."""
    return registry.build("biventricle", 5.0)


@pytest.fixture(scope="session")
def baseline_fmus(baseline: Mesh, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The FMUs of all units on the baseline heart."""
    folder = tmp_path_factory.mktemp("baseline")
    return {name: build_fmu(unit, baseline, folder / f"{name}.fmu") for name, unit in UNITS.items()}


@pytest.fixture
def drive() -> Iterator[Callable[..., Any]]:
    """Instantiate an FMU with the driver of its version; freed when the test ends."""
    drivers = []

    def make(path: Path, instance: str = "driven", **rest: Any) -> Any:
        drivers.append(_fmi_driver.drive(path, instance, **rest))
        return drivers[-1]

    yield make
    for driver in drivers:
        driver.close()


@pytest.fixture
def make(packed: dict[str, Path], drive: Callable[..., Any]) -> Callable[..., Any]:
    """Instantiate the FMU of a unit on the tiny mesh, of the version that is tested."""
    return lambda unit, *rest, **named: drive(packed[unit], *rest, **named)


@pytest.fixture(scope="session")
def outside() -> Callable[..., str]:
    """Run Python text in a process of its own that has FMPy and the driver but cannot import this project."""
    preamble = f"""
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "cardiac_cosim":
            raise ImportError("this process knows nothing of the project")
sys.meta_path.insert(0, Blocker())
sys.path.insert(0, {str(HERE)!r})
from fmi_driver import drive
"""

    def run(text: str, *arguments: Any, block: bool = True) -> str:
        done = subprocess.run(
            [sys.executable, "-c", (preamble if block else "") + text, *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=120,
            env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        )
        assert done.returncode == 0, f"exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    return run
