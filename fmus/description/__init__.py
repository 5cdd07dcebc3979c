"""The modelDescription.xml of a unit's FMU, for FMI 2.0 and FMI 3.0, from the unit's own declaration."""

from collections.abc import Iterator

from ...units.mesh import Mesh
from ...units.unit import Unit
from . import fmi2, fmi3
from .size import check_size

__all__ = ["check_size", "model_description"]


def model_description(unit: type[Unit], mesh: Mesh, token: str, fmi: int) -> Iterator[str]:
    """The lines of the XML for `unit` on `mesh`; `token` is the GUID or instantiation token that its binary knows."""
    return (fmi2 if fmi == 2 else fmi3).lines(unit, mesh, token)
