"""Annotations for what FMI cannot express: where a field sits, what of it is recorded, whether a unit has memory.

The element `Unit` stands under VendorAnnotations in FMI 2.0 (FMI 2.0.4, section 2.2.6) and under Annotations in FMI 3.0
(FMI 3.0, section 2.4), each time in an element that is named TOOL.
"""

from collections.abc import Iterator

from ..units.mesh import Mesh
from ..units.statistics import Statistic
from ..units.unit import FALLBACKS as _FALLBACKS
from ..units.unit import IMPLEMENTATION as _IMPLEMENTATION
from ..units.unit import Unit
from ..units.variable import Causality, Record
from .xml_tag import tag

#: Name under which the annotations stand.
TOOL = "cardiac-cosim"

#: Namespace of the elements, so that nobody takes them for elements of FMI.
NAMESPACE = f"urn:{TOOL}:fmu"

#: The variables in which an FMU says what it computes with.
IMPLEMENTATION, FALLBACKS = _IMPLEMENTATION.name, _FALLBACKS.name


def annotations(unit: type[Unit], mesh: Mesh) -> Iterator[str]:
    """The lines of the element `Unit` on `mesh`, with a `Field` for each input and output."""
    attributes = {"xmlns:own": NAMESPACE, "name": unit.name, "memoryless": str(unit.memoryless).lower()}
    yield tag("own:Unit", end=False, **attributes)
    for variable in unit.variables():
        if variable.causality not in (Causality.INPUT, Causality.OUTPUT):
            continue
        extra = {"needs": variable.needs} if variable.needs else {}
        record = variable.recorded_on(mesh)
        if record is not Record.NOTHING:
            extra["record"] = record.value
        if variable.stand_in:
            extra["standIn"] = "true"
        if isinstance(variable, Statistic):
            extra["of"] = variable.source.name
        yield tag(
            "own:Field",
            name=variable.name,
            location=variable.location.value,
            fixed=str(variable.fixed).lower(),
            **extra,
            end=True,
        )
    yield "</own:Unit>"
