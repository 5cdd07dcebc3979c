"""If these fail, a run with compiled kernels computes other tissue than NumPy does, or a law has no kernel at all."""

import numpy as np
import pytest
from cardiac_cosim.units import kernels
from cardiac_cosim.units.mechanics.laws.guccione import Guccione
from cardiac_cosim.units.mechanics.laws.holzapfel_fiber import HolzapfelFiber
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from cardiac_cosim.units.mechanics.laws.registry import LAWS, MATERIALS

_LAWS = {
    "neo_hooke": (NeoHooke(),),
    "neo_hooke_with_fibers": (NeoHooke(), HolzapfelFiber()),
    "guccione": (Guccione(),),
    "guccione in all its numbers": (Guccione(0.003, 7.0, 1.5, 5.0, 0.4),),
}


def test_every_law_has_its_twin_and_every_material_is_looked_at() -> None:
    if not kernels.available():
        pytest.skip("no compiled kernels")
    assert [law.name for law in LAWS if kernels.law_number(law.name) < 0] == []
    assert {tuple(type(law) for law in laws) for laws in _LAWS.values()} == set(MATERIALS.values())


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("laws", _LAWS.values(), ids=_LAWS)
@pytest.mark.parametrize("variant", kernels.available())
def test_kernels_are_numpy_to_rounding(variant: str, laws, order: int, cube, solid_of) -> None:
    found = []
    for choice in (variant, kernels.WITHOUT):
        with kernels.using(choice):
            solid = solid_of(cube, laws, order)
            assert solid.compiled == (choice != kernels.WITHOUT)
        random = np.random.default_rng(3)
        displacement = 0.05 * random.uniform(-1.0, 1.0, solid.space.points.shape)
        tension = random.uniform(0.0, 0.01, cube.nodes)
        energy, residual = solid.energy_and_residual(displacement, tension)
        assert np.isfinite(energy)
        found.append([np.array(energy), residual, solid.tangent(displacement, tension).full().toarray()])
        np.testing.assert_array_equal(residual, solid.residual(displacement, tension))
    for compiled, plain in zip(*found, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=0.0, atol=1e-12 * np.abs(plain).max())
