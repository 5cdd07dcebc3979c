"""The potential at three points, as scalars: what an electrode there would show, and a tool plots by itself."""

from dataclasses import dataclass

from ..errors import InvalidInput
from ..mesh import Mesh
from ..mesh.places import Places
from ..variable import Causality, Variable, parameter

#: The outputs by name, in the order of the probes.
PROBED = ("potential_probe_1", "potential_probe_2", "potential_probe_3")


@dataclass(frozen=True)
class Probes:
    """Where the probes are; the defaults are at the base, in the middle and near the apex of the heart (docs/model.md).

    A probe outside of the mesh, as in scenes smaller than the heart, shows the potential at the nearest place of it.
    """

    probe_1_x_mm: float = parameter(25.0, "mm", "X of probe 1")
    probe_1_y_mm: float = parameter(0.0, "mm", "Y of probe 1")
    probe_1_z_mm: float = parameter(-1.0, "mm", "Z of probe 1")
    probe_2_x_mm: float = parameter(20.0, "mm", "X of probe 2")
    probe_2_y_mm: float = parameter(0.0, "mm", "Y of probe 2")
    probe_2_z_mm: float = parameter(-40.0, "mm", "Z of probe 2")
    probe_3_x_mm: float = parameter(0.0, "mm", "X of probe 3")
    probe_3_y_mm: float = parameter(0.0, "mm", "Y of probe 3")
    probe_3_z_mm: float = parameter(-60.0, "mm", "Z of probe 3")

    def places(self, mesh: Mesh) -> Places:
        """The probes in `mesh`; InvalidInput for one that is nowhere near it."""
        points = [
            [self.probe_1_x_mm, self.probe_1_y_mm, self.probe_1_z_mm],
            [self.probe_2_x_mm, self.probe_2_y_mm, self.probe_2_z_mm],
            [self.probe_3_x_mm, self.probe_3_y_mm, self.probe_3_z_mm],
        ]
        try:
            return Places(mesh, points)
        except InvalidInput as error:
            raise InvalidInput(f"parameters 'probe_1_x_mm' to 'probe_3_z_mm': {error}") from None


def probe_outputs(depends_on: tuple[str, ...]) -> tuple[Variable, ...]:
    """The potential at every probe, of a unit whose potential follows the inputs `depends_on`."""
    return tuple(
        Variable(
            name,
            Causality.OUTPUT,
            "mV",
            f"transmembrane potential at probe {number}, or at the place of the mesh that is nearest to it",
            depends_on=depends_on,
        )
        for number, name in enumerate(PROBED, start=1)
    )
