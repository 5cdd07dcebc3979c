"""If these fail, it would not be known on which elements a wave stops."""

from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.stability.pinned_front import PinnedFront
from cardiac_cosim.units.stability.theory import Coupled, Setting
from cardiac_cosim.units.variable import Causality

_SCENARIOS = Path(__file__).parents[3] / "scenarios"
_FRONT = {
    "time_scale_reduction": 0,
    "diffusion_anisotropic_mm2_per_ms": 0,
    "stretch_conductance": 0,
    "recovery_rate": 0,
    "recovery_mu1": 0,
    "stimulus_x_max_mm": 31,
    "stimulus_potential_mV": 20,
}


def _amplification(size_mm: float, **changed: object) -> float:
    declared = {
        item.name: item.start for item in Electrophysiology.variables() if item.causality is Causality.PARAMETER
    }
    unit = Setting("electrophysiology", declared | _FRONT | changed)
    return PinnedFront().amplification(Coupled({"ep": unit}, False, 1.0, mesh=lambda: build("strand", size_mm)))


def _passes(size_mm: float, out: Path, **changed: object) -> bool:
    sets = [f"units.electrophysiology.parameters.{name}={value}" for name, value in (_FRONT | changed).items()]
    sets += [f"scene.mesh_size_mm={size_mm}", "run.participants=native", "run.stop_ms=2000", "output.every_ms=2000"]
    scenario = load_scenario(_SCENARIOS / "strand.yaml", [*sets, "coupling.step_ms=20"])
    return run_scenario(scenario, _SCENARIOS, out).summary["activation_time_ms"]["far"] is not None


@pytest.mark.parametrize(
    ("mass", "current"),
    [
        ("lumped", "nodal"),
        pytest.param("consistent", "nodal", marks=pytest.mark.long),
        pytest.param("consistent", "quadrature", marks=pytest.mark.long),
    ],
)
def test_a_wave_passes_just_below_the_predicted_threshold_and_stops_just_above(
    mass: str, current: str, tmp_path: Path
) -> None:
    size_mm = 10.0
    kind = {"mass_matrix": mass, "ionic_current": current}
    low, high = 0.02, 0.49
    for _ in range(20):
        middle = 0.5 * (low + high)
        passes = _amplification(size_mm, excitation_threshold=middle, **kind) < 1.0
        low, high = (middle, high) if passes else (low, middle)
    assert _passes(size_mm, tmp_path / "below", excitation_threshold=0.985 * low, **kind)
    assert not _passes(size_mm, tmp_path / "above", excitation_threshold=1.015 * high, **kind)


def test_elements_that_stop_a_wave_are_as_much_longer_as_the_front_is() -> None:
    # The front's width grows with the root of the diffusion.
    wide = _amplification(6.0, diffusion_isotropic_mm2_per_ms=4.0, excitation_threshold=0.3)
    assert wide == pytest.approx(_amplification(3.0, excitation_threshold=0.3), rel=1e-6)


def test_a_scene_that_is_no_strand_is_refused() -> None:
    with pytest.raises(InvalidInput, match="strand"):
        PinnedFront().amplification(
            Coupled({"ep": Setting("electrophysiology", {})}, False, 1.0, mesh=lambda: build("cell", 1.0))
        )
