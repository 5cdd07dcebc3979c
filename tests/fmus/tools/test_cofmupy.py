"""If this failed, somebody with cofmupy would get another heartbeat from our FMUs than we do, or none."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from platformdirs import user_cache_path

_VERSION = "1.0.0"
#: It pins an FMPy older than ours, so that it has an environment of its own: almost a gigabyte, made once. (Asked for
#: at import, before tests are given a cache of their own.)
_ENVIRONMENT = user_cache_path("cardiac-cosim") / "tools" / f"cofmupy-{_VERSION}-python-{sys.version_info.minor}"

# Over a minute where the environment has to be made.
pytestmark = pytest.mark.long


@pytest.fixture(scope="session")
def python() -> Path:
    """The Python of an environment with cofmupy."""
    program = _ENVIRONMENT / "bin" / "python"
    complete = _ENVIRONMENT / "complete"
    if not complete.is_file():
        subprocess.run([sys.executable, "-m", "venv", "--clear", str(_ENVIRONMENT)], check=True)
        packages = [f"cofmupy=={_VERSION}", "scikit-fem", "meshio"]
        subprocess.run([str(program), "-m", "pip", "install", "--quiet", *packages], check=True)
        complete.touch()
    return program


def test_cofmupy_couples_the_cell_as_we_do(workshop: Any, python: Path, ours: Callable[..., Any]) -> None:
    workshop.follow("cofmupy", str(python))

    def fields(run: Any) -> np.ndarray:
        return np.array([run[name][1:, 0] for name in ("potential_mV", "active_stress_kPa", "stretch")])

    jacobi = fields(ours("cell", "run.stop_ms=30", "coupling.scheme=jacobi"))
    assert np.array_equal(workshop.load("cofmupy.npy"), jacobi)
    iterated = fields(
        ours("cell", "run.stop_ms=30", "coupling.iterate={converge: {stretch: {absolute: 1e-9}}, max_iterations: 50}")
    )
    # Shortened fibres conduct no current of stretch: the loop ends where it is entered, and both sides reach that.
    np.testing.assert_allclose(workshop.load("cofmupy-iterated.npy"), iterated, rtol=1e-12, atol=0)
    assert np.abs(jacobi - iterated).max() > 1.0
