"""If these fail, a scene without a mesh contracts otherwise than the same tissue with one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput, StepFailure
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mechanics import LocalMechanics, Mechanics
from cardiac_cosim.units.variable import Record


def _stretch(started: Any, tension: float, **parameters: Any) -> tuple[float, np.ndarray]:
    mesh = build("cell", 1.0)
    unit = started(LocalMechanics, mesh, parameters=parameters)
    unit.set("active_stress", np.array([tension]))
    unit.do_step(0.0, 0.001)
    return float(unit.get("stretch")[0]), np.sqrt(unit.get_state().state["squares"][0])


@pytest.mark.parametrize(("tension", "along", "across"), [(500.0, 0.73626, 0.97398), (100.0, 0.90157, 1.00799)])
def test_free_contraction_is_that_of_a_cube_of_finite_elements(
    tension: float, along: float, across: float, started: Any
) -> None:
    # Computed independently (docs/model.md, Numbers), and what test_mechanics finds with tetrahedra.
    stretch, all_three = _stretch(started, tension)
    np.testing.assert_allclose(all_three, [along, across, across], atol=1e-5)
    assert stretch == all_three[0]


def test_an_isometric_fibre_keeps_its_length_and_its_surroundings_do_not(started: Any) -> None:
    stretch, all_three = _stretch(started, 500.0, hold="isometric")
    assert stretch == 1.0
    # Across, the tissue is pressed together by its share of the active stress.
    assert all_three[1] == pytest.approx(all_three[2])
    assert 0.5 < all_three[1] < 0.9


def test_the_way_to_an_active_stress_does_not_matter(started: Any) -> None:
    mesh = build("cell", 1.0)
    unit = started(LocalMechanics, mesh)
    for tension in (900.0, 10.0, -20.0, 300.0):
        unit.set("active_stress", np.array([tension]))
        unit.do_step(0.0, 0.001)
    assert float(unit.get("stretch")[0]) == pytest.approx(_stretch(started, 300.0)[0], rel=1e-12)


def test_an_impossible_active_stress_fails_the_step_and_says_so(started: Any) -> None:
    with pytest.raises(StepFailure, match="no equilibrium found"):
        _stretch(started, -5000.0)


def test_finite_elements_name_the_unit_for_scenes_without_tetrahedra(started: Any) -> None:
    with pytest.raises(InvalidInput, match="take the unit local_mechanics"):
        started(Mechanics, build("strand", 5.0))


def test_it_shows_what_finite_elements_show() -> None:
    for own, other in zip(LocalMechanics.fields, Mechanics.fields, strict=True):
        # The motion of a wall, which it does not have, is worth no column.
        record = Record.NOTHING if other.recorded_with else other.record
        assert replace(own, depends_on=other.depends_on) == replace(other, record=record)


# --- active stiffness ----------------------------------------------------------------------------------------------


def _stabilised(started: Any, tension: float, stiffness: float, reference: float, **parameters: Any) -> float:
    unit = started(LocalMechanics, build("cell", 1.0), parameters=parameters)
    for name, value in (
        ("active_stress", tension),
        ("active_stiffness", stiffness),
        ("reference_stretch", reference),
    ):
        unit.set(name, np.array([value]))
    unit.do_step(0.0, 0.001)
    return float(unit.get("stretch")[0])


@pytest.mark.parametrize("stiffness", [200.0, 1000.0, 1e4])
def test_stabilised_it_is_in_equilibrium_with_the_stress_at_its_own_stretch(stiffness: float, started: Any) -> None:
    stretch = _stabilised(started, 400.0, stiffness, 1.0)
    own = 400.0 + stiffness * (stretch - 1.0)
    assert own < 390.0
    assert stretch == pytest.approx(_stretch(started, own)[0], rel=1e-10)
    # Of half of the stiffness half of it.
    half = _stabilised(started, 400.0, stiffness, 1.0, stabilization=0.5)
    assert half == pytest.approx(_stabilised(started, 400.0, 0.5 * stiffness, 1.0), rel=1e-12)
    assert _stabilised(started, 400.0, stiffness, 1.0, stabilization=0.0) == _stretch(started, 400.0)[0]


def test_without_a_reference_it_takes_the_stretch_of_the_last_exchange(started: Any) -> None:
    unit = started(LocalMechanics, build("cell", 1.0), {})
    expected = []
    reference = 1.0
    for number, tension in enumerate((200.0, 300.0, 250.0)):
        unit.set("active_stress", np.array([tension]))
        unit.set("active_stiffness", np.array([1000.0]))
        unit.do_step(0.001 * number, 0.001)
        expected.append(_stabilised(started, tension, 1000.0, reference))
        reference = float(unit.get("stretch")[0])
        assert reference == pytest.approx(expected[-1], rel=1e-10)
    # Nothing has passed: the last exchange is still the same.
    unit.do_step(0.003, 0.0)
    assert float(unit.get("stretch")[0]) == pytest.approx(expected[-1], rel=1e-12)
