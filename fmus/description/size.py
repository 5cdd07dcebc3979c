"""How long a model description may be: what readers of XML take in, and what fits into a file of an FMU."""

from ...units.errors import InvalidInput
from ...units.mesh import Mesh
from ...units.unit import Unit
from ..layout import layout
from .fmi3 import start_list

#: Scalars of FMI 2.0, in some 220 MB of text: FMPy takes 3.4 GB of memory and half a minute to read them. Twenty times
#: as many would not fit into an archive without ZIP64, which FMI forbids (section 2.3, version needed to extract).
MOST_SCALARS = 1_000_000

#: Characters of an attribute, libxml2's limit unless a reader lifts it.
LONGEST_ATTRIBUTE = 10_000_000


def check_size(unit: type[Unit], mesh: Mesh, fmi: int) -> None:
    """InvalidInput, with the remedy, where the description of `unit` on `mesh` is too long for its readers."""
    runs = layout(unit, mesh)
    if fmi == 2:
        scalars = sum(run.size for run in runs)
        if scalars > MOST_SCALARS:
            raise InvalidInput(
                f"the FMI 2.0 FMU of unit '{unit.name}' would list {scalars} scalars, one for every value of its "
                f"fields, and more than {MOST_SCALARS} are too many for its readers; in FMI 3.0 a field is one "
                "variable: "
                "`cosim build --fmi 3`, `cosim run --participants fmu3`"
            )
        return
    for run in runs:
        if run.variable.stand_in and len(start_list(run)) > LONGEST_ATTRIBUTE:
            raise InvalidInput(
                f"the start values of the input '{run.variable.name}' of unit '{unit.name}' on {mesh.elements} "
                f"elements are more than {LONGEST_ATTRIBUTE} characters, which readers of XML refuse; exchange the "
                "fields on a coarser mesh (scene.mesh_size_mm), and refine it inside the units (parameter `refine`)"
            )
