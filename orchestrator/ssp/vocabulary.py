"""The names of System Structure and Parameterization: its namespaces, which 1.0 and 2.0 share, and its elements."""

from typing import Any

from lxml.builder import ElementMaker

from ...fmus.annotations import TOOL
from ..systems.system import System

#: The file that makes an archive a package.
STRUCTURE = "SystemStructure.ssd"

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
}
#: The namespace of the annotation in which libcosim looks for its step.
_OSP = {"osp": "http://opensimulationplatform.com/SSP/OSPAnnotations"}

#: Type of the annotation that holds what this project knows beyond the standard, as text.
ANNOTATION = f"{TOOL}.scenario"

SSD = ElementMaker(namespace=NAMESPACES["ssd"], nsmap=NAMESPACES | _OSP)
SSC = ElementMaker(namespace=NAMESPACES["ssc"], nsmap=NAMESPACES)
SSV = ElementMaker(namespace=NAMESPACES["ssv"], nsmap={key: NAMESPACES[key] for key in ("ssv", "ssc")})
HINT = ElementMaker(namespace=_OSP["osp"], nsmap=_OSP)
OWN = ElementMaker(namespace=TOOL, nsmap={None: TOOL})


def version(system: System) -> str:
    """The version of the standard that has words for `system`: FMI 3.0 came with 2.0."""
    return "1.0" if all(component.fmi == 2 for component in system.components) else "2.0"


def dimensions(shape: tuple[int, ...]) -> list[Any]:
    """The elements for the dimensions of an array, in SSP 2.0; none for a scalar."""
    return [SSC.Dimension({"size": str(size)}) for size in shape]
