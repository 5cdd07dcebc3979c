"""If these fail, passive tissue does not deform as eleven other codes say it does (Land et al. 2015)."""

import numpy as np
import pytest
from cardiac_cosim.units.mechanics import Mechanics
from land_problems import BULK_MPA, ELLIPSOID_LAW, ELLIPSOID_LOAD_KPA, apex_mm, beam, ellipsoid, tip_mm

#: The published answers: the tip's height with what codes differ by, and where the middle of the apex lies.
_TIP_MM, _APART_MM = 4.17, 0.02
_APEX_MM = (-27.3, -26.5)


def test_quadratic_elements_bend_the_beam_as_far_as_published_and_linear_ones_lock() -> None:
    coarse, fine = (tip_mm(beam(across), 2) for across in (1, 2))
    assert fine == pytest.approx(_TIP_MM, abs=_APART_MM)
    # From below, and two thirds of the way with half the size.
    assert coarse < fine < _TIP_MM
    assert _TIP_MM - fine < 0.5 * (_TIP_MM - coarse)
    # So far off are linear ones of the same mesh and of half the size: nobody should take them for this.
    locked, less = (tip_mm(beam(across), 1) for across in (2, 4))
    assert locked < less < 0.5 * _TIP_MM


def test_the_apex_is_where_it_is_published_to_be() -> None:
    assert _APEX_MM[0] < apex_mm(ellipsoid(1), 2) < _APEX_MM[1]
    assert _APEX_MM[0] < apex_mm(ellipsoid(2), 1) < _APEX_MM[1]


def test_the_unit_inflates_the_whole_ellipsoid_as_far_as_the_solid_its_quarter(along, started) -> None:
    # Pressure in kPa, order of the displacement, law and base by the unit's own names.
    mesh = ellipsoid(1, quarters=4)
    parameters = {"material": "guccione", "element_order": 2, "guccione_bulk_modulus_MPa": BULK_MPA, **ELLIPSOID_LAW}
    unit = started(
        Mechanics,
        mesh,
        parameters,
        lv_pressure=ELLIPSOID_LOAD_KPA,
        fiber=along(mesh, (1, 0, 0)),
        sheet=along(mesh, (0, 0, 1)),
    )
    outside = apex_mm(ellipsoid(1), 2, through=1.0)
    assert float(unit.get("apex_uplift")) == pytest.approx(outside + 20.0, abs=0.02)
    # The quarter fixes, by symmetry, what the whole leaves free; nor does it turn or tilt.
    np.testing.assert_allclose(unit.get("displacement")[mesh.points[:, 2].argmin(), :2], 0.0, atol=0.05)


@pytest.mark.long
def test_the_beam_converges_to_what_is_published() -> None:
    # The edges where it is fixed are singular: the order is less than that of smooth solutions.
    heights = [tip_mm(beam(across), 2) for across in (1, 2, 4)]
    changes = np.diff(heights)
    assert heights[-1] == pytest.approx(_TIP_MM, abs=0.5 * _APART_MM)
    assert 0.0 < changes[1] < 0.5 * changes[0]
    # Nor is it the penalty that makes it so.
    assert tip_mm(beam(2), 2, 1.0) == pytest.approx(heights[1], abs=0.25 * _APART_MM)


@pytest.mark.long
def test_linear_elements_come_to_the_same_beam_in_the_end() -> None:
    off = [_TIP_MM - tip_mm(beam(across), 1) for across in (2, 4, 8)]
    orders = np.log2(np.divide(off[:-1], off[1:]))
    assert off[2] > 1.0
    # Faster and faster, as locking gives way.
    assert 0.0 < orders[0] < orders[1]


@pytest.mark.long
def test_both_elements_come_to_the_same_apex() -> None:
    quadratic = [apex_mm(ellipsoid(through), 2) for through in (1, 2, 3)]
    assert _APEX_MM[0] < quadratic[-1] < _APEX_MM[1]
    assert abs(quadratic[2] - quadratic[1]) < 0.25 * abs(quadratic[1] - quadratic[0])
    linear = apex_mm(ellipsoid(4), 1)
    assert linear == pytest.approx(quadratic[-1], abs=0.1)
