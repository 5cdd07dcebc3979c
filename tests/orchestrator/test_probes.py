"""If these fail, the curves people compare are of other places in the heart than they asked for."""

import warnings

import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.participants.native import Mesh, NativeParticipant
from cardiac_cosim.orchestrator.probes import Probes

_SLOPE = np.array([2.0, -3.0, 0.5])


def _linear(points: np.ndarray) -> np.ndarray:
    return np.asarray(points @ _SLOPE + 7.0)


def test_linear_fields_are_exact_inside_and_at_nodes(small_heart: Mesh) -> None:
    elements = small_heart.points[small_heart.cells]
    weights = np.array([0.1, 0.2, 0.3, 0.4])
    places = {f"inside_{number}": weights @ elements[number] for number in range(0, len(elements), 97)}
    places |= {f"node_{number}": small_heart.points[number] for number in range(0, small_heart.nodes, 31)}
    probes = Probes(small_heart, places)
    assert probes.names == tuple(places)
    values = probes(_linear(small_heart.points))
    np.testing.assert_allclose(values, [_linear(place) for place in places.values()], rtol=0, atol=1e-10)


def test_at_a_node_no_other_node_has_a_say(small_heart: Mesh) -> None:
    field = np.arange(small_heart.nodes, dtype=float) ** 2
    values = Probes(small_heart, {"here": small_heart.points[5]})(field)
    assert values == pytest.approx([25.0], abs=1e-8)


def test_a_point_that_a_facetted_wall_cuts_off_takes_the_value_of_the_wall(small_heart: Mesh) -> None:
    face = small_heart.points[small_heart.boundary("epicardium")[0]]
    normal = np.cross(face[1] - face[0], face[2] - face[0])
    outside = face.mean(axis=0) + 0.2 * normal / np.linalg.norm(normal)
    field = _linear(small_heart.points)
    (value,) = Probes(small_heart, {"wall": outside})(field)
    corners = _linear(face)
    assert corners.min() <= value <= corners.max()
    assert value == pytest.approx(_linear(face.mean(axis=0)), abs=0.2 * np.linalg.norm(_SLOPE))


@pytest.mark.parametrize("point", [[0.0, 0.0, 60.0], [1e6, -1e6, 1e6], [0.0, 0.0, -20.0]])
def test_a_point_off_the_tissue_is_refused_with_the_nearest_node(small_heart: Mesh, point: list[float]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=r"output\.probes_mm\.far: the point .* outside the mesh") as caught:
            Probes(small_heart, {"far": point})
    nearest = small_heart.points[np.linalg.norm(small_heart.points - point, axis=1).argmin()]
    assert str(np.round(nearest, 2).tolist()) in str(caught.value)


def test_a_point_that_is_no_number_is_never_inside(small_heart: Mesh) -> None:
    with pytest.raises(InputError, match="outside the mesh"):
        Probes(small_heart, {"lost": [0.0, 0.0, float("nan")]})


def test_a_unit_shows_at_its_probes_what_a_scenario_records_there(small_heart: Mesh) -> None:
    points = {"base": [25.0, 0.0, -1.0], "middle": [20.0, 0.0, -40.0], "apex": [0.0, 0.0, -60.0]}
    fibers = NativeParticipant("fibers", "fiber_generator", small_heart, {})
    wave = NativeParticipant("wave", "electrophysiology", small_heart, {"stimulus_depth_mm": 5.0})
    for participant in (fibers, wave):
        participant.begin()
        if participant is wave:
            wave.set("fiber", fibers.get("fiber"))
        participant.complete()
    wave.start(0.0, 0.02)()
    shown = [float(wave.get(f"potential_probe_{number}")) for number in (1, 2, 3)]
    # To the bit: there is one way of interpolating.
    assert Probes(small_heart, points)(wave.get("potential")) == shown
    assert shown[0] > -70.0 > shown[2]
