"""The page docs/reference/fmu_variables.md: the variables of every unit's FMU, from what its description is made of."""

from pathlib import Path

from cardiac_cosim.fmus.coordinates import coordinates
from cardiac_cosim.fmus.description.attributes import role
from cardiac_cosim.fmus.documents import shape
from cardiac_cosim.fmus.layout import TIME, Run, layout
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.unit import Unit

PAGE = Path(__file__).parents[1] / "reference" / "fmu_variables.md"

_HEAD = """\
# Variables of the FMUs

Written by `python docs/generate` from what the description in every FMU (`modelDescription.xml`) is made of.

What the variables mean, their limits and their defaults: [The units and their variables](../units.md). How fields
cross the boundary in the two versions of the standard: [What is in an FMU](../fmi.md).

In FMI 2.0 a field is one scalar for every value, with consecutive value references in row-major order; the numbers in
its names count from 1, so that `fiber[12,3]` is the third component in the twelfth element. In FMI 3.0 a field is one
array with the value reference of the table, which is the same on every mesh; only those of the coordinates follow the
unit's last variable. An FMU is built on one mesh, and has that mesh's numbers of nodes and elements. Times are in
seconds, as the standard has it.

"""

_TABLE = (
    "| variable | unit of measure | FMI 2.0 | FMI 3.0 | reference in FMI 3.0 | causality | variability | initial |",
    "|---|---|---|---|---|---|---|---|",
)


def page() -> str:
    """Its text."""
    # Any mesh with more than one element will do: its numbers do not appear.
    mesh = build("strand", 30.0)
    return _HEAD + "\n\n".join(_unit(unit, mesh) for unit in UNITS.values()) + "\n"


def _unit(unit: type[Unit], mesh: Mesh) -> str:
    time = _row(TIME, {"causality": "independent", "variability": "continuous"}, "–")
    rows = [_row(run, role(run.variable), _scalars(run)) for run in layout(unit, mesh)]
    constant = {"causality": "local", "variability": "constant"}
    places = [_row(known, constant, "–") for known in coordinates(unit, mesh)]
    return "\n".join([f"## The FMU of `{unit.name}`", "", *_TABLE, time, *rows, *places])


def _row(run: Run, attributes: dict[str, str], in_fmi_2: str) -> str:
    variable = run.variable
    kind = f"`{run.type_in(3)}`" + (f", {shape(variable)}" if run.shape else "")
    measure = "" if variable.unit == "1" else variable.unit
    words = (attributes["causality"], attributes["variability"], attributes.get("initial", ""))
    cells = (f"`{variable.name}`", measure, in_fmi_2, kind, str(run.reference), *words)
    return f"| {' | '.join(cells)} |"


def _scalars(run: Run) -> str:
    """The names of its scalars in FMI 2.0, the first and the last, and their type."""
    kind = f"`{run.type_in(2)}`"
    if not run.shape:
        return kind
    place = shape(run.variable)
    last = place.replace(" × ", ",")
    first = ",".join("1" for _ in run.shape)
    return f"{kind}, `{run.variable.name}[{first}]` to `{run.variable.name}[{last}]`"
