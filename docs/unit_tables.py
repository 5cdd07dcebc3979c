"""Writes docs/units.md, the tables of every unit's variables, from the units' own declarations."""

from pathlib import Path

from cardiac_cosim.fmus.documents import limits, notes, shape
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.unit import FALLBACKS, IMPLEMENTATION, Unit
from cardiac_cosim.units.variable import Causality, Refinement, Variable

#: What makes the error smaller.
_REFINED_BY = {Refinement.STEP: "dividing it", Refinement.MESH: "raising it", Refinement.TOLERANCE: "dividing it"}

PAGE = Path(__file__).parent / "units.md"


def page() -> str:
    """The text of docs/units.md."""
    origin = "Written by `python docs/unit_tables.py` from the declarations in `units/`."
    told = " and ".join(f"`{item.name}`, {item.description}" for item in (IMPLEMENTATION, FALLBACKS))
    both = f"Every unit has two texts besides, calculated parameters in FMI, once it is initialised: {told}."
    marked = (
        "Parameters marked **accuracy** decide the numerical error of their unit, by an internal time step, the mesh "
        "or a tolerance; the physics stays the same."
    )
    parts = [f"# The units and their variables\n\n{origin}\n\n{both}\n\n{marked}\n"]
    return "\n".join(parts + [_unit(unit) for unit in UNITS.values()])


def _unit(unit: type[Unit]) -> str:
    summary = (unit.__doc__ or "").splitlines()[0]
    lines = [f"## `{unit.name}`\n", f"{summary}\n"]
    exchanged = (Causality.INPUT, Causality.OUTPUT)
    fields = [variable for variable in unit.variables() if variable.causality in exchanged]
    parameters = [variable for variable in unit.variables() if variable.causality is Causality.PARAMETER]
    lines += ["| variable | | unit | shape | description |", "|---|---|---|---|---|"]
    lines += [
        f"| `{item.name}` | {item.causality.value} | {item.unit} | {shape(item)} | {item.description}{notes(item)} |"
        for item in fields
    ]
    lines += ["", "| parameter | default | unit | range | description |", "|---|---|---|---|---|"]
    lines += [
        f"| `{item.name}` | {item.start} | {item.unit} | {limits(item)} | {item.description}{_accuracy(item)} |"
        for item in parameters
    ]
    return "\n".join(lines) + "\n"


def _accuracy(variable: Variable) -> str:
    if variable.refines is None:
        return ""
    return f" (**accuracy**, {variable.refines.value}: {_REFINED_BY[variable.refines]} makes the error smaller)"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
