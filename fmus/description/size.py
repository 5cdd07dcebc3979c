"""How long a model description may be: what readers of XML take in, and what fits into a file of an FMU."""

from ...units.errors import InvalidInput
from ...units.mesh import Mesh
from ...units.unit import Unit
from ..layout import layout

#: Scalars of FMI 2.0, in some 220 MB of text: FMPy takes 3.4 GB of memory and half a minute to read them. Twenty times
#: as many would not fit into an archive without ZIP64, which FMI forbids (section 2.3, version needed to extract).
MOST_SCALARS = 1_000_000


def check_size(unit: type[Unit], mesh: Mesh, fmi: int) -> None:
    """InvalidInput, with the remedy, where the description of `unit` on `mesh` is too long for its readers."""
    scalars = sum(run.size for run in layout(unit, mesh))
    if fmi == 2 and scalars > MOST_SCALARS:
        raise InvalidInput(
            f"the FMI 2.0 FMU of unit '{unit.name}' would list {scalars} scalars, one for each value of its fields, "
            f"and more than {MOST_SCALARS} are too many for its readers; in FMI 3.0 a field is one variable: "
            "`cosim build --fmi 3`, `cosim run --participants fmu3`"
        )
