"""Displacement elements on a mesh, by what the mechanics needs of them: nodes, gradients and weights at points."""

from collections.abc import Callable
from dataclasses import dataclass

from ...arrays import FloatArray, IntArray


@dataclass(frozen=True)
class FaceRule:
    """Integration over the triangle ξ, η ≥ 0, ξ + η ≤ 1 of the shape functions of a face.

    `values` has shape (points, face nodes), `derivatives` by ξ and η shape (points, face nodes, 2), `weights`, which
    sum to ½, shape (points,).
    """

    values: FloatArray
    derivatives: FloatArray
    weights: FloatArray


@dataclass(frozen=True)
class Space:
    """The displacement's nodes, the first of which are the mesh's, and elements with straight edges.

    Parameters
    ----------
    points:
        Where the nodes are in mm, shape (nodes, 3).
    nodes:
        Node numbers of each element, the mesh's four first, shape (elements, element nodes).
    gradients:
        Gradients (1/mm) of the shape functions at the integration points, shape (elements, points, element nodes, 3).
    weights:
        Weights of the integration points in mm³, shape (elements, points).
    vertex_shares:
        Values of the linear shape functions there, shape (points, 4).
    face_rule:
        How to integrate over a face.
    face_nodes:
        From faces by their vertices, shape (faces, 3), to faces by all nodes, shape (faces, face nodes).
    """

    points: FloatArray
    nodes: IntArray
    gradients: FloatArray
    weights: FloatArray
    vertex_shares: FloatArray
    face_rule: FaceRule
    face_nodes: Callable[[IntArray], IntArray]
