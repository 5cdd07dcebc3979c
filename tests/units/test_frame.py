"""If these fail, a heart in cm, on its head or beside its place beats with plausible numbers, and nobody is told."""

import numpy as np
import pytest
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry import registry
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.frame import check_frame, frame_warnings


def _moved(mesh: Mesh, turn: np.ndarray | None = None, by: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mesh:
    return Mesh(mesh.points @ (np.eye(3) if turn is None else turn).T + by, mesh.cells, mesh.boundaries)


def _turned(degrees: float) -> np.ndarray:
    """About the Y axis, the top towards +X."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


@pytest.mark.parametrize(("name", "size"), [("biventricle", 5.0), ("slab", 5.0), ("strand", 1.0), ("sheet", 3.0)])
def test_our_own_geometries_are_in_the_frame(name: str, size: float) -> None:
    mesh = registry.build(name, size)
    check_frame(mesh, False)
    assert list(frame_warnings(mesh, False)) == []


@pytest.mark.parametrize(("factor", "height"), [(0.1, "7 mm"), (1e-3, "0.07 mm"), (1000.0, "7e+04 mm")])
def test_another_unit_of_length_is_refused_unless_it_is_stated(factor: float, height: str, small_heart: Mesh) -> None:
    mesh = Mesh(factor * small_heart.points, small_heart.cells, small_heart.boundaries)
    with pytest.raises(InvalidInput, match=r"scene: \{scale: cm\}") as refusal:
        check_frame(mesh, False)
    assert f"the mesh is {height} high" in str(refusal.value)
    check_frame(mesh, True)


def test_a_small_heart_is_told_and_a_piece_of_wall_may_be_small(small_heart: Mesh) -> None:
    rabbit = Mesh(0.4 * small_heart.points, small_heart.cells, small_heart.boundaries)
    check_frame(rabbit, False)
    assert ["is it in another unit of length than mm?" in text for text in frame_warnings(rabbit, False)] == [True]
    assert list(frame_warnings(rabbit, True)) == []
    slab = registry.build("slab", 6.0)
    check_frame(Mesh(0.1 * slab.points, slab.cells, slab.boundaries), False)
    with pytest.raises(InvalidInput, match="1 to 1000 mm"):
        check_frame(Mesh(0.001 * slab.points, slab.cells, slab.boundaries), False)


@pytest.mark.parametrize("degrees", [50.0, 90.0, 180.0, -90.0])
def test_a_heart_that_lies_or_stands_on_its_head_is_refused(degrees: float, small_heart: Mesh) -> None:
    with pytest.raises(InvalidInput, match=r"the base faces .* not upward.*apex lies below it, at negative Z"):
        check_frame(_moved(small_heart, _turned(degrees)), False)


def test_a_tilt_is_told(small_heart: Mesh) -> None:
    tilted = _moved(small_heart, _turned(20.0))
    check_frame(tilted, False)
    assert "the base is tilted by 20 degrees" in " ".join(frame_warnings(tilted, False))


@pytest.mark.parametrize("z", [20.0, -20.0])
def test_a_base_in_another_plane_is_refused(z: float, small_heart: Mesh) -> None:
    with pytest.raises(InvalidInput, match=rf"the base lies at Z = {z:g} mm.*move the mesh by {-z:g} mm along Z"):
        check_frame(_moved(small_heart, by=(0.0, 0.0, z)), False)


def test_a_base_a_little_off_is_told(small_heart: Mesh) -> None:
    near = _moved(small_heart, by=(0.0, 0.0, 3.0))
    check_frame(near, False)
    assert "the base lies at Z = 3 mm" in " ".join(frame_warnings(near, False))
    assert list(frame_warnings(_moved(small_heart, by=(0.0, 0.0, 0.1)), False)) == []


def test_a_heart_beside_the_axis_or_turned_about_it_is_told(small_heart: Mesh) -> None:
    beside = " ".join(frame_warnings(_moved(small_heart, by=(40.0, 0.0, 0.0)), False))
    assert "the left ventricle opens at X = 40" in beside
    half_turn = np.diag([-1.0, -1.0, 1.0])
    assert "the right ventricle lies in the direction X -" in " ".join(
        frame_warnings(_moved(small_heart, half_turn), False)
    )


def test_an_apex_elsewhere_than_the_parameter_has_it_is_told(small_heart: Mesh) -> None:
    short = Mesh(small_heart.points * [1.0, 1.0, 0.7], small_heart.cells, small_heart.boundaries)
    for kind, parameters, count in (
        (FiberGenerator, {}, 1),
        (FiberGenerator, {"apex_z_mm": -49.0}, 0),
        (Electrophysiology, {}, 1),
        (Electrophysiology, {"time_scale_reduction": 0.0}, 0),
    ):
        unit = kind(short)
        unit.instantiate(parameters)
        told = list(unit.warnings())
        assert len(told) == count, (kind, parameters, told)
        assert all("the lowest point of the mesh is at Z = -49 mm; give apex_z_mm: -49" in text for text in told)


def test_a_stimulus_of_everything_or_nothing_is_told(small_heart: Mesh) -> None:
    def told(**parameters: float) -> str:
        unit = Electrophysiology(small_heart)
        unit.instantiate(parameters)
        return " ".join(unit.warnings())

    assert told() == ""
    assert "no node of the mesh lies in the stimulus box" in told(stimulus_x_min_mm=500.0, stimulus_x_max_mm=600.0)
    many = told(stimulus_x_min_mm=-100.0, stimulus_x_max_mm=100.0, stimulus_half_width_mm=100.0, stimulus_depth_mm=60)
    assert f"of {small_heart.nodes} nodes lie in the stimulus box" in many


def test_tissue_that_is_torn_is_told(box) -> None:
    # Two blocks that share all nodes of their common face, and again with all but the nodes at its lower half doubled.
    whole = box(np.linspace(0, 20, 5), np.linspace(0, 12, 4), np.linspace(-20, 0, 5))
    assert list(frame_warnings(whole, False)) == []
    torn = np.flatnonzero((whole.points[:, 0] == 10.0) & (whole.points[:, 2] > -10.0))
    right = whole.centroids[:, 0] > 10.0
    cells = whole.cells.copy()
    number = np.arange(whole.nodes)
    number[torn] = whole.nodes + np.arange(len(torn))
    cells[right] = number[cells[right]]
    told = list(frame_warnings(Mesh(np.vstack([whole.points, whole.points[torn]]), cells), False))
    assert len(told) == 1
    assert told[0].startswith(f"{len(torn)} pairs of coincident nodes")
