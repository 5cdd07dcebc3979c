"""If these fail, what an element says of its nodes is added to other nodes' equations."""

import numpy as np
import pytest
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh.sparsity import Pattern


@pytest.mark.parametrize(("geometry", "size"), [("cell", 1.0), ("strand", 5.0), ("sheet", 10.0), ("slab", 6.0)])
def test_assembled_matrix_is_the_sum_of_its_parts(geometry: str, size: float) -> None:
    mesh = build(geometry, size)
    # Numbers of nodes that do not follow the mesh.
    cells = np.random.default_rng(3).permutation(mesh.nodes)[mesh.cells]
    corners = cells.shape[1]
    parts = np.random.default_rng(4).normal(size=(mesh.elements, corners, corners))
    by_hand = np.zeros((mesh.nodes, mesh.nodes))
    np.add.at(by_hand, (cells[:, :, None], cells[:, None, :]), parts)
    pattern = Pattern(cells, mesh.nodes)
    assembled = pattern.matrix(parts)
    assert assembled.has_canonical_format
    np.testing.assert_allclose(assembled.toarray(), by_hand, rtol=1e-13, atol=1e-14)
    np.testing.assert_array_equal(assembled.data[pattern.diagonal], assembled.diagonal())
    # No more entries than there are pairs of neighbours.
    assert pattern.entries == len({(a, b) for cell in cells.tolist() for a in cell for b in cell})
