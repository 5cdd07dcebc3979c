"""Units as a theory sees them, and scenarios that are run against what it says."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.stability.theory import Setting
from cardiac_cosim.units.variable import Causality


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
