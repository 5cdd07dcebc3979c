"""Which factorisation solves the linear systems of a solid."""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec

from ...errors import InvalidInput
from ...variable import parameter
from ..solid import Solid
from .factorisation import Factorisation
from .multigrid import Multigrid
from .superlu import SuperLU
from .supernodal import Supernodal

#: Unknowns from which each kind of factors no longer fits where the rest of a heart does.
MOST_FACTORISED = {"supernodal": 500_000, "superlu": 100_000}


@dataclass(frozen=True)
class LinearSolver:
    """The linear solver of the stiffness."""

    linear_solver: str = parameter(
        "auto",
        "1",
        "supernodal: factors by rslab; superlu: factors by SciPy; multigrid: conjugate gradients with pyamg, for large "
        "meshes; auto: the first of these that is installed and suits the size of the mesh",
        choices=("auto", "supernodal", "superlu", "multigrid"),
    )

    def factorisation(self, solid: Solid) -> Factorisation:
        """The factorisation for `solid`; InvalidInput where its package is missing."""
        kind = self._kind(solid.unknowns)
        try:
            if kind == "supernodal":
                return Supernodal()
            return Multigrid(solid.space.points) if kind == "multigrid" else SuperLU()
        except ImportError as error:
            raise InvalidInput(
                f"parameter 'linear_solver' is {kind}, and its package is not installed ({error}); install it, or take "
                "linear_solver: auto"
            ) from None

    def fallback(self) -> Iterator[str]:
        """A sentence for a person where SciPy has to stand in for a faster package."""
        if self.linear_solver == "auto" and not _installed("rslab"):
            yield (
                "rslab is not installed, so SciPy's SuperLU factorises the stiffness, several times slower; "
                "install it (pip install rslab)"
            )

    def _kind(self, unknowns: int) -> str:
        if self.linear_solver != "auto":
            return self.linear_solver
        kind = "supernodal" if _installed("rslab") else "superlu"
        return "multigrid" if unknowns > MOST_FACTORISED[kind] and _installed("pyamg") else kind


def _installed(package: str) -> bool:
    return find_spec(package) is not None
