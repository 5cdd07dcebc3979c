"""If these fail, the compiled substeps of electrophysiology compute another heart than the equations in NumPy do."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.electrophysiology.compiled import CompiledIntegration, compiled
from cardiac_cosim.units.electrophysiology.integration import Integration
from cardiac_cosim.units.electrophysiology.ionic.aliev_panfilov import AlievPanfilov
from cardiac_cosim.units.electrophysiology.ionic.registry import IONIC_MODELS
from cardiac_cosim.units.electrophysiology.monodomain import Conduction, Monodomain
from cardiac_cosim.units.electrophysiology.progress import NOT_ACTIVATED, Limits, Progress
from cardiac_cosim.units.electrophysiology.time_scale import TimeScale
from cardiac_cosim.units.errors import StepFailure
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.kernels import address, available, kernel, using
from cardiac_cosim.units.mesh import Mesh

pytestmark = pytest.mark.skipif(not available(), reason="nothing was compiled")
each_instruction_set = pytest.mark.parametrize("instructions", available())
each_model = pytest.mark.parametrize("name", [name for name, model in IONIC_MODELS.items() if model.kernel])

_VARIANTS = {
    "nodal": {},
    "lumped": {"mass_matrix": "lumped"},
    "quadrature": {"ionic_current": "quadrature"},
}
_LIMITS = Limits(0.6, -0.3, -110.0, "the pole")


def _both(mesh: Mesh, model, instructions: str, limits: Limits = _LIMITS, **conduction):
    fiber = np.tile([0.6, 0.8, 0.0] if mesh.dimension > 1 else [1.0, 0.0, 0.0], (mesh.elements, 1))
    equation = Monodomain(mesh, fiber, TimeScale(), Conduction(**conduction))
    with using(instructions):
        fast = compiled(equation, model, limits)
    assert isinstance(fast, CompiledIntegration)
    return fast, Integration(equation, model, limits)


def _start(mesh: Mesh, states: int) -> Progress:
    """A smooth potential below and above the level of activation, other states, and increments of nothing."""
    random = np.random.default_rng(8)
    phi = 0.3 + 0.6 * np.sin(mesh.points @ [0.21, 0.13, 0.17]) ** 2
    values = np.vstack([phi, random.uniform(0.0, 1.0, (states, mesh.nodes))])
    times = np.where(random.uniform(size=mesh.nodes) < 0.3, 1.5, NOT_ACTIVATED)
    return Progress(values, times, np.zeros((4, mesh.nodes)), 0.0)


@each_instruction_set
@each_model
def test_rates_are_those_of_the_model(name: str, instructions: str) -> None:
    model = IONIC_MODELS[name]()
    values = np.random.default_rng(1).uniform(-0.2, 1.2, (1 + len(model.states), 203))
    rates = np.empty_like(values)
    constants = np.array(model.constants)
    with using(instructions):
        function = kernel(str(model.kernel), integers=2, pointers=3)
    function(203, 203, *map(address, (constants, values, rates)))
    np.testing.assert_allclose(rates, np.stack(model.rates(*values)), rtol=1e-12, atol=1e-14)


@each_instruction_set
@pytest.mark.parametrize("ramped", [False, True])
@pytest.mark.parametrize("variant", _VARIANTS)
@pytest.mark.parametrize(("geometry", "size"), [("cell", 1.0), ("strand", 2.0), ("sheet", 6.0), ("slab", 6.0)])
def test_substeps_are_those_of_numpy(geometry: str, size: float, variant: str, ramped: bool, instructions: str) -> None:
    mesh = build(geometry, size)
    random = np.random.default_rng(4)
    first = random.uniform(0.9, 1.2, mesh.elements)
    last = random.uniform(0.9, 1.2, mesh.elements) if ramped else first
    fast, plain = _both(mesh, AlievPanfilov(), instructions, **_VARIANTS[variant])
    ends = []
    for integration in (fast, plain):
        progress = _start(mesh, 1)
        # Other lengths: the increments of one are scaled to the other.
        progress = integration.advance(progress, first, last, 3.0, 0.25, 4)
        ends.append(integration.advance(progress, last, last, 4.0, 0.2, 2))
    assert ends[0].substep_ms == ends[1].substep_ms == 0.2
    assert geometry == "cell" or (ends[1].activation_time > 3.0).any()
    for name in ("values", "activation_time", "increments"):
        np.testing.assert_allclose(getattr(ends[0], name), getattr(ends[1], name), rtol=1e-12, atol=1e-12, err_msg=name)


@each_instruction_set
@each_model
def test_every_ionic_model_runs_in_the_heart_as_in_numpy(name: str, instructions: str, heart: Mesh) -> None:
    model = IONIC_MODELS[name]()
    still = np.ones(heart.elements)
    ends = [
        integration.advance(_start(heart, len(model.states)), still, still, 0.0, 0.1, 5)
        for integration in _both(heart, model, instructions)
    ]
    np.testing.assert_allclose(ends[0].values, ends[1].values, rtol=1e-12, atol=1e-12)


@each_instruction_set
def test_repeated_substeps_have_the_same_bits(instructions: str, heart: Mesh) -> None:
    stretch = np.random.default_rng(2).uniform(0.9, 1.1, heart.elements)
    fast, _ = _both(heart, AlievPanfilov(), instructions)
    start = _start(heart, 1)
    once = fast.advance(start, stretch, stretch, 0.0, 0.25, 4)
    fast.advance(once, stretch, stretch, 1.0, 0.25, 4)
    again = fast.advance(start, stretch, stretch, 0.0, 0.25, 4)
    other, _ = _both(heart, AlievPanfilov(), instructions)
    third = other.advance(start, stretch, stretch, 0.0, 0.25, 4)
    for name in ("values", "activation_time", "increments"):
        assert getattr(once, name).tobytes() == getattr(again, name).tobytes() == getattr(third, name).tobytes()


@each_instruction_set
def test_steps_cut_in_two_have_the_same_bits(instructions: str, heart: Mesh) -> None:
    """What the solver starts from would otherwise depend on where a master stops to exchange fields."""
    stretch = np.random.default_rng(2).uniform(0.9, 1.1, heart.elements)
    fast, _ = _both(heart, AlievPanfilov(), instructions)
    whole = fast.advance(_start(heart, 1), stretch, stretch, 0.0, 0.25, 8)
    half = fast.advance(_start(heart, 1), stretch, stretch, 0.0, 0.25, 4)
    half = fast.advance(half, stretch, stretch, 1.0, 0.25, 4)
    assert half.values.tobytes() == whole.values.tobytes()


@each_instruction_set
def test_what_stops_numpy_stops_the_kernel_at_the_same_node(instructions: str) -> None:
    """A potential beyond the pole, or beyond reason, would come back with plausible numbers."""
    mesh = build("slab", 6.0)
    still = np.ones(mesh.elements)
    start = _start(mesh, 1)
    below, beyond, lost = (np.array(start.values) for _ in range(3))
    below[0, 17], beyond[0, 23], lost[0, 5] = -40.0, 2e3, np.nan
    beyond[1] = 0.0
    for values, words in ((below, "pole"), (lost, "did not converge")):
        messages = []
        for integration in _both(mesh, AlievPanfilov(), instructions, diffusion_isotropic_mm2_per_ms=1e-9):
            with np.errstate(all="ignore"), pytest.raises(StepFailure, match=words) as failure:
                integration.advance(
                    Progress(values, start.activation_time, start.increments, 0.0), still, still, 0.0, 1e-9, 1
                )
            messages.append(str(failure.value))
        assert messages[0] == messages[1]
    unlimited = Limits(0.6, -np.inf, -np.inf, "")
    messages = []
    for integration in _both(mesh, AlievPanfilov(), instructions, unlimited):
        with np.errstate(all="ignore"), pytest.raises(StepFailure, match="outside the range of a cell") as failure:
            integration.advance(
                Progress(beyond, start.activation_time, start.increments, 0.0), still, still, 0.0, 1e-9, 1
            )
        messages.append(str(failure.value))
    assert messages[0] == messages[1]
    assert "node 23 " in messages[0]


@each_instruction_set
def test_a_failed_step_leaves_the_unit_as_it_was(instructions: str, heart: Mesh, started, along) -> None:
    with using(instructions):
        unit = started(Electrophysiology, heart, fiber=along(heart, (1, 0, 0)))
    unit.do_step(0.0, 1e-3)
    before = {name: value.tobytes() for name, value in unit.get_state().state.items()}
    unit.set("stretch", np.full(heart.elements, 1.7e308))
    with pytest.raises(StepFailure, match="did not converge"):
        unit.do_step(1e-3, 1e-3)
    assert {name: value.tobytes() for name, value in unit.get_state().state.items()} == before
    unit.set("stretch", np.ones(heart.elements))
    unit.do_step(1e-3, 1e-3)


def test_the_unit_says_what_computes_it(heart: Mesh, started, along) -> None:
    for choice, words in ((available()[-1], "compiled kernels"), ("none", "NumPy")):
        with using(choice):
            unit = started(Electrophysiology, heart, fiber=along(heart, (1, 0, 0)))
            assert words in unit.implementation()


@dataclass(frozen=True)
class _Uncompiled(AlievPanfilov):
    kernel: ClassVar[str | None] = None


def test_a_model_without_a_compiled_twin_is_left_to_numpy(heart: Mesh, along) -> None:
    equation = Monodomain(heart, along(heart, (1, 0, 0)), TimeScale(), Conduction())
    assert compiled(equation, _Uncompiled(), _LIMITS) is None
