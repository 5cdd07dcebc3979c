"""Units of measure in the words of FMI, the same ones in 2.0 (FMI 2.0.4, section 2.2.2) and 3.0 (section 2.4.3)."""

from collections.abc import Iterator

import numpy as np

from ...units.errors import InvalidInput
from ...units.unit import Unit
from ..xml_tag import tag

#: SI base units and factor of every unit of measure that a variable may have.
_UNITS: dict[str, dict[str, float]] = {
    "1": {},
    "deg": {"rad": 1, "factor": np.pi / 180.0},
    "mm": {"m": 1, "factor": 1e-3},
    "ml": {"m": 3, "factor": 1e-6},
    "s": {"s": 1},
    "ms": {"s": 1, "factor": 1e-3},
    "1/ms": {"s": -1, "factor": 1e3},
    "mm2/ms": {"m": 2, "s": -1, "factor": 1e-3},
    "mV": {"kg": 1, "m": 2, "s": -3, "A": -1, "factor": 1e-3},
    "1/mV": {"kg": -1, "m": -2, "s": 3, "A": 1, "factor": 1e3},
    "kPa": {"kg": 1, "m": -1, "s": -2, "factor": 1e3},
    "MPa": {"kg": 1, "m": -1, "s": -2, "factor": 1e6},
    "kPa/mm": {"kg": 1, "m": -2, "s": -2, "factor": 1e6},
    "kPa/ml": {"kg": 1, "m": -4, "s": -2, "factor": 1e9},
    "kPa s/ml": {"kg": 1, "m": -4, "s": -1, "factor": 1e9},
    "ml/kPa": {"kg": -1, "m": 4, "s": 2, "factor": 1e-9},
    "ml/s": {"m": 3, "s": -1, "factor": 1e-6},
    "MPa/mV": {"m": -3, "s": 1, "A": 1, "factor": 1e9},
}


def unit_definitions(unit: type[Unit], *more: str) -> Iterator[str]:
    """The element UnitDefinitions with what the real variables of `unit` are measured in, and `more`.

    InvalidInput for a unit of measure that is not in the table.
    """
    yield "<UnitDefinitions>"
    real = [variable for variable in unit.variables() if isinstance(variable.start, float)]
    for variable in real:
        if variable.unit not in _UNITS:
            raise InvalidInput(
                f"variable '{variable.name}' of unit '{unit.name}' is measured in '{variable.unit}', which is none of "
                f"{', '.join(_UNITS)}; use one of these"
            )
    for name in sorted({variable.unit for variable in real}.union(more)):
        base = {key: repr(value) for key, value in _UNITS[name].items()}
        yield tag("Unit", name=name) + tag("BaseUnit", **base, end=True) + "</Unit>"
    yield "</UnitDefinitions>"
