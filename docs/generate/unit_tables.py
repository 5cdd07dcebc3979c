"""The page docs/units.md: tables of every unit's variables, from the units' own declarations."""

from pathlib import Path

from cardiac_cosim.fmus.documents import limits, notes, shape
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.unit import FALLBACKS, IMPLEMENTATION, Unit
from cardiac_cosim.units.variable import Causality, Refinement, Variable

#: What makes the error smaller.
_REFINED_BY = {Refinement.STEP: "dividing it", Refinement.MESH: "raising it", Refinement.TOLERANCE: "dividing it"}

#: What holds for many units, told once.
_ENDS = (
    "**Inputs over a step.** An input keeps the value that was set, unless the step is given another end for it: the "
    "input then runs linearly from the value set to that end, and after the step it is again what was set. Only units "
    "that are marked so take ends; memoryless ones, of which only the end of a step matters, refuse them. In FMI 2 "
    "these are input derivatives of first order."
)
_STATES = (
    "**Saved states** can be taken and restored in every phase. They hold the parameters, the inputs, the phase and "
    "the physical state, so that the next step gives the same bits as it gave when the state was saved, also in an "
    "instance that was given other parameters or other fibres; that one is then prepared anew, which takes as long as "
    "its initialisation. A state of another unit or of another mesh is refused."
)
_DERIVATIVES = (
    "**Derivatives** of the outputs by the inputs are exact, forwards (`directional_derivative`) and transposed "
    "(`adjoint_derivative`), for the units marked so. After a step they are those of the outputs at its end by the "
    "values set for its inputs; where an input ran to another end, both ends move along. Until the first step they are "
    "those of the initial outputs by the initial inputs. Means are linear, a maximum follows the place that holds it. "
    "The mechanics solves with the tangent of its equilibrium, including all of the active stiffness, to round-off; it "
    "factorises once per state, and only if somebody asks."
)

PAGE = Path(__file__).parents[1] / "units.md"


def page() -> str:
    """Its text."""
    origin = "Written by `python docs/generate` from the declarations in `units/`."
    told = " and ".join(f"`{item.name}`, {item.description}" for item in (IMPLEMENTATION, FALLBACKS))
    both = f"Every unit has two texts besides, calculated parameters in FMI, once it is initialised: {told}."
    marked = (
        "Parameters marked **accuracy** decide the numerical error of their unit, by an internal time step, the mesh "
        "or a tolerance; the physics stays the same."
    )
    paragraphs = ("# The units and their variables", origin, both, marked, _ENDS, _STATES, _DERIVATIVES)
    parts = ["\n\n".join(paragraphs) + "\n"]
    return "\n".join(parts + [_unit(unit) for unit in UNITS.values()])


def _unit(unit: type[Unit]) -> str:
    summary = (unit.__doc__ or "").splitlines()[0]
    lines = [f"## `{unit.name}`\n", f"{summary}{_abilities(unit)}\n"]
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


def _abilities(unit: type[Unit]) -> str:
    marks = ["inputs can run to other ends"] if unit.interpolates else []
    marks += ["has derivatives"] if unit.differentiable else []
    return f" ({'; '.join(marks)})" if marks else ""


def _accuracy(variable: Variable) -> str:
    if variable.refines is None:
        return ""
    return f" (**accuracy**, {variable.refines.value}: {_REFINED_BY[variable.refines]} makes the error smaller)"
