"""Units as a theory sees them, and scenarios that are run against what it says."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.mechanics import LocalMechanics, Mechanics
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.stability.theory import Coupled, Setting
from cardiac_cosim.units.variable import Causality

_MECHANICS = {kind.name: kind for kind in (Mechanics, LocalMechanics)}


def _setting(kind: str, **parameters: Any) -> Setting:
    variables = UNITS[kind].variables()
    defaults = {item.name: item.start for item in variables if item.causality is Causality.PARAMETER}
    return Setting(kind, defaults | parameters)


@pytest.fixture(scope="session")
def setting() -> Callable[..., Setting]:
    """A unit of a kind with some parameters, the others being the defaults."""
    return _setting


@pytest.fixture
def rows(tmp_path: Path) -> Callable[..., np.ndarray]:
    """The time series of a scenario, run natively over so many steps with some values set; a row a step."""

    def run(scenario: Path, step_ms: float, steps: int, sets: Mapping[str, Any]) -> np.ndarray:
        whole = {
            "coupling.step_ms": step_ms,
            "run.stop_ms": step_ms * steps,
            "output.every_ms": step_ms * steps,
            "run.participants": "native",
            "run.checkpoint_every": 0,
            **sets,
        }
        folder = tmp_path / f"run-{len(list(tmp_path.iterdir()))}"
        run_scenario(
            load_scenario(scenario, [f"{key}={value}" for key, value in whole.items()]), scenario.parent, folder
        )
        return np.genfromtxt(folder / "timeseries.csv", delimiter=",", names=True)

    return run


@pytest.fixture(scope="session")
def growth() -> Callable[[np.ndarray], float]:
    """The factor per row by which values, shape (rows, values), grow: the spectral radius of what lies behind them.

    A linear map is fitted from four rows to the four that begin one later (dynamic mode decomposition, Schmid 2010).
    """

    def measured(values: np.ndarray) -> float:
        windows = np.hstack([values[place : len(values) - 4 + place] for place in range(5)])
        now, following = windows[:, : -values.shape[1]], windows[:, values.shape[1] :]
        scale = np.linalg.norm(now, axis=1, keepdims=True)
        basis, sizes, right = np.linalg.svd((now / scale).T, full_matrices=False)
        kept = sizes > 1e-10 * sizes[0]
        matrix = (basis[:, kept].T @ (following / scale).T @ right[kept].T) / sizes[kept]
        return float(np.abs(np.linalg.eigvals(matrix)).max())

    return measured


@pytest.fixture(scope="session")
def coupled() -> Callable[..., Coupled]:
    """A system of fibres, active stress and mechanics: mesh, mechanics, length dependence, stabilisation; and more."""

    def make(mesh: Mesh | None, kind: str, eta: float, share: float = 0.0, **more: Any) -> Coupled:
        parameters = more.pop("parameters", {})
        units = {
            "fibers": _setting("fiber_generator"),
            "tension": _setting("active_stress", length_dependence=eta),
            "wall": _setting(kind, stabilization=share, **parameters),
        }
        given = {"jacobi": False, "step_ms": 1.0, "mesh": None if mesh is None else lambda: mesh} | more
        return Coupled(units, **given)

    return make


@pytest.fixture
def disturbed(started: Any) -> Callable[..., list[float]]:
    """How far the stretch is from the plateau after each step of an explicit run that begins a little off it.

    Of mesh, mechanics, length dependence, stabilisation, scheme, and order of the extrapolation.
    """

    def measure(
        mesh: Mesh, kind: str, eta: float, share: float = 0.0, jacobi: bool = False, order: int = 0, steps: int = 30
    ) -> list[float]:
        # Finely solved, so that what grows is the disturbance and not what an equilibrium leaves.
        fine = {"equilibrium_tolerance": 1e-11} if kind == "mechanics" else {}
        generator = started(FiberGenerator, mesh)
        directions = {name: generator.get(name) for name in ("fiber", "sheet")}
        tension = started(ActiveStress, mesh, {"length_dependence": eta})
        settled = started(_MECHANICS[kind], mesh, fine, **directions)
        wall = started(_MECHANICS[kind], mesh, fine | {"stabilization": share}, **directions)
        stretch = settled.get("stretch")
        for number in range(60):
            tension.set("potential", np.full(mesh.nodes, min(-70.0 + 10.0 * number, 20.0)))
            tension.set("stretch", stretch)
            tension.do_step(0.0, 1e3)
            outputs = {name: tension.get(name) for name in _EXCHANGED}
            for unit in (settled, wall) if number == 59 else (settled,):
                for name, values in outputs.items():
                    unit.set(name, values)
                unit.do_step(0.0, 1.0)
            stretch = settled.get("stretch")
        noise = 1e-6 * np.random.default_rng(4).standard_normal(mesh.elements)
        stretches, given = [stretch] * 3 + [stretch * (1.0 + 1e-6 + noise)], [outputs] * 4
        course = []
        for _ in range(steps):
            tension.set("stretch", _ahead(stretches, order))
            tension.do_step(0.0, 1e-3)
            outputs = {name: tension.get(name) for name in _EXCHANGED}
            for name in _EXCHANGED:
                wall.set(name, _ahead([values[name] for values in given], order) if jacobi else outputs[name])
            wall.do_step(0.0, 1e-3)
            stretches.append(wall.get("stretch"))
            given.append(outputs)
            course.append(float(np.linalg.norm(stretches[-1] - stretch)))
        return course

    return measure


_EXCHANGED = ("active_stress", "active_stiffness", "reference_stretch")


def _ahead(values: list[np.ndarray], order: int) -> np.ndarray:
    weights = {0: [1.0], 1: [2.0, -1.0], 2: [3.0, -3.0, 1.0]}[order]
    return sum(weight * value for weight, value in zip(weights, reversed(values), strict=False))
