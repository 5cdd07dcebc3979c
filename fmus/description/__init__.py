"""The modelDescription.xml of a unit's FMU, for FMI 2.0 and FMI 3.0, from the unit's own declaration."""

from ...units.mesh import Mesh
from ...units.unit import Unit
from . import fmi2, fmi3


def model_description(unit: type[Unit], mesh: Mesh, token: str, fmi: int) -> str:
    """The XML text for `unit` on `mesh`; `token` is the GUID or instantiation token by which its binary knows it."""
    return (fmi2 if fmi == 2 else fmi3).model_description(unit, mesh, token)
