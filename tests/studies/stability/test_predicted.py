"""If these fail, a theory is asked about another system than the one that runs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.studies.stability import StabilityMap
from cardiac_cosim.units.errors import StepFailure
from cardiac_cosim.units.stability import registry
from cardiac_cosim.units.stability.theory import Theory

Mapped = Callable[..., StabilityMap]

_SCENARIO = """\
name: small_strand
scene: {geometry: strand, mesh_size_mm: 10}
units:
  fibers: {unit: fiber_generator}
  electrophysiology: {unit: electrophysiology, parameters: {time_scale_reduction: 0}}
  active_stress: {unit: active_stress, parameters: {slow_rate_per_ms: 0.2}}
  mechanics: {unit: local_mechanics}
coupling: {step_ms: 2}
run: {stop_ms: 20, participants: native}
output: {every_ms: 10}
"""

_STUDY = """\
name: asked
scenario: small_strand.yaml
theory: asking
reference: {coupling.step_ms: 1}
lines:
  - name: size
    vary: {coupling.interpolation: [hold, linear], coupling.step_ms: [2, 10]}
"""


class Asking(Theory):
    """Keeps what it is asked about; its limit is at 5 ms."""

    name: ClassVar[str] = "asking"
    formula: ClassVar[str] = "H < 5 ms"
    asked: list[Any]

    def __init__(self) -> None:
        self.asked = []

    def amplification(self, coupled: Any) -> float:
        self.asked.append(coupled)
        return float(coupled.step_ms / 5.0)


@pytest.fixture
def asking(monkeypatch: pytest.MonkeyPatch) -> Asking:
    theory = Asking()
    monkeypatch.setitem(registry.THEORIES, "asking", theory)
    return theory


@pytest.fixture
def study(tmp_path: Path) -> Path:
    (tmp_path / "small_strand.yaml").write_text(_SCENARIO)
    path = tmp_path / "asked.yaml"
    path.write_text(_STUDY)
    return path


def test_units_have_all_their_parameters_and_a_sound_run_lends_its_moments(
    study: Path, mapped: Mapped, asking: Asking
) -> None:
    (panel,) = mapped(study).panels
    assert [cell.predicted for cell in panel.cells] == [0.4, 2.0, 0.4, 2.0]
    held, linear = asking.asked[0], asking.asked[2]
    # Fibres are exchanged once, before all others.
    assert list(held.units) == ["fibers", "electrophysiology", "active_stress", "mechanics"]
    kinds = ["fiber_generator", "electrophysiology", "active_stress", "local_mechanics"]
    assert [unit.kind for unit in held.units.values()] == kinds
    given = held.units["active_stress"].parameters
    assert (given["slow_rate_per_ms"], given["fast_rate_per_ms"]) == (0.2, 1.0)
    # How inputs are exchanged is the coupling's affair, and no parameter of a unit.
    assert (held.linear, linear.linear) == (False, True)
    assert linear.units["active_stress"].parameters == given
    mesh = held.mesh()
    assert held.mesh() is mesh
    moments = held.moments()
    assert len(moments) == 3
    for moment in moments:
        assert moment["potential"].shape == moment["active_stress"].shape == (mesh.nodes,)
        assert moment["stretch"].shape == (mesh.elements,)
        assert moment["fiber"].shape == (mesh.elements, 3)
    assert moments[-1]["active_stress"].max() > 1.0
    np.testing.assert_array_equal(moments[0]["stretch"], 1.0)


def test_on_another_mesh_there_are_no_moments(study: Path, mapped: Mapped, asking: Asking) -> None:
    study.write_text(study.read_text().replace("reference: {", "reference: {scene.mesh_size_mm: 5, "))
    mapped(study)
    assert list(asking.asked[0].moments()) == []


def test_of_iterated_coupling_only_a_theory_of_single_units_says_something(
    study: Path, mapped: Mapped, asking: Asking, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = study.read_text().replace("reference: {coupling.step_ms: 1}\n", "").replace("[2, 10]", "[2]")
    iterate = "coupling.iterate: [null, {converge: {stretch: {relative: 1.0e-2}}}]"
    study.write_text(text.replace("coupling.interpolation: [hold, linear]", iterate))
    found = mapped(study)
    assert [cell.predicted for cell in found.cells] == [0.4, None]
    assert any("theory predicts nothing for 1 of 2 cells" in note for note in found.notes)
    monkeypatch.setattr(Asking, "of_exchange", False)
    assert [cell.predicted for cell in mapped(study).cells] == [0.4, 0.4]


def test_units_that_wait_are_beyond_a_theory_of_the_exchange(study: Path, mapped: Mapped, asking: Asking) -> None:
    study.write_text(study.read_text().replace("reference:", "set: {units.mechanics.every: 2}\nreference:"))
    with pytest.raises(
        InputError, match=r"theory: 'asking' is of units .* `units.mechanics.every` is 2; remove `every`"
    ):
        mapped(study)


def test_a_theory_without_a_result_predicts_nothing(
    study: Path, mapped: Mapped, asking: Asking, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(coupled: Any) -> float:
        raise StepFailure("no equilibrium")

    monkeypatch.setattr(asking, "amplification", fails)
    study.write_text(study.read_text().replace("reference: {coupling.step_ms: 1}\n", "").replace("[2, 10]", "[2]"))
    assert [cell.predicted for cell in mapped(study).cells] == [None, None]
