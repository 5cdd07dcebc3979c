"""If these fail, a map says that excited cells bear a substep that makes them rest where no cell rests."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.errors import InvalidInput, StepFailure
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.stability.reaction_step import ReactionStep, fastest_decay
from cardiac_cosim.units.stability.theory import Coupled

_NO_RECOVERY = {"recovery_rate": 0.0, "recovery_mu1": 0.0}


@pytest.fixture(scope="module")
def point() -> Mesh:
    return build("cell", 5.0)


@pytest.fixture
def cell(point: Mesh, setting: Any) -> Any:
    """A cell as the theory sees it, at a communication step that is one substep."""

    def make(step_ms: float, mesh: Mesh = point, **parameters: Any) -> Coupled:
        given = {"time_scale_reduction": 0.0, "longest_substep_ms": step_ms, **parameters}
        return Coupled({"wave": setting("electrophysiology", **given)}, False, step_ms, mesh=lambda: mesh)

    return make


@pytest.fixture
def potentials(point: Mesh, started: Any) -> Any:
    """The potential in mV after each of so many substeps, in time scales; None where the cell leaves its numbers."""

    def run(substep: float, count: int, scale_ms: float = 12.9, **parameters: Any) -> np.ndarray | None:
        step_ms = substep * scale_ms
        given = {"time_scale_ms": scale_ms, "time_scale_reduction": 0.0, "longest_substep_ms": step_ms}
        given |= {"explicit_limit": "ignored", **parameters}
        unit = started(Electrophysiology, point, given, fiber=[[1.0, 0.0, 0.0]])
        found = []
        for number in range(count):
            try:
                unit.do_step(1e-3 * step_ms * number, 1e-3 * step_ms)
            except StepFailure:
                return None
            found.append(float(unit.get("potential")[0]))
        return np.array(found)

    return run


@pytest.mark.parametrize("scale_ms", [5.8, 12.9, 14.3])
@pytest.mark.parametrize("excitation", [8.0, 11.0])
@pytest.mark.parametrize("side", [0.99, 1.01])
def test_the_plateau_is_left_where_it_is_predicted_to_be(
    scale_ms: float, excitation: float, side: float, potentials: Any, cell: Any
) -> None:
    # Without recovery the plateau lasts, at 20 mV: c (1 - alpha)/beta_t is how fast a cell is pulled back to it.
    limit = 2.0 / (excitation * 0.99)
    parameters = {**_NO_RECOVERY, "excitation_rate": excitation}
    predicted = ReactionStep().amplification(cell(side * limit * scale_ms, time_scale_ms=scale_ms, **parameters))
    assert predicted == pytest.approx(abs(1.0 - 2.0 * side + 2.0 * side * side), rel=1e-4)
    assert (predicted > 1.0) == (side > 1.0)
    found = potentials(side * limit, 2000, scale_ms, **parameters)
    if side < 1.0:
        assert found[-1] == pytest.approx(20.0, abs=1e-6)
    else:
        # At rest, too, but elsewhere: a wrong number that looks like a right one.
        assert found[-1] == found[-2]
        assert 0.1 < abs(found[-1] - 20.0) < 2.0


def test_with_recovery_the_limit_is_nearly_the_same_and_follows_the_smallest_time_scale(cell: Any) -> None:
    decay = fastest_decay(cell(0.25))
    assert decay == pytest.approx(8.0 * 0.99 / 12.9, rel=2e-3)
    assert fastest_decay(cell(0.25, time_scale_ms=5.8)) == pytest.approx(decay * 12.9 / 5.8, rel=1e-6)
    # In the heart it falls from 14.3 ms at the base to 8.6 ms at the apex.
    strand = build("strand", 10.0)
    deep = Mesh(strand.points - [0.0, 0.0, 70.0], strand.cells)
    reduced = cell(0.25, deep, time_scale_reduction=0.55)
    assert fastest_decay(reduced) == pytest.approx(decay / (1.0 - 0.55 * 38.0 / 63.0), rel=1e-6)


def test_what_the_theory_says_of_substeps_beyond_the_limit(potentials: Any) -> None:
    # The numbers of the module's text.
    fine = potentials(0.05, 600)
    times = 0.05 * (1.0 + np.arange(600))

    def lasts(substep: float, found: np.ndarray) -> float:
        low = found.max() - 0.9 * (found.max() + 80.0)
        return substep * (1.0 + np.flatnonzero(found > low)[-1])

    for substep, missing in ((0.2, 0.05), (0.3, 5.7), (0.4, 15.0)):
        found = potentials(substep, int(40.0 / substep))
        at = int(10.0 / substep) - 1
        assert np.interp(substep * (at + 1), times, fine) - found[at] == pytest.approx(missing, abs=1.2)
        assert lasts(substep, found) == pytest.approx(31.26, rel=0.03)
    assert potentials(0.5, 60) is not None
    for substep in (0.53, 0.56, 0.6, 0.8):
        assert potentials(substep, 60) is None


def test_other_cells_have_other_limits(cell: Any, potentials: Any) -> None:
    # Mitchell and Schaeffer's: at most 1/tau_in + 1/tau_out at phi = h = 1, less on the way.
    decay = fastest_decay(cell(0.1, ionic_model="mitchell_schaeffer"))
    assert 0.6 * 3.5 < decay < 3.5
    assert ReactionStep().amplification(cell(1.98 / decay, ionic_model="mitchell_schaeffer")) < 1.0
    assert ReactionStep().amplification(cell(2.02 / decay, ionic_model="mitchell_schaeffer")) > 1.0


def test_the_substep_counts_and_not_the_communication_step(point: Mesh, setting: Any) -> None:
    def amplification(step_ms: float, longest: float) -> float:
        wave = setting("electrophysiology", time_scale_reduction=0.0, longest_substep_ms=longest)
        return ReactionStep().amplification(Coupled({"wave": wave}, False, step_ms, mesh=lambda: point))

    assert amplification(5.0, 4.0) == amplification(2.5, 2.5)
    assert amplification(20.0, 4.0) == amplification(4.0, 4.0) > 1.0


def test_a_scenario_without_tissue_is_refused(setting: Any) -> None:
    with pytest.raises(InvalidInput, match="one unit electrophysiology"):
        ReactionStep().amplification(Coupled({"a": setting("mass")}, False, 1.0))
    with pytest.raises(InvalidInput, match="add a `scene` to the scenario"):
        ReactionStep().amplification(Coupled({"a": setting("electrophysiology")}, False, 1.0))
