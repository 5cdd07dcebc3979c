"""If these fail, the left ventricle's strains and twist are those of other tissue, or along other directions."""

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.geometry.biventricle import Biventricle
from cardiac_cosim.units.geometry.ellipsoid import level
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.lv_wall import lv_tissue, wall_directions

_INNER, _OUTER = 10.0, 20.0


def _misplaced(mesh: Mesh, angle: float = 0.0) -> float:
    """The volume that `lv_tissue` and the left ventricle's outer ellipsoid disagree on, relative to what is in that.

    The mesh is turned by `angle` about Z first, so that no place of the right ventricle can be taken for granted.
    """
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    turned = Mesh(mesh.points @ turn.T, mesh.cells, mesh.boundaries)
    inside = level(Biventricle().lv_outer, mesh.centroids) < 0.0
    return float(mesh.volumes[lv_tissue(turned) != inside].sum() / mesh.volumes[inside].sum())


@pytest.mark.parametrize("angle", [0.0, 2.0])
def test_the_left_ventricle_is_what_lies_in_its_outer_ellipsoid(small_heart, heart, angle: float) -> None:
    # Also the septum, which is a third of it, and the tissue at both junctions.
    assert _misplaced(small_heart, angle) < 0.01
    assert _misplaced(heart, angle) < 0.01


def test_a_left_ventricle_alone_is_all_of_its_tissue(heart: Mesh) -> None:
    outside = np.vstack([heart.boundary(name) for name in ("epicardium", "rv_septum", "rv_endocardium")])
    names = {name: heart.boundary(name) for name in ("base", "lv_endocardium")} | {"epicardium": outside}
    assert lv_tissue(Mesh(heart.points, heart.cells, names)).all()


def test_a_right_ventricle_without_a_septum_is_refused_by_its_name(heart: Mesh) -> None:
    names = {name: faces for name, faces in heart.boundaries.items() if name != "rv_septum"}
    with pytest.raises(InvalidInput, match="rv_septum"):
        lv_tissue(Mesh(heart.points, heart.cells, names))


def test_directions_are_orthonormal_and_longitudinal_points_to_the_base(heart: Mesh) -> None:
    directions = wall_directions(heart)
    frame = np.stack([directions[name] for name in ("radial", "longitudinal", "circumferential")], axis=1)
    np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), np.tile(np.eye(3), (heart.elements, 1, 1)), atol=1e-12)
    assert (directions["longitudinal"][:, 2] >= 0.0).all()
    assert np.abs(directions["circumferential"][:, 2]).max() < 1e-12


def test_directions_of_a_tube_are_those_of_its_coordinates(box) -> None:
    def rolled(at: np.ndarray) -> np.ndarray:
        radius, angle, z = at.T
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)

    mesh = box(
        np.linspace(_INNER, _OUTER, 5),
        np.linspace(0.0, 2.0 * np.pi, 33),
        np.linspace(-30.0, 0.0, 7),
        mapped=rolled,
        lv_endocardium=lambda at: at[:, 0] < _INNER + 1e-6,
        epicardium=lambda at: at[:, 0] > _OUTER - 1e-6,
        base=lambda at: (at[:, 2] > -1e-6) | (at[:, 2] < -30.0 + 1e-6),
    )
    outward = mesh.centroids * [1.0, 1.0, 0.0]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    expected = {"radial": outward, "circumferential": np.cross([0.0, 0.0, 1.0], outward)}
    expected["longitudinal"] = np.tile([0.0, 0.0, 1.0], (mesh.elements, 1))
    for name, directions in wall_directions(mesh).items():
        # Within the half of an element's angle.
        cosine = np.abs(np.einsum("ei,ei->e", directions, expected[name]))
        assert cosine.min() > np.cos(0.5 * 2.0 * np.pi / 32), name
