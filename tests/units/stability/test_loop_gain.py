"""If these fail, theory says that a coupling holds where it fails, or the other way round."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.stability.loop_gain import LoopGain
from cardiac_cosim.units.stability.registry import THEORIES


@pytest.fixture(scope="module")
def cell() -> Mesh:
    return build("cell", 1.0)


@pytest.fixture(scope="module")
def slab() -> Mesh:
    """A piece of wall, 147 nodes."""
    return build("slab", 5.0)


def test_it_is_found_by_its_name() -> None:
    assert isinstance(THEORIES["loop_gain"], LoopGain)
    assert THEORIES["loop_gain"].formula == "|g| < 1, g = −K_a/K_p"


@pytest.mark.parametrize("eta", [1.0, 3.5, 5.0])
def test_the_gain_of_a_cell_is_that_of_the_units(eta: float, cell: Mesh, coupled: Any, disturbed: Any) -> None:
    (gain,) = LoopGain().gains(coupled(cell, "local_mechanics", eta))
    assert gain.imag == 0.0
    assert gain.real < 0.0
    # Before the disturbance is lost in rounding, or is too large to be linear.
    course = disturbed(cell, "local_mechanics", eta, steps=4)
    assert abs(gain) == pytest.approx(course[-1] / course[-2], rel=0.001)


@pytest.mark.parametrize(
    ("eta", "share", "stable"), [(3.8, 0.0, True), (4.6, 0.0, False), (6.0, 0.15, False), (6.0, 0.3, True)]
)
def test_the_gain_of_a_piece_of_wall_is_that_of_a_run_on_both_sides_of_the_boundary(
    eta: float, share: float, stable: bool, slab: Mesh, coupled: Any, disturbed: Any
) -> None:
    predicted = LoopGain().amplification(coupled(slab, "mechanics", eta, share))
    assert (predicted < 1.0) == stable
    course = disturbed(slab, "mechanics", eta, share)
    assert predicted == pytest.approx(course[-1] / course[-2], rel=0.01)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("jacobi", [False, True], ids=["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("kind", ["mechanics", "local_mechanics"])
def test_stabilised_nothing_of_a_disturbance_comes_back(
    kind: str, jacobi: bool, order: int, slab: Mesh, disturbed: Any
) -> None:
    # Were the stretch not averaged as the active stress does it, extrapolated Jacobi coupling would blow up here.
    course = disturbed(slab, kind, 4.0, 1.0, jacobi, order, steps=12)
    assert max(course) < 1e-3 * 1e-6 * np.sqrt(slab.elements)


def test_moments_of_a_run_are_where_the_gain_is_taken(cell: Mesh, coupled: Any) -> None:
    def moment(tension_kPa: float, stretch: float) -> dict[str, np.ndarray]:
        return {"active_stress": np.array([tension_kPa]), "stretch": np.array([stretch])}

    weak, strong = moment(50.0, 0.95), moment(300.0, 0.82)
    theory, found = LoopGain(), {}
    for name, moments in {"weak": [weak], "strong": [strong], "both": [strong, weak]}.items():
        found[name] = theory.amplification(coupled(cell, "local_mechanics", 3.0, moments=lambda all=moments: all))
    assert found["weak"] < found["strong"] == found["both"]


def test_a_moment_of_the_plateau_gives_the_gain_of_the_plateau(slab: Mesh, coupled: Any, started: Any) -> None:
    # Found by iteration without stabilisation, which converges where |g| < 1.
    generator = started(FiberGenerator, slab)
    moment = {name: generator.get(name) for name in ("fiber", "sheet")}
    tension = started(ActiveStress, slab, {"length_dependence": 2.0}, potential=np.full(slab.nodes, 20.0))
    wall = started(Mechanics, slab, {"stabilization": 0.0}, **moment)
    for _ in range(30):
        tension.set("stretch", wall.get("stretch"))
        tension.do_step(0.0, 1.0)
        wall.set("active_stress", tension.get("active_stress"))
        wall.do_step(0.0, 1.0)
    moment |= {"stretch": wall.get("stretch"), "active_stress": tension.get("active_stress")}
    (given,) = LoopGain().gains(coupled(slab, "mechanics", 2.0, moments=lambda: [moment]))
    (found,) = LoopGain().gains(coupled(slab, "mechanics", 2.0))
    assert given.real == pytest.approx(found.real, rel=1e-4)


def test_schemes_and_stabilisation_change_what_is_left_of_it(cell: Mesh, coupled: Any) -> None:
    theory = LoopGain()
    (gain,) = theory.gains(coupled(cell, "local_mechanics", 5.0))
    assert theory.amplification(coupled(cell, "local_mechanics", 5.0)) == pytest.approx(abs(gain))
    assert theory.amplification(coupled(cell, "local_mechanics", 5.0, jacobi=True)) == pytest.approx(abs(gain) ** 0.5)
    assert theory.amplification(coupled(cell, "local_mechanics", 5.0, share=1.0)) == 0.0
    half = abs(gain * 0.5 / (1.0 - 0.5 * gain))
    assert theory.amplification(coupled(cell, "local_mechanics", 5.0, share=0.5)) == pytest.approx(half)


def test_no_loop_has_no_gain(cell: Mesh, coupled: Any) -> None:
    theory = LoopGain()
    assert theory.amplification(coupled(cell, "local_mechanics", 0.0)) == 0.0
    held = coupled(cell, "local_mechanics", 3.0, parameters={"hold": "isometric"})
    assert theory.amplification(held) == 0.0


def test_what_the_theory_does_not_fit_is_refused(cell: Mesh, coupled: Any) -> None:
    with pytest.raises(InvalidInput, match="needs a `scene`"):
        LoopGain().amplification(coupled(None, "local_mechanics", 3.0))
    system = coupled(cell, "local_mechanics", 3.0)
    alone = type(system)({"tension": system.units["tension"]}, False, 1.0, mesh=system.mesh)
    with pytest.raises(InvalidInput, match="one unit mechanics or local_mechanics, not 0"):
        LoopGain().amplification(alone)
