"""The fastest mode of diffusion on a mesh, which limits explicit steps.

The largest eigenvalue of (K + G) v = λ M v, in 1/ms, whose vector is the shortest wave that the mesh has.
"""

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import ArpackNoConvergence, eigsh

from ..arrays import FloatArray
from ..errors import InvalidInput
from .monodomain import Monodomain

#: Nodes up to which all eigenvalues are computed; relative accuracy of the largest one on larger meshes.
_FEW, _ACCURACY = 300, 1e-6


def fastest_rate(equation: Monodomain, stretch: FloatArray | None = None) -> float:
    """λ_max in 1/ms at the stretches of the elements, shape (elements,); without the stretch current if not given.

    InvalidInput where the eigenvalues cannot be had.
    """
    operator = equation.diffusion
    if stretch is not None:
        operator = csr_matrix(operator + equation.conductance(stretch))
    nodes = equation.mesh.nodes
    if nodes <= _FEW:
        return float(eigh(operator.toarray(), equation.mass.toarray(), eigvals_only=True)[-1])
    # The start is the same each time, and so are the bits.
    start = np.random.default_rng(0).standard_normal(nodes)
    try:
        (largest,) = eigsh(
            operator, 1, equation.mass, which="LM", tol=_ACCURACY, v0=start, return_eigenvectors=False, ncv=40
        )
    except ArpackNoConvergence as error:
        raise InvalidInput(
            f"the fastest mode of the mesh was not found ({error}); look for degenerate elements"
        ) from None
    return float(largest)
