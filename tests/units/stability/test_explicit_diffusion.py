"""If these fail, a map says that explicit diffusion bears a substep at which tissue falls apart, or the other way."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.electrophysiology.fastest_mode import fastest_rate
from cardiac_cosim.units.electrophysiology.monodomain import Conduction, Monodomain
from cardiac_cosim.units.errors import InvalidInput, StepFailure
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.refinement import refined
from cardiac_cosim.units.stability.explicit_diffusion import ExplicitDiffusion
from cardiac_cosim.units.stability.reaction_step import fastest_decay
from cardiac_cosim.units.stability.theory import Coupled
from scipy.linalg import eigh

_MASSES = {"consistent": 12.0, "lumped": 4.0}


@pytest.fixture
def tissue(setting: Any) -> Any:
    """Tissue as the theory sees it, at a communication step that is one substep."""

    def make(mesh: Mesh, step_ms: float, **parameters: Any) -> Coupled:
        given = {"time_scale_reduction": 0.0, "longest_substep_ms": step_ms, "diffusion_step": "explicit"}
        moments = parameters.pop("moments", [])
        units = {"fibers": setting("fiber_generator"), "wave": setting("electrophysiology", **given | parameters)}
        return Coupled(units, False, step_ms, mesh=lambda: mesh, moments=lambda: moments)

    return make


@pytest.mark.parametrize("mass", _MASSES)
@pytest.mark.parametrize("size", [1.0, 3.0])
def test_the_fastest_mode_of_a_strand_is_known(mass: str, size: float, tissue: Any) -> None:
    # d = 1.1 mm2/ms along the fibre; the sawtooth of all nodes is an eigenvector.
    found = ExplicitDiffusion().fastest_mode(tissue(build("strand", size), 0.1, mass_matrix=mass))
    assert found == pytest.approx(_MASSES[mass] * 1.1 / size**2, rel=1e-9)


def test_the_fastest_mode_of_a_larger_mesh_is_that_of_all_its_eigenvalues(along: Any) -> None:
    mesh = build("sheet", 3.0)
    for mass in _MASSES:
        conduction = Conduction(mass_matrix=mass)
        equation = Monodomain(mesh, along(mesh, (0.6, 0.8, 0.0)), lambda z: np.full_like(z, 12.9), conduction)
        assert mesh.nodes > 300
        stretch = 1.0 + 0.2 * np.abs(np.sin(np.arange(mesh.elements)))
        matrix = equation.diffusion + equation.conductance(stretch)
        expected = eigh(matrix.toarray(), equation.mass.toarray(), eigvals_only=True)[-1]
        assert fastest_rate(equation, stretch) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("mass", _MASSES)
@pytest.mark.parametrize("side", [0.98, 1.02])
def test_tissue_falls_apart_where_it_is_predicted_to(mass: str, side: float, tissue: Any, started: Any) -> None:
    # Without recovery a wave leaves all of the strand on the plateau, at 20 mV.
    mesh = build("strand", 1.0)
    parameters = {"mass_matrix": mass, "recovery_rate": 0.0, "recovery_mu1": 0.0}
    any_step = tissue(mesh, 0.1, **parameters)
    decay = ExplicitDiffusion().fastest_mode(any_step) + fastest_decay(any_step)
    step_ms = side * 2.0 / decay
    predicted = ExplicitDiffusion().amplification(tissue(mesh, step_ms, **parameters))
    assert (predicted > 1.0) == (side > 1.0)
    given = {"time_scale_reduction": 0.0, "longest_substep_ms": step_ms, "diffusion_step": "explicit"}
    given |= {"explicit_limit": "ignored", "stimulus_x_min_mm": -1.0, "stimulus_x_max_mm": 8.0}
    fiber = np.tile([1.0, 0.0, 0.0], (mesh.elements, 1))
    unit = started(Electrophysiology, mesh, given | parameters, fiber=fiber)
    time, failed = 0.0, False
    # In many communication steps, so that rounding is as it is in a run.
    for _ in range(30):
        try:
            unit.do_step(1e-3 * time, 1e-3 * 60.0 * step_ms)
        except StepFailure:
            failed = True
            break
        time += 60.0 * step_ms
    off = float(np.abs(unit.get("potential") - 20.0).max())
    if side < 1.0:
        assert not failed
        assert off < 1e-6
    else:
        assert failed or off > 1.0


def test_tissue_at_rest_bears_what_diffusion_alone_does(started: Any) -> None:
    # Its cells hardly pull: 2/lambda_max itself, to 1 %.
    mesh = build("strand", 1.0)
    for side in (0.99, 1.01):
        step_ms = side * 2.0 / 13.2
        given = {"time_scale_reduction": 0.0, "longest_substep_ms": step_ms, "diffusion_step": "explicit"}
        # A sawtooth of the whole strand would need all nodes: one at the end has a part of it.
        given |= {"explicit_limit": "ignored", "stimulus_x_min_mm": -1.0, "stimulus_x_max_mm": 0.5}
        given |= {"stimulus_potential_mV": -79.9}
        unit = started(Electrophysiology, mesh, given, fiber=np.tile([1.0, 0.0, 0.0], (mesh.elements, 1)))
        unit.do_step(0.0, 1e-3 * 400.0 * step_ms)
        kept = float(np.abs(np.diff(unit.get("potential"))).max())
        assert (kept > 1e-2) == (side > 1.0)


def test_stretch_and_refinement_take_from_the_limit(tissue: Any) -> None:
    mesh = build("strand", 3.0)
    theory = ExplicitDiffusion()
    once = theory.fastest_mode(tissue(mesh, 0.1))
    assert theory.fastest_mode(tissue(mesh, 0.1, refine=1)) == pytest.approx(4.0 * once, rel=1e-9)
    finer = theory.fastest_mode(tissue(refined(mesh, 1).mesh, 0.1))
    assert finer == pytest.approx(4.0 * once, rel=1e-9)
    # G_s (lambda - 1)/beta_t, where lambda is the largest of the moments.
    still, most = np.ones(mesh.elements), np.full(mesh.elements, 1.2)
    stretched = tissue(mesh, 0.1, moments=[{"stretch": still}, {"stretch": most}, {"stretch": still}])
    assert theory.fastest_mode(stretched) == pytest.approx(once + 10.0 * 0.2 / 12.9, rel=1e-9)


def test_implicit_diffusion_leaves_the_limit_of_the_cells(tissue: Any) -> None:
    mesh = build("strand", 0.5)
    for step_ms, stable in ((3.2, True), (3.3, False)):
        coupled = tissue(mesh, step_ms, diffusion_step="implicit")
        assert (ExplicitDiffusion().amplification(coupled) < 1.0) == stable


def test_a_scenario_without_a_mesh_is_refused(setting: Any) -> None:
    units = {"fibers": setting("fiber_generator"), "wave": setting("electrophysiology", diffusion_step="explicit")}
    with pytest.raises(InvalidInput, match="add a `scene` to the scenario"):
        ExplicitDiffusion().amplification(Coupled(units, False, 1.0))
