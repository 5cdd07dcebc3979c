"""The page docs/units.md: tables of every unit's variables, from the units' own declarations."""

from pathlib import Path

from cardiac_cosim.fmus.documents import limits, notes, shape
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.unit import FALLBACKS, IMPLEMENTATION, Unit
from cardiac_cosim.units.variable import Causality, Refinement, Variable

#: What makes the error smaller.
_REFINED_BY = {Refinement.STEP: "dividing it", Refinement.MESH: "raising it", Refinement.TOLERANCE: "dividing it"}

#: What holds for many units, said once.
_ENDS = (
    "**Inputs that vary over a step.** An input keeps its value over a step (zero-order hold), unless the step is also "
    "given a value for its end. The input then varies linearly from its value to the value at the end (first-order "
    "hold), and after the step it again has the value that was set. Only units that are marked below accept values at "
    "the end of a step. Memoryless units refuse them, because only the values at the end of a step matter to them. In "
    "FMI 2.0, the values at the end are given by input derivatives of order 1."
)
_STATES = (
    "**Saved states** can be taken and restored in every phase. A state contains the parameters, the inputs, the phase "
    "and the physical state, so that the next step gives the same bits as it did after the state was saved. This also "
    "holds in an instance that has other parameters or other fibres; the instance is then prepared anew, which takes "
    "as long as its initialisation. A state of another unit or of another mesh is refused."
)
_DERIVATIVES = (
    "**Derivatives** of the outputs with respect to the inputs are exact. Units that are marked below provide "
    "products with directions of the inputs (`directional_derivative`) and products of the transpose with weights of "
    "the outputs (`adjoint_derivative`). After a step, they are the derivatives of the outputs at its end with respect "
    "to the values that its inputs had; where an input varied to another value at the end, both values change "
    "together. Before the first step, they are those of the initial outputs with respect to the initial inputs. A mean "
    "is linear, and a maximum follows the place at which it occurs. The mechanics solves with the tangent of its "
    "equilibrium, including the complete active stiffness, to round-off. It factorises this tangent once per state, "
    "and only if derivatives are requested."
)

PAGE = Path(__file__).parents[1] / "units.md"


def page() -> str:
    """Its text."""
    purpose = (
        "This page lists all units with their inputs, outputs and parameters. It is a reference for people who write a "
        "scenario, connect an FMU, or look up the default or the range of a parameter. It is written by "
        "`python docs/generate` from the declarations in `units/`."
    )
    own = " and ".join(f"`{item.name}` ({item.description})" for item in (IMPLEMENTATION, FALLBACKS))
    both = (
        f"Once it is initialised, every unit has two further texts, which are calculated parameters in FMI: {own}. The "
        "mean and the maximum of each output field that changes over time are outputs as well."
    )
    marked = (
        "Parameters marked **accuracy** determine the numerical error of their unit, through an internal time step, a "
        "mesh or a tolerance. They do not change the model."
    )
    paragraphs = ("# The units and their variables", purpose, both, marked, _ENDS, _STATES, _DERIVATIVES)
    parts = ["\n\n".join(paragraphs) + "\n"]
    return "\n".join(parts + [_unit(unit) for unit in UNITS.values()])


def _unit(unit: type[Unit]) -> str:
    summary = (unit.__doc__ or "").splitlines()[0]
    lines = [f"## `{unit.name}`\n", f"{summary}{_abilities(unit)}\n"]
    exchanged = (Causality.INPUT, Causality.OUTPUT)
    fields = [variable for variable in unit.variables() if variable.causality in exchanged]
    parameters = [variable for variable in unit.variables() if variable.causality is Causality.PARAMETER]
    lines += ["| variable | | unit of measure | shape | description |", "|---|---|---|---|---|"]
    lines += [
        f"| `{item.name}` | {item.causality.value} | {item.unit} | {shape(item)} | {item.description}{notes(item)} |"
        for item in fields
    ]
    lines += ["", "| parameter | default | unit of measure | range | description |", "|---|---|---|---|---|"]
    lines += [
        f"| `{item.name}` | {item.start} | {item.unit} | {limits(item)} | {item.description}{_accuracy(item)} |"
        for item in parameters
    ]
    return "\n".join(lines) + "\n"


def _abilities(unit: type[Unit]) -> str:
    marks = ["inputs may vary linearly over a step"] if unit.interpolates else []
    marks += ["provides derivatives"] if unit.differentiable else []
    return f" ({'; '.join(marks)})" if marks else ""


def _accuracy(variable: Variable) -> str:
    if variable.refines is None:
        return ""
    return f" (**accuracy**, {variable.refines.value}: {_REFINED_BY[variable.refines]} makes the error smaller)"
