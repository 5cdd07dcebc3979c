"""If this failed, our heart would not beat as an independent code's does: nobody should trust its numbers."""

from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.run import Outcome, run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.mesh.file import read_mesh

_DATA = Path(__file__).parent / "data"
_SCENARIO = Path(__file__).parent.parent / "scenarios" / "baseline.yaml"

#: Activation of the reference at the probes in ms (see data/README.md for where it comes from), and what is allowed:
#: twice the differences that the README shows.
_ACTIVATION = {"base": (4.91, 1.4), "middle": (68.52, 3.2), "apex": (102.83, 1.0)}


@pytest.fixture(scope="module")
def heartbeat(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    scenario = load_scenario(_SCENARIO, ["scene={mesh: reference_5mm.msh}", "run.participants=native"])
    return run_scenario(scenario, _DATA, tmp_path_factory.mktemp("reference"))


def test_activation_is_that_of_the_reference(heartbeat: Outcome) -> None:
    for probe, (expected, allowed) in _ACTIVATION.items():
        assert heartbeat.summary["activation_time_ms"][probe] == pytest.approx(expected, abs=allowed), probe


# Twice the differences that the README shows.
@pytest.mark.parametrize(
    ("column", "allowed"), [("lv_volume_ml", 0.12), ("rv_volume_ml", 0.12), ("apex_uplift_mm", 0.04)]
)
def test_course_is_that_of_the_reference_at_every_ten_milliseconds(
    heartbeat: Outcome, column: str, allowed: float
) -> None:
    expected = np.genfromtxt(_DATA / "reference_5mm.csv", delimiter=",", names=True)
    found = np.genfromtxt(heartbeat.folder / "timeseries.csv", delimiter=",", names=True)
    at = np.searchsorted(found["time_ms"], expected["time_ms"])
    np.testing.assert_allclose(found["time_ms"][at], expected["time_ms"])
    assert np.abs(found[column][at] - expected[column]).max() < allowed
    # The course is one of a heart that contracts: a flat line would not pass for one.
    assert np.ptp(expected[column]) > 10.0 * allowed


def test_last_region_to_depolarise_has_repolarised_furthest(heartbeat: Outcome) -> None:
    found = np.genfromtxt(heartbeat.folder / "timeseries.csv", delimiter=",", names=True)
    assert found["potential_apex_mV"][-1] < found["potential_middle_mV"][-1] < found["potential_base_mV"][-1] - 1.0


@pytest.mark.parametrize(("mass", "expected"), [("consistent", 115.8), ("lumped", 130.8)])
def test_wave_without_stretch_current_arrives_when_another_code_says(mass: str, expected: float) -> None:
    # Independent computation: currents at the nodes, Strang splitting, 0.2 ms; the node nearest (0, 0, -60).
    mesh = read_mesh(_DATA / "reference_5mm.msh")
    fibers = FiberGenerator(mesh)
    fibers.enter_initialization_mode()
    fibers.exit_initialization_mode()
    unit = Electrophysiology(mesh)
    unit.instantiate({"mass_matrix": mass, "ionic_current": "nodal", "stretch_conductance": 0.0})
    unit.enter_initialization_mode()
    unit.set("fiber", fibers.get("fiber"))
    unit.exit_initialization_mode()
    unit.do_step(0.0, 0.140)
    node = np.linalg.norm(mesh.points - [0.0, 0.0, -60.0], axis=1).argmin()
    assert unit.get("activation_time")[node] == pytest.approx(expected, abs=0.1)


def test_directions_are_those_of_the_reference() -> None:
    unit = FiberGenerator(read_mesh(_DATA / "reference_5mm.msh"))
    unit.enter_initialization_mode()
    unit.exit_initialization_mode()
    with np.load(_DATA / "reference_5mm_directions.npz") as stored:
        for name, worst, typical in (("sheet", 0.1, 0.05), ("fiber", 0.5, 0.01)):
            cosine = np.abs(np.einsum("ei,ei->e", unit.get(name), stored[name]))
            degrees = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
            # Wall distances are exact here; the reference's leave up to 0.4 degrees in the wedge's slivers.
            assert degrees.max() < worst
            assert np.median(degrees) < typical
