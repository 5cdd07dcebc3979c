"""If these fail, who looks into a heart sees tissue that is not there, or fibres that leave it."""

import numpy as np
import pytest
from cardiac_cosim.orchestrator.participants.participant import Values
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.page.cutaway import Cutaway, cut, whole
from cardiac_cosim.report.page.fiber_marks import fiber_marks
from cardiac_cosim.report.page.shape import Shape, shape_of
from cardiac_cosim.units.mesh import Mesh
from report_kinds import RunOf

_DIRECTIONS = [(0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.6, 0.8)]


@pytest.fixture(scope="module")
def heart(run_of: RunOf) -> Shape:
    shape = shape_of(run_of("heart"))
    assert shape is not None
    return shape


def _volume(points: Values, drawn: Cutaway) -> float:
    """Enclosed by the triangles, by Gauss's theorem: right only if they are closed and all face outward."""
    corners = drawn.at(points)[drawn.triangles]
    return float(np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


def _middle(shape: Shape, away: Values) -> float:
    return float((shape.points @ away).mean())


@pytest.mark.parametrize("direction", _DIRECTIONS)
def test_both_sides_of_a_cut_are_closed_and_make_the_whole(
    heart: Shape, small_heart: Mesh, direction: tuple[float, float, float]
) -> None:
    away = np.array(direction)
    at_mm = _middle(heart, away)
    entire = _volume(heart.points, whole(heart))
    np.testing.assert_allclose(entire, small_heart.volumes.sum())
    one, other = cut(heart, away, at_mm), cut(heart, -away, -at_mm)
    assert 0.2 * entire < _volume(heart.points, one) < 0.8 * entire
    # What lies in the plane to a millionth belongs to both.
    np.testing.assert_allclose(_volume(heart.points, one) + _volume(heart.points, other), entire, rtol=1e-5)
    assert (one.at(heart.points) @ away).max() <= at_mm + 1e-4


def test_a_cut_moves_with_the_tissue(heart: Shape) -> None:
    """Under a deformation that is the same everywhere, the cut part is deformed like any other."""
    away = np.array(_DIRECTIONS[2])
    part = cut(heart, away, _middle(heart, away))
    gradient = np.array([[0.8, 0.2, 0.0], [0.0, 1.1, 0.1], [-0.1, 0.0, 0.9]])
    np.testing.assert_allclose(part.at(heart.points @ gradient.T), part.at(heart.points) @ gradient.T, atol=1e-10)
    deformed = _volume(heart.points @ gradient.T, part)
    np.testing.assert_allclose(deformed, np.linalg.det(gradient) * _volume(heart.points, part))


def test_the_rim_of_a_cut_is_an_edge(heart: Shape) -> None:
    away = np.array(_DIRECTIONS[0])
    at_mm = _middle(heart, away)
    part = cut(heart, away, at_mm)
    ends = part.at(heart.points)[part.edges(heart.points)]
    on_rim = np.abs(ends @ away - at_mm).max(axis=1) < 1e-4
    # The walls of both chambers, inside and outside.
    assert np.linalg.norm(ends[on_rim, 1] - ends[on_rim, 0], axis=1).sum() > 4.0 * np.ptp(heart.points[:, 2])
    # Edges that are not of the cut are those of the undivided body.
    entire = whole(heart)
    assert len(entire.edges(heart.points)) < 0.1 * len(entire.triangles) * 3


def test_fibres_lie_in_the_surface_and_are_carried_along(heart: Shape) -> None:
    fiber = np.tile([1.0, 0.0, 0.0], (len(heart.cells), 1))
    drawn = whole(heart)
    marks = fiber_marks(heart, drawn, fiber)
    assert len(marks.triangle) > 50
    np.testing.assert_allclose(marks.weights.sum(axis=2), 1.0)

    def ends(points: Values) -> Values:
        corners = drawn.at(points)[drawn.triangles[marks.triangle]]
        return np.einsum("nek,nkd->ned", marks.weights, corners)

    rest = ends(heart.points)
    along = rest[:, 1] - rest[:, 0]
    corners = drawn.at(heart.points)[drawn.triangles[marks.triangle]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(np.einsum("ni,ni->n", along, across), 0.0, atol=1e-6)
    # The part of the fibre within the surface is all that is seen of it.
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    within = fiber[0] - across[:, :1] * across
    cosine = np.einsum("ni,ni->n", along, within) / np.linalg.norm(along, axis=1) / np.linalg.norm(within, axis=1)
    np.testing.assert_allclose(cosine, 1.0)
    gradient = np.array([[0.8, 0.2, 0.0], [0.0, 1.1, 0.1], [-0.1, 0.0, 0.9]])
    np.testing.assert_allclose(ends(heart.points @ gradient.T), rest @ gradient.T, atol=1e-8)


def test_a_strand_is_a_tube_around_it(run_of: RunOf) -> None:
    run: StoredRun = run_of("strand")
    shape = shape_of(run)
    assert shape is not None
    assert shape.is_strand
    points = run.points_mm
    assert points is not None
    around = shape.points.reshape(len(points), -1, 3)
    np.testing.assert_allclose(around.mean(axis=1), points, atol=1e-9)
    assert (np.diff(shape.node.reshape(len(points), -1)) == 0).all()
    assert sorted(set(shape.node)) == list(range(len(points)))


def test_values_of_elements_are_weighted_means_at_nodes(heart: Shape, small_heart: Mesh) -> None:
    values = np.stack([np.full(small_heart.elements, 2.0), small_heart.volumes])
    means = heart.at_nodes(values)
    np.testing.assert_allclose(means[0], 2.0)
    node = 7
    own = small_heart.volumes[(small_heart.cells == node).any(axis=1)]
    np.testing.assert_allclose(means[1, node], (own * own).sum() / own.sum())
