"""The units by name. A new unit is a file of its own and a line here."""

from .active_stress import ActiveStress
from .eikonal import Eikonal
from .electrophysiology import Electrophysiology
from .fiber_generator import FiberGenerator
from .mechanics import LocalMechanics, Mechanics
from .test_problems import Mass, Response
from .unit import Unit

UNITS: dict[str, type[Unit]] = {
    unit.name: unit
    for unit in (
        FiberGenerator,
        Electrophysiology,
        Eikonal,
        ActiveStress,
        Mechanics,
        LocalMechanics,
        Mass,
        Response,
    )
}
