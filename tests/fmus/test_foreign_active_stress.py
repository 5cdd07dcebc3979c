"""If these failed, our heart would beat with our own units only: nobody could put a muscle of theirs into it."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.mesh import Mesh
from fmpy.validation import validate_fmu

#: Of the largest value of a quantity. exp and expm1 are the C library's there and NumPy's here, which differ in the
#: last bits of a double; after a heartbeat 4e-14 was left of that.
_ROUNDING = 1e-12

#: Which of the equilibria within the tolerance is found depends on those last bits.
_BALANCED = "units.mechanics.parameters={equilibrium_tolerance: 1e-10}"
_ITERATED = "coupling.iterate={acceleration: anderson, converge: {active_stress: {relative: 1e-6}}}"


def _builder() -> Any:
    path = Path(__file__).parent / "foreign" / "build_active_stress.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def muscle(small_heart: Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = _builder().build_active_stress(tmp_path_factory.mktemp("muscle") / "muscle.fmu", small_heart.nodes)
    return path


def _beat(scenario: Path, folder: Path, *sets: str) -> np.ndarray:
    run_scenario(load_scenario(scenario, sets), scenario.parent, folder)
    return np.genfromtxt(folder / "timeseries.csv", delimiter=",", names=True)


def test_the_foreign_fmu_is_one_by_the_standard(tmp_path: Path) -> None:
    assert validate_fmu(str(_builder().build_active_stress(tmp_path / "muscle.fmu", 3))) == []


@pytest.mark.parametrize(
    "sets",
    [
        ("coupling.step_ms=10", "run.stop_ms=320", "output.every_ms=320", _BALANCED),
        ("coupling.step_ms=5", "run.stop_ms=60", "coupling.scheme=jacobi", _BALANCED),
        ("coupling.step_ms=5", "run.stop_ms=30", _ITERATED, _BALANCED),
    ],
    ids=["gauss-seidel", "jacobi", "iterated"],
)
def test_a_muscle_of_somebody_else_gives_the_same_heartbeat(
    sets: tuple[str, ...], small_scenario: Path, muscle: Path, tmp_path: Path
) -> None:
    # Other values than the defaults of either, so that a parameter that does not arrive is seen.
    given = "{tension_per_potential_MPa_per_mV: 0.004, fast_rate_per_ms: 0.8, delay_slope_per_mV: 0.5}"
    own = _beat(small_scenario, tmp_path / "own", *sets, f"units.active_stress.parameters={given}")
    theirs = _beat(
        small_scenario, tmp_path / "theirs", *sets, f"units.active_stress={{fmu: {muscle}, parameters: {given}}}"
    )
    assert own.dtype.names is not None
    assert len(own) == len(theirs) > 6
    assert set(own.dtype.names) <= set(theirs.dtype.names or ())
    for name in own.dtype.names:
        np.testing.assert_allclose(
            theirs[name], own[name], rtol=0, atol=_ROUNDING * np.abs(own[name]).max(), err_msg=name
        )
    # It beats: the muscle pulls, and the ventricle gives way.
    assert own["active_stress_mean_kPa"].max() > 20.0
    assert np.ptp(own["lv_volume_ml"]) > 1.0
